"""Sans-IO tasks of the rig's side: streamer, safety gate, operator and robot controller.

Imports lower layers and rig/errors.py.
"""
