"""Acceleration spectra of motions, and zero-residual-vibration durations.

Imports trajectories, laws and models.
"""
