"""Run of one experiment: file, job, run and log; experiment.py is the path of a run.

Imports all lower layers; sim_rig only through runtime/bench.py.
"""
