"""Exceptions of comms/."""


class CommsError(Exception):
    """Root of the exceptions of comms/."""


class PortInUse(CommsError):
    """Failure to bind a socket."""


class LogError(CommsError):
    """File that is not a log of a run, or cannot be read."""
