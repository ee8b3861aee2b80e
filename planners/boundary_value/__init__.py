"""Two-point boundary value problems: the input of least energy between two states in a given time.

Imports models, laws, trajectories, replay and planners/problem.py.
"""
