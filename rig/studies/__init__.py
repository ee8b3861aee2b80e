"""Studies: a specification file in, a document of numbers out; no rig and no run needed. Published figures live here.

Imports all lower layers; sim_rig only through the doors servo/bench.py and vision/bench.py.
"""
