"""The gate at the last hop: bounds on what is really sent to the servos."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
from comms.task import Step
from rig.run.tasks.controller.interpolator import POLICIES
from rig.run.tasks.controller.setpoint_gate import SetpointGate
from rig.run.tasks.controller.task import ControllerSettings, ControllerTask
from rig.run.tasks.safety import Envelope

MS = 1_000_000
TICK_NS = 5 * MS
T_START_NS = 600 * MS
HOME = (0.0, 0.0, 0.0)
ENVELOPE = Envelope(
    position_min_m=-0.2,
    position_max_m=0.25,
    depth_m=0.15,
    height_m=0.1,
    speed_m_s=1.0,
    acceleration_m_s2=5.0,
)


def windows(*speeds_m_s: float) -> list[float]:
    """Places [m] of 30 ms windows at these speeds, from 0."""
    x, places = 0.0, []
    for speed in speeds_m_s:
        for _ in range(6):
            x += speed * 0.005
            places.append(x)
    return places


def first_excess(places: list[float], ticks: list[int] | None = None) -> tuple[int, str] | None:
    """Index and words of the first setpoint along X that leaves the envelope."""
    gate = SetpointGate(ENVELOPE, -1, HOME)
    for k, x in enumerate(places):
        said = gate.excess(ticks[k] if ticks else k, (x, 0.0, 0.0))
        if said is not None:
            return k, said
    return None


def test_windows_at_the_bounds_pass() -> None:
    ramp = [0.15 * k for k in range(1, 7)]
    assert first_excess(windows(*ramp, 1.0, 0.85, 0.7)) is None


def test_a_change_of_speed_beyond_the_bound_is_named_at_its_first_setpoint() -> None:
    said = "acceleration 5.03 m/s2 over 30 ms; must be <= 5.00 m/s2"
    assert first_excess(windows(0.15, 0.301)) == (6, said)


def test_a_speed_beyond_the_bound_is_named() -> None:
    ramp = [0.15 * k for k in range(1, 7)]
    assert first_excess(windows(*ramp, 1.001)) == (
        36,
        "speed 1.001 m/s over 5 ms; must be <= 1.000 m/s",
    )


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ((0.2501, 0.0, 0.0), "x = 0.2501 m; must be -0.2 to 0.25 m"),
        ((-0.2001, 0.0, 0.0), "x = -0.2001 m; must be -0.2 to 0.25 m"),
        ((0.0, -0.1501, 0.0), "y = -0.1501 m; must be -0.15 to 0.15 m"),
        ((0.0, 0.0, 0.1001), "z = 0.1001 m; must be -0.1 to 0.1 m"),
        ((float("nan"), 0.0, 0.0), "x = nan m; must be -0.2 to 0.25 m"),
    ],
)
def test_a_place_outside_the_bounds_is_named(place: Position, said: str) -> None:
    assert SetpointGate(ENVELOPE, -1, HOME).excess(0, place) == said


def test_a_robot_armed_outside_the_bounds_may_stay_and_come_back() -> None:
    gate = SetpointGate(ENVELOPE, -1, (0.251, 0.0, 0.0))
    assert gate.excess(0, (0.251, 0.0, 0.0)) is None
    assert gate.excess(1, (0.2509, 0.0, 0.0)) is None
    assert gate.excess(2, (0.2515, 0.0, 0.0)) == "x = 0.2515 m; must be -0.2 to 0.251 m"


def test_a_pause_gives_no_credit_to_a_leap() -> None:
    """Source after 0.2 s without a tick: 1.68 m/s in one step."""
    places = [*windows(0.15, 0.28), 0.0645 + 0.0084]
    found = first_excess(places, [*range(12), 52])
    assert found is not None
    assert found[0] == 12
    assert "speed" in found[1]


def test_after_a_pause_of_a_window_the_robot_starts_from_rest() -> None:
    places = windows(0.15, 0.28, 0.2)
    assert first_excess(places, list(range(18))) is None
    assert first_excess(places, [*range(12), *range(17, 23)]) is not None, "0.2 m/s from rest"


# in the controller


def controller(policy: str, envelope: Envelope = ENVELOPE) -> ControllerTask:
    """Controller that was armed and started at home."""
    task = ControllerTask(
        ControllerSettings(reference_stale_ns=300 * MS, policy=policy, envelope=envelope)
    )
    task.start(T_START_NS - TICK_NS)
    tell_joints(task, T_START_NS)
    for verb in (Verb.ARM, Verb.START):
        order = Command(seq=0, t_ns=0, id=7, to="controller", verb=verb, t_start_ns=T_START_NS)
        task.on_message("command", order, T_START_NS)
    return task


def tell_joints(task: ControllerTask, t_ns: int, position_m: Position = HOME) -> None:
    """Joint state at a position."""
    task.on_message("joint_state", axis_state(0, t_ns, position_m, HOME), t_ns)


def play(task: ControllerTask, goals: list[float]) -> tuple[list[float], list[Reply]]:
    """X of the setpoints and the reports, with one goal for each window."""
    steps: list[Step] = []
    actual = HOME  # the robot follows at once
    for tick in range(6 * len(goals)):
        t_ns = T_START_NS + tick * TICK_NS
        tell_joints(task, t_ns, actual)
        place = (goals[tick // 6], 0.0, 0.0)
        reference = Reference(seq=tick, t_ns=t_ns, t_target_ns=t_ns, position_m=place)
        task.on_message("reference", reference, t_ns)
        steps.append(task.on_tick(t_ns))
        actual = setpoints(steps[-1:])[-1]
    messages = [send.message for step in steps for send in step.sends]
    places = [position[0] for position in setpoints(steps)]
    return places, [m for m in messages if isinstance(m, Reply)]


def setpoints(steps: list[Step]) -> list[Position]:
    """Setpoints of all steps [m]."""
    messages = [send.message for step in steps for send in step.sends]
    return [m.position_m for m in messages if isinstance(m, Setpoint)]


def test_source_counts_what_leaves_the_envelope_says_it_once_and_goes_on() -> None:
    places, reports = play(controller("source"), [0.0, 0.006, 0.006, 0.012])
    assert places[-1] == pytest.approx(0.012)
    (report,) = reports
    assert (report.ok, report.exit) == (True, None)
    assert report.text == (
        "setpoints leave the envelope, policy 'source' goes on: "
        "acceleration 6.67 m/s2 over 30 ms; must be <= 5.00 m/s2"
    )


def test_bounded_needs_no_report_for_the_same_references() -> None:
    places, reports = play(controller("bounded"), [0.0, 0.006, 0.006, *[0.012] * 5])
    assert places[-1] == pytest.approx(0.012)
    assert reports == []


def test_a_bounded_controller_stops_at_the_end_of_the_workspace_without_a_report() -> None:
    """A reference that no gate has seen: 0.3 m, beyond 0.25 m."""
    places, reports = play(controller("bounded"), [0.3] * 40)
    assert max(places) == pytest.approx(0.25, abs=1e-3)
    assert max(places) <= 0.25
    assert reports == []
    keeps_the_envelope(places)


def keeps_the_envelope(places: list[float]) -> None:
    """Assert the bounds of ENVELOPE on setpoints along X, from rest at home."""
    speed_m_s = np.diff([0.0, *places]) / 0.005
    before_m_s = np.concatenate([np.zeros(6), speed_m_s])[: len(places)]
    assert np.abs(speed_m_s).max() <= ENVELOPE.speed_m_s + 1e-5
    assert np.abs(speed_m_s - before_m_s).max() / 0.03 <= ENVELOPE.acceleration_m_s2 + 1e-3
    assert min(places) >= ENVELOPE.position_min_m
    assert max(places) <= ENVELOPE.position_max_m


class Leaping:
    """Interpolator at fault: a ramp to 0.45 m/s, and after so many ticks a place of its own."""

    def __init__(self, ticks: int, leap: Position) -> None:
        self._left, self._leap = ticks, leap
        self._places = iter(windows(0.15, 0.3, 0.45, 0.45, 0.45, 0.45))

    def setpoint(self, t_ns: int, newest: Reference | None) -> Position:
        """Return the next place."""
        self._left -= 1
        return self._leap if self._left < 0 else (next(self._places), 0.0, 0.0)


LEAPS = {
    "beyond an end": ((0.2501, 0.0, 0.0), "x = 0.2501 m; must be -0.2 to 0.25 m"),
    "to the side": ((0.0, 0.2, 0.0), "y = 0.2000 m; must be -0.15 to 0.15 m"),
    "no number": ((math.nan, 0.0, 0.0), "x = nan m; must be -0.2 to 0.25 m"),
    "back home": (HOME, "speed "),
}


def leaping(monkeypatch: pytest.MonkeyPatch, ticks: int, leap: Position) -> ControllerTask:
    """Controller with that interpolator."""
    monkeypatch.setitem(POLICIES, "bounded", lambda *_: Leaping(ticks, leap))
    return controller("bounded")


@pytest.mark.parametrize(
    ("name", "ticks"),
    # home is no leap before 12 ticks
    [(n, k) for n in LEAPS for k in (0, 3, 6, 12, 25, 30) if n != "back home" or k >= 12],
)
def test_a_setpoint_outside_the_envelope_is_a_fault_and_the_robot_runs_out_to_rest(
    monkeypatch: pytest.MonkeyPatch, name: str, ticks: int
) -> None:
    leap, said = LEAPS[name]
    places, reports = play(leaping(monkeypatch, ticks, leap), [0.0] * 20)
    (report,) = reports
    assert (report.exit, report.phase, report.ok) == (5, Phase.FAULT, False)
    assert report.text.startswith(f"setpoint gate: {said}")
    assert report.text.endswith("; the robot stops")
    keeps_the_envelope(places)
    ramp = windows(0.15, 0.3, 0.45, 0.45, 0.45, 0.45)[:ticks]
    assert places[:ticks] == ramp
    assert len(set(places[-30:])) == 1, "at rest"
    if ticks > 6:  # a speed that may not end in one window
        assert places[-1] > ramp[-1], "it brakes; it does not stand at once"


def test_an_emergency_stop_ends_the_run_out_where_the_robot_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    task = leaping(monkeypatch, 20, (0.3, 0.0, 0.0))
    before, _ = play(task, [0.0] * 4)
    order = Command(seq=0, t_ns=0, id=8, to="controller", verb=Verb.ESTOP)
    t_ns = T_START_NS + 24 * TICK_NS
    task.on_message("command", order, t_ns)
    tell_joints(task, t_ns)
    steps = [task.on_tick(t_ns + k * TICK_NS) for k in range(30)]
    assert {position[0] for position in setpoints(steps)} == {before[-1]}


@pytest.mark.parametrize("verb", [Verb.STOP, Verb.ARM, Verb.START])
def test_no_other_order_ends_the_run_out_or_leaves_the_fault(
    monkeypatch: pytest.MonkeyPatch, verb: Verb
) -> None:
    undisturbed, _ = play(leaping(monkeypatch, 20, (0.3, 0.0, 0.0)), [0.0] * 10)
    task = leaping(monkeypatch, 20, (0.3, 0.0, 0.0))
    before, _ = play(task, [0.0] * 4)
    t_ns = T_START_NS + 24 * TICK_NS
    order = Command(seq=0, t_ns=0, id=8, to="controller", verb=verb, t_start_ns=t_ns)
    task.on_message("command", order, t_ns)
    tell_joints(task, t_ns)
    steps = [task.on_tick(t_ns + k * TICK_NS) for k in range(36)]
    assert before + [position[0] for position in setpoints(steps)] == undisturbed


@given(st.lists(st.floats(-0.15, 0.15), min_size=1, max_size=30))
def test_the_gate_of_a_bounded_controller_never_trips(goals: list[float]) -> None:
    bounds = msgspec.structs.replace(ENVELOPE, position_min_m=-1.0, position_max_m=1.0)
    _, reports = play(controller("bounded", bounds), goals)
    assert reports == []
