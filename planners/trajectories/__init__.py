"""Trajectories: exact pieces over time, motion in three axes, and operations on them.

Imports planners/bounds.py and planners/errors.py only.
"""
