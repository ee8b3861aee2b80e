"""Sans-IO tasks of the operator's side: streamer, safety gate, operator and robot controller.

Imports lower layers and rig/errors.py.
"""
