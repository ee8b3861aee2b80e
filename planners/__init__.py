"""Planners: a problem in, a trajectory and a plan with its metrics out. Pure.

Imports no other room of this project.
"""
