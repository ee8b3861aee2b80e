"""Simulated plant: robot, pendulum, camera, elastic joint, ball screw; messages of a real rig.

Imports comms only, never the planners: plant and model share no code.
"""
