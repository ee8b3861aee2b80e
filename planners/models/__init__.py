"""The load as the planner models it: equations of motion, modes, state space.

Imports the array types of trajectories.
"""
