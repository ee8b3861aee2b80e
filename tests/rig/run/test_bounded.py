"""The policy `bounded`: the windows of `source` without losses, the envelope whatever is lost."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from comms.messages import Position, Reference
from rig.run.tasks.controller.braking import braking_distance_m, stopping_speed_m_s
from rig.run.tasks.controller.interpolator import POLICIES, Interpolator, PolicySettings
from rig.run.tasks.safety import Envelope

MS = 1_000_000
TICK_NS = 5 * MS
T_START_NS = 600 * MS
HOME = (0.0, 0.0, 0.0)
ENVELOPE = Envelope(position_min_m=-10, position_max_m=10, speed_m_s=1.1, acceleration_m_s2=5.5)
CHANGE_M_S = 5.5 * 0.03
FloatArray = npt.NDArray[np.float64]


def policy(name: str = "bounded", start_m: Position = HOME) -> Interpolator:
    """Interpolator with the shipped envelope."""
    return POLICIES[name](T_START_NS, start_m, PolicySettings(ENVELOPE))


def reference(k: int, x_m: float, y_m: float = 0.0) -> Reference:
    """Reference for the k-th 10 ms after t_start."""
    return Reference(seq=k, t_ns=0, t_target_ns=T_START_NS + k * 10 * MS, position_m=(x_m, y_m, 0))


def ramp(time_s: float, distance_m: float = 0.2, ends_s: float = 1.0) -> float:
    """Smooth move from rest to rest, 0.2 m in 1 s: 0.4 m/s and 1.26 m/s2 at most."""
    s = min(max(time_s / ends_s, 0.0), 1.0)
    return distance_m * (s - math.sin(2 * math.pi * s) / (2 * math.pi))


def play(
    interpolator: Interpolator, ticks: int, lost: range = range(0), skipped: range = range(0)
) -> FloatArray:
    """X of the setpoints sent [m]; lost: references that do not arrive; skipped: ticks."""
    sent, newest = [], None
    for tick in range(ticks):
        newest_index = (tick - 1) // 2  # arrives 1 ms after its instant
        if tick % 2 and newest_index not in lost:
            newest = reference(newest_index, ramp(newest_index * 0.01))
        if tick not in skipped:
            sent.append(interpolator.setpoint(T_START_NS + tick * TICK_NS, newest)[0])
    return np.array(sent)


def peaks(positions_m: FloatArray) -> tuple[float, float]:
    """Peak speed over 5 ms and acceleration as change of speed over 30 ms; at rest before."""
    at_rest = np.tile(positions_m[:1], (7, *[1] * (positions_m.ndim - 1)))
    path = np.concatenate([at_rest, positions_m]).reshape(len(positions_m) + 7, -1)
    speeds = np.diff(path, axis=0) / 0.005
    changes = (speeds[6:] - speeds[:-6]) / 0.03
    return np.linalg.norm(speeds, axis=1).max(), np.linalg.norm(changes, axis=1).max()


def test_without_losses_every_setpoint_is_that_of_source_to_the_last_digit() -> None:
    assert play(policy("bounded"), 300).tolist() == play(policy("source"), 300).tolist()


def test_a_plan_at_the_bound_itself_is_followed_to_the_last_digit() -> None:
    """5.5 m/s2 up and down, to 1.1 m/s, on the 10 ms grid of the references."""
    speeds = 5.5 * 0.01 * np.concatenate([np.arange(21), np.full(9, 20), np.arange(20, -1, -1)])
    places = np.concatenate([np.cumsum(speeds * 0.01), np.full(30, np.sum(speeds) * 0.01)])
    bounded, source = policy("bounded"), policy("source")
    for tick in range(2 * len(places) - 1):
        t_ns = T_START_NS + tick * TICK_NS
        newest = reference(tick // 2, float(places[tick // 2]))
        assert bounded.setpoint(t_ns, newest) == source.setpoint(t_ns, newest), tick


@pytest.mark.parametrize("first", range(20, 80, 7))
@pytest.mark.parametrize("length", [1, 3, 10, 30])
def test_after_a_hole_it_rejoins_the_plan_inside_the_envelope(first: int, length: int) -> None:
    got = play(policy(), 400, lost=range(first, first + length))
    whole = play(policy(), 400)
    speed_m_s, acceleration_m_s2 = peaks(got)
    assert speed_m_s <= 1.1 + 1e-5
    assert acceleration_m_s2 <= 5.5 + 1e-3
    assert got[-1] == whole[-1]
    back = 2 * (first + length) + 100  # half a second after the hole
    np.testing.assert_allclose(got[back:], whole[back:], rtol=0, atol=5e-5)


def test_source_leaves_the_envelope_after_the_same_hole() -> None:
    speed_m_s, acceleration_m_s2 = peaks(play(policy("source"), 400, lost=range(50, 60)))
    assert acceleration_m_s2 > 20
    assert speed_m_s > 1.1


@pytest.mark.parametrize("length", [1, 3, 10, 30, 100])
def test_after_a_hole_it_never_runs_ahead_of_the_plan(length: int) -> None:
    got = play(policy(), 400, lost=range(30, 30 + length))
    whole = play(policy(), 400)
    planned = np.array([ramp(tick * 0.005) for tick in range(400)])
    assert np.all(got <= planned + 1e-9)
    assert got.max() <= whole.max() + 1e-12, "no overshoot at the end"
    assert np.all(np.diff(got) >= -1e-12), "never backwards"


def test_in_a_hole_it_brakes_at_the_bound_and_then_stands() -> None:
    got = play(policy(), 160, lost=range(50, 400))
    steps = np.diff(got)[101:] / 0.005
    windows = steps[::6]  # one speed a window; the first one still has a newer reference
    assert windows[0] > CHANGE_M_S
    assert windows[1] == pytest.approx(windows[0] - CHANGE_M_S, rel=1e-9)
    np.testing.assert_allclose(windows[2:], 0.0, atol=1e-12)


@pytest.mark.parametrize("pause", [1, 3, 6, 40])
def test_after_a_pause_of_the_controller_it_goes_on_from_what_was_sent(pause: int) -> None:
    skipped = range(101, 101 + pause)
    got = play(policy(), 400, skipped=skipped)
    step_m = got[101] - got[100]
    mean_m_s = max(0.0, 1 - pause / 6) * (got[100] - got[99]) / 0.005
    assert abs(step_m / 0.005 - mean_m_s) <= CHANGE_M_S + 1e-5
    assert got[-1] == play(policy(), 400)[-1]


def test_a_tick_asked_for_twice_gives_the_same_setpoint() -> None:
    interpolator = policy()
    first = interpolator.setpoint(T_START_NS, reference(0, 0.003))
    assert interpolator.setpoint(T_START_NS, reference(1, 0.004)) == first


places = st.floats(-0.25, 0.25)


@given(st.lists(st.tuples(st.integers(0, 300), places, places), max_size=80))
@example([(219, 0.0, 0.0), (222, 0.0, 0.25)])  # 30 ms apart, to the end of the workspace
def test_whatever_references_arrive_setpoints_keep_speed_and_acceleration(
    arrivals: list[tuple[int, float, float]],
) -> None:
    interpolator, newest, sent = policy(), None, []
    for tick in range(200):
        if tick < len(arrivals):
            newest = reference(*arrivals[tick])  # late, doubled or back in time
        sent.append(interpolator.setpoint(T_START_NS + tick * TICK_NS, newest))
    speed_m_s, acceleration_m_s2 = peaks(np.array([HOME, *sent]))
    assert speed_m_s <= 1.1 + 1e-5
    assert acceleration_m_s2 <= 5.5 + 1e-3


@given(places, places)
def test_a_reference_at_rest_is_reached_without_overshoot_and_kept(x_m: float, y_m: float) -> None:
    interpolator, distances = policy(), [math.hypot(x_m, y_m)]
    for tick in range(400):
        got = interpolator.setpoint(T_START_NS + tick * TICK_NS, reference(tick, x_m, y_m))
        distances.append(math.dist(got, (x_m, y_m, 0.0)))
    assert got == (x_m, y_m, 0.0)
    assert np.all(np.diff(distances) <= 1e-12)


@given(speed_m_s=st.floats(0, 2), change_m_s=st.floats(0.01, 1), ticks=st.integers(1, 6))
def test_the_stopping_speed_is_the_inverse_of_the_braking_distance(
    speed_m_s: float, change_m_s: float, ticks: int
) -> None:
    stepwise_m = 0.03 * sum(max(0.0, speed_m_s - k * change_m_s) for k in range(1, 202))
    assert braking_distance_m(speed_m_s, change_m_s) == pytest.approx(stepwise_m, abs=1e-9)
    duration_s = ticks * 0.005
    distance_m = speed_m_s * duration_s + stepwise_m
    found = stopping_speed_m_s(distance_m, change_m_s, duration_s)
    assert found == pytest.approx(speed_m_s, rel=1e-6, abs=1e-9)
