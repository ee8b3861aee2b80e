"""Processor time of the operator and its tasks."""

from __future__ import annotations

import os

from comms.clock import cpu_of_s
from rig.run.runtime.children import Children

MIN_SPAN_S = 1e-3


class CpuMeter:
    """Meter of the share of one core that each process takes."""

    def __init__(self, children: Children) -> None:
        self._children = children
        self._start_ns = 0
        self._used_before_s: dict[str, float] = {}

    def start(self, t_ns: int) -> None:
        """Begin the measured span at t_ns."""
        self._start_ns = t_ns
        self._used_before_s = self._used_s()

    def shares(self, t_ns: int) -> dict[str, float]:
        """Measure the share of one core per process since the start; 0 for one not there then."""
        span_s = max(MIN_SPAN_S, (t_ns - self._start_ns) * 1e-9)
        return {
            name: (used_s - self._used_before_s.get(name, used_s)) / span_s
            for name, used_s in self._used_s().items()
        }

    def _used_s(self) -> dict[str, float]:
        return {"operator": cpu_of_s(os.getpid())} | self._children.cpu_s()
