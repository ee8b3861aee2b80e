"""The simulated plant: robot, pendulum, camera and elastic joint; it speaks the bytes of a real rig.

Imports comms only, never the planners: belief and truth share no code.
"""
