"""The one place that reads the time. Everything else is handed a time, or a clock."""

from __future__ import annotations

import os
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol


class Clock(Protocol):
    """Nanoseconds of the run clock: 0 = the operator's start."""

    def now_ns(self) -> int:
        """Time now [ns]."""


class MonotonicClock:
    """CLOCK_MONOTONIC less the run's zero; the same zero in every process of one host."""

    def __init__(self, zero_ns: int) -> None:
        self.zero_ns = zero_ns

    def now_ns(self) -> int:
        """Time now on the run clock [ns]."""
        return time.monotonic_ns() - self.zero_ns


def new_run_clock() -> MonotonicClock:
    """A run clock whose zero is now."""
    return MonotonicClock(time.monotonic_ns())


def utc_now() -> datetime:
    """Wall time, for names and metadata only."""
    return datetime.now(UTC)


def stopwatch_s() -> float:
    """Seconds from an arbitrary zero, to time computations with."""
    return time.perf_counter()


def cpu_of_s(pid: int) -> float:
    """Processor seconds a running process has used (user + system); 0 when it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def timer_lateness_ns(period_ns: int, ticks: int) -> list[int]:
    """How late this machine wakes a sleeper on absolute deadlines [ns]; takes ticks * period_ns."""
    zero = time.monotonic_ns()
    lateness = []
    for k in range(1, ticks + 1):
        deadline = zero + k * period_ns
        time.sleep(max(0, deadline - time.monotonic_ns()) * 1e-9)
        lateness.append(time.monotonic_ns() - deadline)
    return lateness
