"""The watchdog of the following error: encoders against the delayed setpoint."""

from __future__ import annotations

import pytest

from comms.messages import (
    Command,
    Phase,
    Position,
    Reference,
    Reply,
    Setpoint,
    Verb,
    axis_state,
)
from comms.task import Send
from rig.run.tasks.controller.following import FollowingWatch
from rig.run.tasks.controller.joints import PlatformState
from rig.run.tasks.controller.task import ControllerSettings, ControllerTask

MS = 1_000_000
TICK_NS = 5 * MS
T_START_NS = 600 * MS
HOME = (0.0, 0.0, 0.0)


def platform(t_ns: int, x_m: float) -> PlatformState:
    """Platform at rest, as the encoders read it."""
    return PlatformState(t_ns, (x_m, 0.0, 0.0), HOME)


def first_fault_ns(lag_ms: int, bound_m: float, allowed_ms: int) -> int | None:
    """Instant of the fault for a setpoint at 1 m/s that a robot follows 30 ms later."""
    watch = FollowingWatch(lag_ms * MS, bound_m, allowed_ms * MS)
    for tick in range(100):
        t_ns = tick * TICK_NS
        reading = platform(t_ns, max(0.0, tick * 0.005 - 0.03))
        watch.take_platform(reading)
        if watch.fault(reading) is not None:
            return t_ns
        watch.add_setpoint(t_ns, (tick * 0.005, 0.0, 0.0))
    return None


@pytest.mark.parametrize(
    ("lag_ms", "bound_m", "fault"),
    [
        (30, 0.001, False),
        (20, 0.011, False),
        (20, 0.009, True),
        (0, 0.024, True),
        (0, 0.031, False),
    ],
)
def test_the_error_is_that_against_the_setpoint_of_the_lag_before(
    lag_ms: int, bound_m: float, fault: bool
) -> None:
    assert (first_fault_ns(lag_ms, bound_m, 50) is not None) is fault


def test_an_error_counts_from_its_first_measurement_on() -> None:
    assert first_fault_ns(20, 0.009, 0) == 30 * MS  # 20 ms after a setpoint of 10 mm
    assert first_fault_ns(20, 0.009, 50) == 80 * MS


def test_an_error_that_ends_in_time_is_forgotten() -> None:
    watch = FollowingWatch(0, 0.02, 50 * MS)
    watch.add_setpoint(0, HOME)
    for tick in range(100):
        x_m = 0.0 if tick % 10 == 9 else 0.5  # 45 ms beyond, then back
        reading = platform(tick * TICK_NS, x_m)
        watch.take_platform(reading)
        assert watch.fault(reading) is None


def play(stray_m: float, verbs: tuple[Verb, ...]) -> list[Send]:
    """All that a controller at rest sends while the robot moves away at tick 20."""
    task = ControllerTask(ControllerSettings(reference_stale_ns=300 * MS))
    task.start(T_START_NS - TICK_NS)
    task.on_message("joint_state", axis_state(0, T_START_NS, HOME, HOME), T_START_NS)
    for verb in verbs:
        order = Command(seq=0, t_ns=0, id=7, to="controller", verb=verb, t_start_ns=T_START_NS)
        task.on_message("command", order, T_START_NS)
    sends: list[Send] = []
    for tick in range(60):
        t_ns = T_START_NS + tick * TICK_NS
        x_m = stray_m if tick >= 20 else 0.0
        reading = axis_state(tick, t_ns, (x_m, 0.0, 0.0), HOME)
        task.on_message("joint_state", reading, t_ns)
        at_home: Position = HOME
        reference = Reference(seq=tick, t_ns=t_ns, t_target_ns=t_ns, position_m=at_home)
        task.on_message("reference", reference, t_ns)
        sends += task.on_tick(t_ns).sends
    return sends


@pytest.mark.parametrize("verbs", [(Verb.ARM,), (Verb.ARM, Verb.START)], ids=["armed", "running"])
def test_a_robot_that_obeys_someone_else_is_a_fault_after_50_ms(verbs: tuple[Verb, ...]) -> None:
    sends = play(-0.3, verbs)
    (report,) = [s for s in sends if isinstance(s.message, Reply)]
    assert report.at_ns == T_START_NS + 100 * MS + 50 * MS
    reply = report.message
    assert isinstance(reply, Reply)
    assert (reply.exit, reply.phase) == (5, Phase.FAULT)
    assert "following error 300.0 mm for 50 ms; must be <= 20 mm" in reply.text
    assert "(safety.following_error_ms); the robot holds" in reply.text
    assert {s.message.position_m for s in sends if isinstance(s.message, Setpoint)} == {HOME}


@pytest.mark.parametrize("stray_m", [0.0, 0.0199])
def test_a_robot_within_20_mm_is_no_fault(stray_m: float) -> None:
    sends = play(stray_m, (Verb.ARM, Verb.START))
    assert not [s for s in sends if isinstance(s.message, Reply)]
