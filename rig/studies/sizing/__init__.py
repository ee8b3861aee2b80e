"""Sizing of a motor or a ball-screw axis from its file, with the published figures beside.

Imports all lower layers.
"""
