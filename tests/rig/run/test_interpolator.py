"""The policy `source`: 30 ms windows, even ticks, hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from comms.messages import Position, Reference
from rig.run.tasks.controller.interpolator import Interpolator, SourceHold
from rig.run.tasks.grid import TICK_NS, TICKS, WINDOW_NS

MS = 1_000_000
HOME = (0.0, 0.0, 0.0)
T_START_NS = 600 * MS


def at(x_m: float) -> Position:
    """Position along X."""
    return (x_m, 0.0, 0.0)


def reference(position_m: Position | None) -> Reference | None:
    """Reference at a position, for no particular instant."""
    if position_m is None:
        return None
    return Reference(seq=0, t_ns=0, t_target_ns=0, position_m=position_m)


def ticks(first: int, last: int) -> list[int]:
    """Grid instants [ns], both ends included."""
    return [T_START_NS + k * TICK_NS for k in range(first, last + 1)]


def run(interpolator: Interpolator, instants: list[int], newest: Position | None) -> list[float]:
    """X of the setpoints [m]."""
    return [interpolator.setpoint(t_ns, reference(newest))[0] for t_ns in instants]


def test_a_window_is_six_ticks_of_five_milliseconds() -> None:
    assert (TICK_NS, TICKS, WINDOW_NS) == (5 * MS, 6, 30 * MS)


def test_a_goal_is_reached_in_six_even_steps() -> None:
    got = run(SourceHold(T_START_NS, HOME), ticks(0, 5), at(0.006))
    np.testing.assert_allclose(got, [0.001, 0.002, 0.003, 0.004, 0.005, 0.006], rtol=1e-12)


def test_every_axis_moves_on_its_own() -> None:
    interpolator = SourceHold(T_START_NS, (1.0, 2.0, 3.0))
    got = [interpolator.setpoint(t, reference((1.6, 1.4, 2.4))) for t in ticks(0, 5)]
    np.testing.assert_allclose(got[2], (1.3, 1.7, 2.7), rtol=1e-12)
    np.testing.assert_allclose(got[5], (1.6, 1.4, 2.4), rtol=1e-12)


def test_without_any_reference_it_stays_where_it_was_armed() -> None:
    assert run(SourceHold(T_START_NS, at(0.1)), ticks(0, 20), None) == [pytest.approx(0.1)] * 21


def test_a_reference_that_comes_inside_a_window_waits_for_the_next() -> None:
    interpolator = SourceHold(T_START_NS, HOME)
    before = run(interpolator, ticks(0, 0), at(0.006)) + run(interpolator, ticks(1, 5), at(0.1))
    np.testing.assert_allclose(before, [0.001, 0.002, 0.003, 0.004, 0.005, 0.006], rtol=1e-12)
    np.testing.assert_allclose(run(interpolator, ticks(6, 11), at(0.1))[-1], 0.1, rtol=1e-12)


def test_windows_count_from_t_start_not_from_the_run_clock() -> None:
    t_start_ns = T_START_NS + 10 * MS
    interpolator = SourceHold(t_start_ns, HOME)
    got = run(interpolator, [t_start_ns + k * TICK_NS for k in range(6)], at(0.006))
    np.testing.assert_allclose(got, [0.001, 0.002, 0.003, 0.004, 0.005, 0.006], rtol=1e-12)


def test_of_three_references_in_a_window_only_the_newest_becomes_the_goal() -> None:
    interpolator = SourceHold(T_START_NS, HOME)
    run(interpolator, ticks(0, 5), HOME)
    for newest in (at(0.01), at(0.02)):  # both superseded before the next window latches
        run(interpolator, ticks(5, 5), newest)
    np.testing.assert_allclose(
        run(interpolator, ticks(6, 11), at(0.03)), np.linspace(0.005, 0.03, 6), rtol=1e-12
    )


def test_a_dropout_of_100_ms_holds_and_then_catches_up_in_one_window() -> None:
    """Windows at 30, 60, 90, 120 ms find nothing newer; the late reference is taken at 150 ms."""
    interpolator = SourceHold(T_START_NS, HOME)
    run(interpolator, ticks(0, 5), at(0.006))
    held = run(interpolator, ticks(6, 29), at(0.006))
    np.testing.assert_allclose(held, 0.006, rtol=1e-12)
    np.testing.assert_allclose(
        run(interpolator, ticks(30, 35), at(0.036)), np.linspace(0.011, 0.036, 6), rtol=1e-12
    )


def test_skipped_ticks_leave_the_later_setpoints_as_they_were() -> None:
    whole, late = SourceHold(T_START_NS, HOME), SourceHold(T_START_NS, HOME)
    expected = run(whole, ticks(0, 11), at(0.06))
    run(late, ticks(0, 1), at(0.06))
    assert run(late, ticks(4, 11), at(0.06)) == expected[4:]


def test_a_skipped_window_start_still_latches_at_the_next_tick() -> None:
    interpolator = SourceHold(T_START_NS, HOME)
    run(interpolator, ticks(0, 4), at(0.006))
    np.testing.assert_allclose(run(interpolator, ticks(8, 8), at(0.012)), [0.009], rtol=1e-12)


@given(st.lists(st.floats(-0.25, 0.25), min_size=1, max_size=12))
def test_setpoints_never_leave_the_span_of_the_references_and_never_step_more_than_a_sixth(
    goals: list[float],
) -> None:
    interpolator = SourceHold(T_START_NS, HOME)
    reached = 0.0
    for window, goal in enumerate(goals):
        got = run(interpolator, ticks(6 * window, 6 * window + 5), at(goal))
        steps = np.diff([reached, *got])
        np.testing.assert_allclose(steps, (goal - reached) / 6, atol=1e-12)
        assert min(reached, goal) - 1e-12 <= min(got)
        assert max(got) <= max(reached, goal) + 1e-12
        reached = got[-1]
