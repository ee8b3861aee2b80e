"""Command line: one file a verb, which parses, calls one function and prints.

Tables and JSON document of a long verb stand in a file beside it (`<verb>_tables.py`).

Imports everything but sim_rig.
"""
