"""Planner's models of the load: equations of motion, modes, state space.

Imports the array types of trajectories.
"""
