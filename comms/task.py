"""The task contract: sans-IO. A task opens no socket, reads no clock, never sleeps.

The runner (wall or virtual) hands over messages and ticks with their time and carries out the returned Step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from comms.messages import Message


class Send(NamedTuple):
    """A message to leave at at_ns (>= now; later = processing time)."""

    channel: str
    message: Message
    at_ns: int


class Step(NamedTuple):
    """What a task wants next. wake_ns replaces the wake asked for before; None keeps it."""

    sends: Sequence[Send] = ()
    wake_ns: int | None = None
    exit: int | None = None


NO_STEP = Step()


class Task(Protocol):
    """One of the rig's roles. on_tick serves every timer that is due."""

    name: str
    late_ticks: int  # ticks skipped because the next one was due already

    def start(self, t_ns: int) -> Step:
        """Called once, before anything else."""

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """A message of a channel this task receives (data or command) arrived at t_ns."""

    def on_tick(self, t_ns: int) -> Step:
        """The wake asked for is due (t_ns may be later than asked)."""

    def stop(self, t_ns: int) -> Step:
        """Last call; what it sends still leaves."""
