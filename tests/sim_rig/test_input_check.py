"""The robot's own check of its setpoints: outside the bounds it stops by itself."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from comms.messages import (
    Command,
    JointState,
    Phase,
    Reply,
    Setpoint,
    Space,
    Verb,
    axis_setpoint,
)
from comms.task import Send
from sim_rig.input_check import InputBounds, InputCheck
from sim_rig.params import BenchParams, View
from sim_rig.task import BenchTask

MS = 1_000_000
TICK_NS = 5 * MS
HOME = (0.0, 0.0, 0.0)
BOUNDS = InputBounds(
    lower_m=(-0.2, -0.15, -0.1),
    upper_m=(0.25, 0.15, 0.1),
    speed_m_s=1.0,
    acceleration_m_s2=5.0,
)
COUNTING = InputBounds(
    lower_m=(-0.2, -0.15, -0.1),
    upper_m=(0.25, 0.15, 0.1),
    speed_m_s=1.0,
    acceleration_m_s2=5.0,
    stops=False,
)


def windows(*speeds_m_s: float) -> list[float]:
    """Places [m] of 30 ms windows at these speeds, from 0."""
    x, places = 0.0, []
    for speed in speeds_m_s:
        for _ in range(6):
            x += speed * 0.005
            places.append(x)
    return places


RAMP = windows(*[0.15 * k for k in range(1, 7)], 1.0, 1.0, 0.85, 0.7)


def first_excess(places: list[float], arrived: list[int], pause: int = 0) -> str | None:
    """Words of the first setpoint outside; arrived: sequence numbers; pause [ticks] before 12."""
    check = InputCheck(BOUNDS, HOME)
    for seq in arrived:
        tick = seq + (pause if seq >= 12 else 0)
        said = check.excess(seq, tick * TICK_NS + 123, (places[seq], 0.0, 0.0))
        if said is not None:
            return said
    return None


def test_setpoints_at_the_bounds_pass() -> None:
    assert first_excess(RAMP, list(range(len(RAMP)))) is None


@given(st.lists(st.integers(1, 6), max_size=60))
def test_lost_setpoints_do_not_stop_the_robot(gaps: list[int]) -> None:
    """Losses of up to five setpoints in a row, anywhere."""
    arrived = [0, *itertools.accumulate(gaps)]
    known = [seq for seq in arrived if seq < len(RAMP)]
    rest = range(known[-1] + 1, len(RAMP))
    assert first_excess(RAMP, [*known, *rest]) is None


def test_a_hold_is_never_outside() -> None:
    moving = windows(0.15, 0.3)
    places = [*moving, *[moving[-1]] * 6]
    assert first_excess(places, list(range(18))) is None


@pytest.mark.parametrize(
    ("speeds", "said"),
    [
        ((0.151,), "acceleration 5.03 m/s2; must be <= 5.00 m/s2"),
        ((0.15, -0.01), "acceleration 5.33 m/s2; must be <= 5.00 m/s2"),
        ((0.15, 0.3, 1.23), "speed 1.230 m/s; must be <= 1.000 m/s"),
    ],
)
def test_a_window_outside_is_named(speeds: tuple[float, ...], said: str) -> None:
    places = windows(*speeds)
    assert first_excess(places, list(range(len(places)))) == said


def test_a_pause_of_the_sender_gives_no_credit_to_a_leap() -> None:
    places = [*windows(0.15, 0.3), 0.0135 + 0.05]
    said = first_excess(places, list(range(13)), pause=40)
    assert said == "speed 10.000 m/s; must be <= 1.000 m/s"


def test_after_a_pause_of_the_sender_the_robot_starts_from_rest() -> None:
    places = windows(0.15, 0.3, 0.2)
    assert first_excess(places, list(range(18))) is None
    assert first_excess(places, list(range(18)), pause=6) is not None


def sent(task: BenchTask, seq: int, x_m: float) -> list[Send]:
    """Steps of the bench after a setpoint for tick seq, up to the next tick."""
    t_ns = seq * TICK_NS
    first = task.on_message("setpoint", axis_setpoint(seq, t_ns, (x_m, 0.0, 0.0)), t_ns)
    return [*first.sends, *task.on_tick(t_ns + TICK_NS).sends]


def farthest_m(sends: list[Send]) -> float:
    """Largest x that the encoders read."""
    return max(abs(s.message.position_m[0]) for s in sends if isinstance(s.message, JointState))


def after_a_forged_setpoint(bounds: InputBounds | None) -> list[Send]:
    """A slow motion, one setpoint of -9.9 m with seq + 100000, then nothing newer for 1 s."""
    task = BenchTask(BenchParams(view=View(rate_hz=0.0), input=bounds))
    task.start(0)
    sends = []
    for seq, x_m in enumerate(windows(0.1, 0.1), start=1):
        sends += sent(task, seq, x_m)
    forged = axis_setpoint(100_012, 13 * TICK_NS, (-9.9, 0.0, 0.0))
    sends += task.on_message("setpoint", forged, 13 * TICK_NS).sends
    for tick in range(14, 214):
        sends += task.on_tick(tick * TICK_NS).sends
    return sends


def test_a_forged_setpoint_does_not_move_the_robot_and_is_a_fault_with_the_figure() -> None:
    sends = after_a_forged_setpoint(BOUNDS)
    assert farthest_m(sends) < 0.008
    (report,) = [s.message for s in sends if isinstance(s.message, Reply)]
    assert (report.ok, report.exit, report.phase) == (False, 5, Phase.FAULT)
    assert report.text == (
        "setpoint outside the envelope: x = -9.9000 m; must be -0.2 to 0.25 m; "
        "the robot stopped by itself"
    )


@pytest.mark.parametrize("bounds", [None, COUNTING], ids=["no bounds", "counting"])
def test_without_bounds_or_counting_alone_the_robot_follows(bounds: InputBounds | None) -> None:
    """At 360 m/s it takes the load up with it, where the simulation ends."""
    sends = after_a_forged_setpoint(bounds)
    assert farthest_m(sends) > 0.5
    (report,) = [s.message for s in sends if isinstance(s.message, Reply)]
    assert report.text.startswith("the load swung up to the robot")


def test_a_robot_that_stopped_by_itself_takes_no_setpoint_any_more() -> None:
    task = BenchTask(BenchParams(view=View(rate_hz=0.0), input=BOUNDS))
    task.start(0)
    sends = sent(task, 1, 0.2)
    for seq in range(2, 300):
        sends += sent(task, seq, 0.0004 * seq)
    assert farthest_m(sends) == 0.0
    assert len([s for s in sends if isinstance(s.message, Reply)]) == 1


@pytest.mark.parametrize(
    ("space", "count", "said"),
    [
        pytest.param(Space.RADIANS, 6, "setpoint of 6 joints in rad", id="six_in_rad"),
        pytest.param(Space.RADIANS, 3, "setpoint of 3 joints in rad", id="three_in_rad"),
        pytest.param(Space.METRES, 2, "setpoint of 2 joints in m", id="two_in_m"),
    ],
)
@pytest.mark.parametrize("bounds", [None, COUNTING, BOUNDS], ids=["none", "counting", "stopping"])
def test_a_setpoint_for_another_robot_does_not_move_this_one_and_stops_it(
    bounds: InputBounds | None, space: Space, count: int, said: str
) -> None:
    task = BenchTask(BenchParams(view=View(rate_hz=0.0), input=bounds))
    task.start(0)
    values = (*[0.02] * count, *[0.0] * (6 - count))
    foreign = Setpoint(seq=1, t_ns=TICK_NS, space=space, count=count, values=values)
    sends = list(task.on_message("setpoint", foreign, TICK_NS).sends)
    (report,) = [s.message for s in sends if isinstance(s.message, Reply)]
    assert (report.id, report.ok, report.exit, report.phase) == (0, False, 5, Phase.FAULT)
    assert report.text == f"{said}; must be x, y, z in m; the robot stopped by itself"
    for seq in range(2, 100):
        sends += sent(task, seq, 0.0004 * seq)
    assert farthest_m(sends) == 0.0
    assert len([s for s in sends if isinstance(s.message, Reply)]) == 1
    status = Command(seq=0, t_ns=0, id=3, to="bench", verb=Verb.STATUS)
    (answer,) = task.on_message("command", status, 100 * TICK_NS).sends
    assert isinstance(answer.message, Reply)
    assert answer.message.phase is Phase.FAULT


def test_a_moving_robot_stops_at_its_last_own_setpoint_when_one_for_another_comes() -> None:
    task = BenchTask(BenchParams(view=View(rate_hz=0.0), input=BOUNDS))
    task.start(0)
    places = windows(0.1, 0.1)
    for seq, x_m in enumerate(places, start=1):
        sent(task, seq, x_m)
    foreign = Setpoint(
        seq=13, t_ns=13 * TICK_NS, space=Space.RADIANS, count=3, values=(1.0,) * 3 + (0.0,) * 3
    )
    task.on_message("setpoint", foreign, 13 * TICK_NS)
    later = [send for tick in range(14, 214) for send in task.on_tick(tick * TICK_NS).sends]
    readings = [s.message for s in later if isinstance(s.message, JointState)]
    assert readings[-1].position_m == pytest.approx((places[-1], 0.0, 0.0), abs=1e-6)


def test_counting_counts_every_setpoint_outside() -> None:
    check = InputCheck(COUNTING, HOME)
    for seq, x_m in enumerate(windows(0.15, 0.4, 0.4)):
        check.excess(seq, seq * TICK_NS, (x_m, 0.0, 0.0))
    assert check.excesses == 6
