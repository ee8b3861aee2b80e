"""Readers of records: a file of another program or a log of ours in, one signal over time out.

`read.read_signal` is the way in. Imports comms, rig.errors and rig.analysis.identify.errors.
"""
