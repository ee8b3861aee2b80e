"""Clocks: the only module that reads the system time; all others are given a time or a clock."""

from __future__ import annotations

import os
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol


class Clock(Protocol):
    """Source of the run time [ns]; 0 = start by the operator."""

    def now_ns(self) -> int:
        """Return the run time [ns]."""


class MonotonicClock:
    """CLOCK_MONOTONIC minus the start of the run; zero_ns is equal in all processes of a host."""

    def __init__(self, zero_ns: int) -> None:
        self.zero_ns = zero_ns

    def now_ns(self) -> int:
        """Return the run time [ns]."""
        return time.monotonic_ns() - self.zero_ns


def new_run_clock() -> MonotonicClock:
    """Create a run clock that starts at 0 now."""
    return MonotonicClock(time.monotonic_ns())


def epoch_now_ns() -> int:
    """Wall-clock time [ns since 1970], for the stamps of the log."""
    return time.time_ns()


def utc_now() -> datetime:
    """Return the wall time, for names and metadata only."""
    return datetime.now(UTC)


def stopwatch_s() -> float:
    """Return the time since an arbitrary zero [s], to measure computation times."""
    return time.perf_counter()


def cpu_of_s(pid: int) -> float:
    """Return the processor time of a running process (user + system) [s]; 0 after it exited."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def timer_lateness_ns(period_ns: int, ticks: int) -> list[int]:
    """Measure the wake-up latency on absolute deadlines [ns], one value a tick.

    Takes ticks * period_ns.
    """
    zero = time.monotonic_ns()
    lateness = []
    for k in range(1, ticks + 1):
        deadline = zero + k * period_ns
        time.sleep(max(0, deadline - time.monotonic_ns()) * 1e-9)
        lateness.append(time.monotonic_ns() - deadline)
    return lateness
