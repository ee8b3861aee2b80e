"""Electric drives: servo controllers, ball screws, and the check of a motor against a motion.

Pure: no input, no output, no clock. Imports planners only.
"""
