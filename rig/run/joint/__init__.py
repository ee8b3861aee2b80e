"""Elastic joint behind a drive: tables of its controllers, and the controllers by name.

Imports planners.trajectories and laws, rig.drives.servo, rig.errors and the readers of tables.
"""
