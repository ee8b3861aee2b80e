"""Ctrl-C, SIGTERM and a closed terminal, counted instead of raised: once = stop in order, twice = stop now."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType

NAMES = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "SIGTERM",
    signal.SIGHUP: "the terminal was closed",
}


class Interrupts:
    """Counts SIGINT, SIGTERM and SIGHUP while it is open."""

    def __init__(self) -> None:
        self.count = 0
        self.what = ""  # the newest one
        self._before: dict[signal.Signals, object] = {}

    def __enter__(self) -> Interrupts:
        for number in NAMES:
            self._before[number] = signal.signal(number, self._hear)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def _hear(self, number: int, frame: FrameType | None) -> None:
        self.count += 1
        self.what = NAMES[signal.Signals(number)]
