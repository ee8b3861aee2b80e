"""Servo controllers, designed once and then executed as one step per sample.

No input, no output. Imports planners only.
"""
