"""Published tables of source 004 beside our own figures, in its definitions and exactly.

Imports all lower layers.
"""
