"""Synthetic video of a swinging load with its true angle, and the benchmark of trackers.

Imports all lower layers; sim_rig only through bench.py.
"""
