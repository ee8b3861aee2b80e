"""Servo controllers without input or output: designed once, then one step a sample.

Imports planners only.
"""
