"""Errors of the operator's side, each with an exit code that says which kind it is."""

from __future__ import annotations

OK, USAGE, REFUSED, STOPPED, FAULT, BAD_DATA = 0, 2, 3, 4, 5, 6
EXIT_STATUS = {
    OK: "ok",
    USAGE: "fault",
    REFUSED: "stopped",
    STOPPED: "stopped",
    FAULT: "fault",
    BAD_DATA: "bad_data",
}


class RigError(Exception):
    """Root of the errors of rig/: a message for the operator, and an exit code."""

    exit_code = USAGE


class ConfigError(RigError):
    """Experiment file, key or value that cannot be used."""


class RenamedKey(UserWarning):
    """Old name of a key in a file.

    It still works; the command line prints a note that names the new one.
    """


class StrangeValue(UserWarning):
    """Value that is allowed but suggests another unit; the command line prints it as a note."""


class Refused(RigError):
    """Failed check before a run; nothing has moved."""

    exit_code = REFUSED


class RunFailed(RigError):
    """Failure during a run; the robot was stopped."""

    exit_code = FAULT


class Stopped(RigError):
    """Run that ended with an exit code of its own and has no result to show."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code
