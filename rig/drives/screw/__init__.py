"""Sizing of a ball-screw axis: what its cycle asks for, every check, and the chart of diameters and leads."""
