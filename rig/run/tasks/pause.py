"""Pause of a task's own process: tells a process that was not run from a peer that sent nothing."""

from __future__ import annotations

from comms.channels import MS

BUSY_HINT = (
    "this machine is too busy for real time: free it, or run with --virtual "
    "(`rig doctor` measures it)"
)
NOTED_PERIODS = 2  # a pause of more periods than this is worth a note


class PauseMeter:
    """Meter of the time that a task was not run between two of its ticks."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._last_ns: int | None = None
        self._pause_ns = 0

    def tick(self, t_ns: int) -> None:
        """Take the instant of a tick."""
        if self._last_ns is not None:
            self._pause_ns = max(0, t_ns - self._last_ns - self._period_ns)
        self._last_ns = t_ns

    def cause(self, age_ns: int, peer: str) -> str:
        """Word the cause of an age: the own pause if it explains half of it, else peer."""
        if 2 * self._pause_ns >= age_ns:
            return f"this process itself was not run for {self._pause_ns / MS:.0f} ms: {BUSY_HINT}"
        return peer

    @property
    def note(self) -> str:
        """Note on a pause before the newest tick; empty where the tick came in time."""
        if self._pause_ns <= NOTED_PERIODS * self._period_ns:
            return ""
        return f"; this process was not run for {self._pause_ns / MS:.0f} ms before: {BUSY_HINT}"
