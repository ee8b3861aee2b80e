"""Task `drive`: master of the field bus, between controller and drive.

May import what the other tasks may: comms, rig.errors, and other modules of rig.run.tasks.
"""
