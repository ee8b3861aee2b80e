"""Grade of this machine: whether its timer keeps the rates of an experiment in real time."""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from comms.clock import timer_lateness_ns
from comms.priority import drop_priority, take_priority

PERIOD_NS = (
    5_000_000  # of bench and controller; streamer, interpolator and camera run at multiples of it
)
MEASURE_S = 3.0
PRIORITY = 10  # that of the slowest task
P99_BOUND_MS = 2.0  # above it, setpoints arrive visibly uneven
WORST_BOUND_MS = 50.0  # half of safety.robot_stale_ms, at which a run stops
MS = 1e-6  # of a nanosecond


class Grade(enum.Enum):
    """Clock modes that a machine can keep."""

    REAL_TIME_FIFO = "real time, with real-time priority (SCHED_FIFO)"
    REAL_TIME = "real time, without real-time priority"
    VIRTUAL_ONLY = "virtual time only"


class TimerLateness(NamedTuple):
    """Lateness of a 5 ms timer [ms]."""

    median_ms: float
    p99_ms: float
    worst_ms: float

    @property
    def is_kept(self) -> bool:
        """True where a run in real time would keep its deadlines."""
        return self.p99_ms <= P99_BOUND_MS and self.worst_ms <= WORST_BOUND_MS

    def __str__(self) -> str:
        ordinary = f"{self.median_ms:.2f} ms (median), {self.p99_ms:.2f} (p99)"
        return f"{ordinary}, {self.worst_ms:.2f} (worst)"


class MachineGrade(NamedTuple):
    """Grade of a machine with the measurement behind it."""

    grade: Grade
    fifo: TimerLateness | None  # None where real-time priority is not allowed
    ordinary: TimerLateness

    @property
    def can_run_in_real_time(self) -> bool:
        """True for both real-time grades."""
        return self.grade is not Grade.VIRTUAL_ONLY

    @property
    def decisive(self) -> TimerLateness:
        """The measurement that decided: with real-time priority where it is allowed."""
        return self.fifo or self.ordinary

    @property
    def reason(self) -> str:
        """One line for people: measurement, bound and, where it is exceeded, the next step."""
        how = "with real-time priority" if self.fifo else "without real-time priority"
        found = f"a 5 ms timer is late by {self.decisive} {how}"
        if self.can_run_in_real_time:
            return found
        return (
            f"{found}; must be <= {P99_BOUND_MS:g} ms (p99) and <= {WORST_BOUND_MS:g} ms (worst): "
            "this machine is too busy for real time; free it, or take --virtual"
        )


def _take_unbounded(priority: int) -> bool:
    return take_priority(priority, is_bounded=False)


Timer = Callable[[int, int], Sequence[int]]


def measure_machine(
    timer: Timer = timer_lateness_ns,
    take: Callable[[int], bool] = _take_unbounded,
    drop: Callable[[], None] = drop_priority,
) -> MachineGrade:
    """Measure the timer with and without real-time priority, three seconds together, and grade it.

    timer(period_ns, ticks) gives the lateness of each tick [ns]; take and drop change the priority
    of this process.
    """
    ticks = round(MEASURE_S * 1e9 / PERIOD_NS)
    if not take(PRIORITY):
        return grade_of(None, lateness_of(timer(PERIOD_NS, ticks)))
    try:
        fifo = lateness_of(timer(PERIOD_NS, ticks // 2))
    finally:
        drop()
    return grade_of(fifo, lateness_of(timer(PERIOD_NS, ticks - ticks // 2)))


def lateness_of(lateness_ns: Sequence[int]) -> TimerLateness:
    """Sum up the lateness of many ticks [ns]."""
    late_ms = np.asarray(lateness_ns, dtype=np.float64) * MS
    median, p99, worst = np.percentile(late_ms, [50, 99, 100])
    return TimerLateness(float(median), float(p99), float(worst))


def grade_of(fifo: TimerLateness | None, ordinary: TimerLateness) -> MachineGrade:
    """Grade a machine by its timer: tasks take real-time priority where it is allowed."""
    if fifo is not None and fifo.is_kept:
        return MachineGrade(Grade.REAL_TIME_FIFO, fifo, ordinary)
    if fifo is None and ordinary.is_kept:
        return MachineGrade(Grade.REAL_TIME, fifo, ordinary)
    return MachineGrade(Grade.VIRTUAL_ONLY, fifo, ordinary)
