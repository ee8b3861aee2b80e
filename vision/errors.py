"""What vision/ raises."""


class VisionError(Exception):
    """Root of everything vision/ raises."""
