"""Exceptions of vision/."""


class VisionError(Exception):
    """Root of the exceptions of vision/."""
