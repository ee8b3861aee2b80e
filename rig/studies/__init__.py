"""Studies: a specification file in, a document of numbers out, without a rig or a run.

The published figures are here too.

Imports all lower layers; sim_rig only through the doors servo/bench.py and vision/bench.py.
"""
