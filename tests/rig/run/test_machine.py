"""The machine is graded by its timer, with real-time priority where it is allowed."""

import pytest

from rig.run.config import NetworkSection
from rig.run.doctor import examine
from rig.run.machine import Grade, grade_of, lateness_of, measure_machine

QUIET_NS = [60_000] * 300
BUSY_NS = [60_000] * 280 + [15_000_000] * 20
STALLED_NS = [60_000] * 299 + [80_000_000]


def machine(with_fifo, without, allowed=True):
    """Measure with a timer that is late by these; the periods and ticks asked for, too."""
    asked, levels = [], []

    def timer(period_ns, ticks):
        asked.append((period_ns, ticks))
        return with_fifo if levels and levels[-1] else without

    def take(priority):
        levels.append(allowed)
        return allowed

    found = measure_machine(timer, take, lambda: levels.append(False))
    return found, asked


def test_a_quiet_machine_with_real_time_priority_is_graded_so():
    found, asked = machine(QUIET_NS, BUSY_NS)
    assert found.grade is Grade.REAL_TIME_FIFO
    assert found.can_run_in_real_time
    assert sum(period * ticks for period, ticks in asked) == 3_000_000_000


def test_a_quiet_machine_without_the_right_to_priority_runs_in_real_time_without_it():
    found, asked = machine(QUIET_NS, QUIET_NS, allowed=False)
    assert found.grade is Grade.REAL_TIME
    assert sum(period * ticks for period, ticks in asked) == 3_000_000_000
    assert "without real-time priority" in found.reason


@pytest.mark.parametrize("late", [BUSY_NS, STALLED_NS])
def test_a_machine_that_wakes_late_runs_in_virtual_time_only_and_the_bound_is_named(late):
    found, _ = machine(late, late, allowed=False)
    assert found.grade is Grade.VIRTUAL_ONLY
    assert not found.can_run_in_real_time
    assert "must be <= 2 ms (p99) and <= 50 ms (worst)" in found.reason
    assert "take --virtual" in found.reason


def test_priority_is_given_back_when_the_timer_fails():
    given_back = []

    def broken(period_ns, ticks):
        raise OSError("no timer")

    with pytest.raises(OSError, match="no timer"):
        measure_machine(broken, lambda priority: True, lambda: given_back.append(True))
    assert given_back == [True]


def test_late_with_priority_decides_even_where_it_is_not_late_without():
    late, quiet = lateness_of(BUSY_NS), lateness_of(QUIET_NS)
    assert grade_of(late, quiet).grade is Grade.VIRTUAL_ONLY


def verdict_of(tmp_path, late_ns):
    """Verdict of the doctor on a machine whose timer is late by these."""
    found, _ = machine(late_ns, late_ns, allowed=False)
    return examine(tmp_path, NetworkSection(), lambda: found)


def test_the_doctor_is_ready_for_real_time_only_where_the_timer_keeps_it(tmp_path):
    quiet, busy = verdict_of(tmp_path, QUIET_NS), verdict_of(tmp_path, BUSY_NS)
    assert quiet.verdict == "ready for real time, without real-time priority: `rig run`"
    assert busy.verdict == "ready in virtual time only: `rig run --virtual`"
    (timer,) = [finding for finding in busy.findings if finding.name == "timer"]
    assert timer.status == "warning"
    assert "must be <= 2 ms (p99)" in timer.advice
