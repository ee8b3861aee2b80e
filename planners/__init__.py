"""Planners: a problem in, a trajectory and a plan with its metrics out. Pure.

Imports nothing else of ours.
"""
