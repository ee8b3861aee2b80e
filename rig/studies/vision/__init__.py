"""Synthetic video of a swinging load with its true angle.

Imports all lower layers; sim_rig only through bench.py.
"""
