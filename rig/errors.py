"""What the operator's side refuses, with the exit code that says which kind it is."""

from __future__ import annotations

OK, USAGE, REFUSED, STOPPED, FAULT, BAD_DATA = 0, 2, 3, 4, 5, 6


class RigError(Exception):
    """Root of everything rig/ raises: a message for the operator, and an exit code."""

    exit_code = USAGE


class ConfigError(RigError):
    """An experiment file, key or value that cannot be used."""


class Refused(RigError):
    """A preflight check said no; nothing has moved."""

    exit_code = REFUSED


class BadData(RigError):
    """The data do not carry the answer that was asked for."""

    exit_code = BAD_DATA
