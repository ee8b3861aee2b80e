"""Ball screw: demands of the cycle, every check, and the chart of diameters and leads.

Imports planners only.
"""
