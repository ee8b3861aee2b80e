"""Field bus of a run as an engineer sees it: names, traffic, nodes and objects.

Imports comms, rig.errors, rig.drives.cia402 and modules of rig.run; python-can, canopen and
cantools. A frame in Python's memory is a `can.Message`, as its libraries take it.
"""
