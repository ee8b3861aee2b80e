"""Roster of the tasks of a run: present, left and gone ones."""

from __future__ import annotations

STREAMS = ("control", "telemetry")  # streams of a task to the operator; each has an end of its own


class Roster:
    """State of the tasks of a run.

    Present: the sockets are open. Left: a stream of the task has ended in order. Gone: the process
    exited early or was killed.
    """

    def __init__(self) -> None:
        self.present: set[str] = set()
        self.left: set[tuple[str, str]] = set()  # task, stream
        self.gone: set[str] = set()

    def expected_ends(self) -> set[tuple[str, str]]:
        """List (task, stream) whose end comes in an orderly shutdown."""
        return {(task, stream) for task in self.present - self.gone for stream in STREAMS}
