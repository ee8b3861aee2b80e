"""Starvation of the processes of a run: which ones the machine did not run in time."""

from __future__ import annotations

from collections.abc import Iterable

from comms.channels import MS
from rig.run.tasks.pause import BUSY_HINT

STARVED_NS = 50 * MS  # half of the shortest staleness bound that stops a run


class Starvation:
    """Longest lateness of each process, from its own records."""

    def __init__(self) -> None:
        self._worst_ns: dict[str, int] = {}

    def add(self, process: str, lateness_ns: Iterable[int]) -> None:
        """Take the lateness of wake-ups of a process [ns]."""
        worst_ns = max(lateness_ns, default=0)
        self._worst_ns[process] = max(worst_ns, self._worst_ns.get(process, 0))

    def reasons(self) -> list[str]:
        """Name the processes that were starved, worst first; empty where the machine kept up."""
        starved = {name: late for name, late in self._worst_ns.items() if late >= STARVED_NS}
        if not starved:
            return []
        worst_first = sorted(starved, key=lambda name: -starved[name])
        names = ", ".join(f"'{name}' for {starved[name] / MS:.0f} ms" for name in worst_first)
        return [f"not run in time: {names}: {BUSY_HINT}"]
