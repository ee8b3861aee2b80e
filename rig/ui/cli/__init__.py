"""Command line: one file a verb; each parses, calls one function and prints.

Imports everything but sim_rig.
"""
