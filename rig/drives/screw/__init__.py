"""Ball screw: demand of the cycle, checks of the limits, region of diameters and leads.

Imports planners only.
"""
