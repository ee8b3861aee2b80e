"""Simulated plant: robot, pendulum, camera and elastic joint, with the messages of a real rig.

Imports comms only, never the planners: plant and model share no code.
"""
