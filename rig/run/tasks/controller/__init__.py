"""The robot controller: communication (newest reference in, state out) and 30 ms interpolation.

Imports comms and rig/errors.py.
"""
