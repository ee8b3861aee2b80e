"""Kinematics of robots whose joints are not the axes of the platform.

Imports planners/errors.py only. The simulated robot has an implementation of its own.
"""
