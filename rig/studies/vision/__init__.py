"""Synthetic video with its truth.

Imports all lower layers; sim_rig only through bench.py.
"""
