"""Comparisons of drive controllers on a simulated elastic joint: numbers, no printing.

Imports all lower layers; sim_rig only through bench.py.
"""
