"""Task contract, sans-IO: a task opens no socket, reads no clock and never sleeps.

The runner (wall or virtual time) passes messages and ticks with their time and executes the
returned Step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from comms.messages import Message


class Send(NamedTuple):
    """Message to send at at_ns (>= now; the difference is processing time)."""

    channel: str
    message: Message
    at_ns: int


class Step(NamedTuple):
    """Output of a task: messages, next wake, exit code.

    wake_ns replaces the wake requested before; None keeps it.
    """

    sends: Sequence[Send] = ()
    wake_ns: int | None = None
    exit: int | None = None


NO_STEP = Step()


class Task(Protocol):
    """Task of the rig. on_tick serves every timer that is due."""

    name: str

    @property
    def late_ticks(self) -> int:
        """Number of ticks that were skipped because the next one was already due."""

    def start(self, t_ns: int) -> Step:
        """Start the task; called once, before all other methods."""

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Process a message that arrived at t_ns on a channel of this task (data or command)."""

    def on_tick(self, t_ns: int) -> Step:
        """Process the requested wake; t_ns may be later than requested."""

    def stop(self, t_ns: int) -> Step:
        """Stop the task; the last call. The messages of its Step are still sent."""
