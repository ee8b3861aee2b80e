"""Ctrl-C, SIGTERM and a closed terminal, counted instead of raised.

The first one stops the run in order, the second one at once.
"""

from __future__ import annotations

import signal
from types import FrameType, TracebackType

NAMES = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "SIGTERM",
    signal.SIGHUP: "the terminal was closed",
}


class Interrupts:
    """Counter of SIGINT, SIGTERM and SIGHUP while it is open."""

    def __init__(self) -> None:
        self.count = 0
        self.newest = ""  # name of the newest signal
        self._handlers_before: dict[signal.Signals, object] = {}

    def __enter__(self) -> Interrupts:
        for number in NAMES:
            self._handlers_before[number] = signal.signal(number, self._count)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._handlers_before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def _count(self, number: int, frame: FrameType | None) -> None:
        self.count += 1
        self.newest = NAMES[signal.Signals(number)]
