"""What the operator's side refuses, with the exit code that says which kind it is."""

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
    """Root of everything rig/ raises: a message for the operator, and an exit code."""

    exit_code = USAGE


class ConfigError(RigError):
    """An experiment file, key or value that cannot be used."""


class RenamedKey(UserWarning):
    """An old name of a key in a file; it still works, and the command line prints a note that names the new one."""


class Refused(RigError):
    """A preflight check said no; nothing has moved."""

    exit_code = REFUSED


class RunFailed(RigError):
    """Something broke while the run was under way; the robot was stopped."""

    exit_code = FAULT


class Stopped(RigError):
    """A run that ended with an exit code of its own and has no result to show."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code
