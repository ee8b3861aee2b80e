"""Two-point boundary value problems: minimum-energy input between two states in a given time.

Imports models, laws, trajectories, replay and planners/problem.py.
"""
