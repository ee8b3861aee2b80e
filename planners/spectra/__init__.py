"""Acceleration spectra of motions, and durations with zero residual vibration.

Imports trajectories, laws and models.
"""
