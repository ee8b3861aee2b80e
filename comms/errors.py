"""What can go wrong between tasks."""


class CommsError(Exception):
    """Root of everything comms/ raises."""


class PortInUse(CommsError):
    """A socket of ours could not be bound."""


class LogError(CommsError):
    """A file that is not a log of ours, or cannot be read at all."""
