"""Logged message as the reader of a log keeps it."""

from __future__ import annotations

from typing import NamedTuple


class Entry(NamedTuple):
    """Logged message, not decoded; its stamps are run time."""

    log_ns: int
    publish_ns: int
    data: bytes
