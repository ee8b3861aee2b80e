"""Runners of the tasks: processes on the wall clock, or one process in virtual time.

Imports lower layers and rig/run except experiment.py and doctor.py; bench.py alone imports sim_rig.
"""
