"""Sizing: a motor or a ball-screw axis from its file, judged, beside the published figures.

Imports all lower layers.
"""
