"""Modes of operation of CiA 402: homing, profile position, cyclic synchronous modes, stop.

No input, no output, no clock. Imports the files of rig/drives/cia402 that hold axis and units.
"""
