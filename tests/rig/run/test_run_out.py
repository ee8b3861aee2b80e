"""Controlled stop: whatever the motion before, it decelerates inside the envelope to rest."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from comms.messages import Position
from rig.run.tasks.run_out import RunOut, duration_ns
from rig.run.tasks.safety import Envelope

STEP_S, MEMORY = 0.005, 6
CHANGE_M_S = 5.5 * STEP_S * MEMORY
ENVELOPE = Envelope(
    position_min_m=-9.0,
    position_max_m=9.0,
    depth_m=9.0,
    height_m=9.0,
    speed_m_s=1.1,
    acceleration_m_s2=5.5,
)
STEPS = 300


@st.composite
def motions(draw: st.DrawFn) -> list[Position]:
    """Positions in linear windows of six steps, the change of velocity within the envelope."""
    position, velocity = np.zeros(3), np.zeros(3)
    places = [(0.0, 0.0, 0.0)]
    for _ in range(draw(st.integers(1, 12))):
        change = np.array(draw(st.tuples(*[st.floats(-1, 1)] * 3)))
        velocity = velocity + change * CHANGE_M_S / max(1.0, float(np.linalg.norm(change)))
        speed = float(np.linalg.norm(velocity))
        velocity = velocity / max(1.0, speed / 1.1)
        for _ in range(MEMORY):
            position = position + velocity * STEP_S
            places.append((float(position[0]), float(position[1]), float(position[2])))
    return places[: draw(st.integers(1, len(places)))]


def stopped(places: list[Position], envelope: Envelope = ENVELOPE) -> np.ndarray:
    """Positions before and after a stop, (n, 3)."""
    run_out = RunOut(envelope, STEP_S, MEMORY)
    for place in places:
        run_out.follow(place)
    return np.array([*places, *(run_out.next() for _ in range(STEPS))])


@given(motions())
def test_a_stop_keeps_speed_and_acceleration_of_the_envelope(places: list[Position]) -> None:
    velocity = np.diff(stopped(places), axis=0) / STEP_S
    velocity = np.concatenate([np.zeros((MEMORY, 3)), velocity])
    change_m_s = np.linalg.norm(velocity[MEMORY:] - velocity[:-MEMORY], axis=1)
    assert change_m_s.max() <= CHANGE_M_S + 2e-5
    speed_m_s = np.linalg.norm(velocity, axis=1)[len(places) - 1 + MEMORY - 1 :]
    assert np.diff(speed_m_s).max() <= 1e-9, "never faster than before"


@given(motions())
def test_a_stop_ends_at_rest_within_its_duration_and_stays(places: list[Position]) -> None:
    path = stopped(places)
    steps = math.ceil(duration_ns(ENVELOPE) * 1e-9 / STEP_S) + 2 * MEMORY
    rest = path[len(places) - 1 + steps :]
    assert (rest == rest[0]).all()


def test_a_stop_at_constant_speed_takes_one_bound_from_each_window() -> None:
    speed_m_s = 0.4
    places = [(k * speed_m_s * STEP_S, 0.0, 0.0) for k in range(20)]
    speeds = np.diff(stopped(places)[19:, 0]) / STEP_S
    expected = [0.4 - CHANGE_M_S] * 6 + [0.4 - 2 * CHANGE_M_S] * 6 + [0.0] * 6
    assert speeds[:18] == pytest.approx(expected, abs=5e-6)


def test_a_stop_at_rest_moves_nothing() -> None:
    path = stopped([(0.1, 0.2, 0.3)] * 10)
    assert {tuple(place) for place in path} == {(0.1, 0.2, 0.3)}


def test_a_stop_before_the_first_position_gives_none() -> None:
    assert RunOut(ENVELOPE, STEP_S, MEMORY).next() is None


def test_a_stop_does_not_run_beyond_the_bounds_of_position() -> None:
    near = Envelope(position_min_m=-0.1, position_max_m=0.1, speed_m_s=1.1, acceleration_m_s2=5.5)
    places = [(0.099 + (k - 19) * 0.002, 0.0, 0.0) for k in range(20)]
    path = stopped(places, near)
    assert path[:, 0].max() == 0.1
    assert path[-1, 0] == 0.1


def test_a_pause_of_the_sender_leaves_the_share_of_the_speed_that_it_is_told() -> None:
    run_out = RunOut(ENVELOPE, STEP_S, MEMORY)
    for k in range(20):
        run_out.follow((k * 0.002, 0.0, 0.0))
    run_out.slow_down(0.0)
    assert run_out.next() == (19 * 0.002, 0.0, 0.0)


def test_a_leap_that_left_the_envelope_before_is_brought_to_rest_all_the_same() -> None:
    path = stopped([(0.0, 0.0, 0.0)] * 10 + [(0.01 * k, 0.0, 0.0) for k in range(1, 4)])
    assert (path[-50:] == path[-1]).all()


@pytest.mark.parametrize(("speed_m_s", "ms"), [(1.1, 200), (0.55, 100)])
def test_the_longest_time_of_a_stop_follows_from_speed_and_acceleration(
    speed_m_s: float, ms: int
) -> None:
    envelope = Envelope(
        position_min_m=-1, position_max_m=1, speed_m_s=speed_m_s, acceleration_m_s2=5.5
    )
    assert duration_ns(envelope) == ms * 1_000_000
