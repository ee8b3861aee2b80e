"""The envelope at the last hop, whatever happens to references, and in the shipped experiment."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comms.messages import (
    Command,
    JointState,
    Position,
    Reference,
    Reply,
    Setpoint,
    Verb,
    axis_state,
)
from rig.analysis.platform_path import PlatformPath
from rig.analysis.run_log import RunLog
from rig.run import config, experiment
from rig.run.runs import LOG
from rig.run.tasks.controller.task import ControllerSettings, ControllerTask
from rig.run.tasks.safety import Envelope, Gate

MS = 1_000_000
TICK_NS = 5 * MS
T_START_NS = 600 * MS
HOME = (0.0, 0.0, 0.0)
SPEED_M_S = 1.1
ACCELERATION_M_S2 = 5.5
ENVELOPE = Envelope(
    position_min_m=-0.25,
    position_max_m=0.25,
    depth_m=0.25,
    height_m=0.1,
    speed_m_s=SPEED_M_S,
    acceleration_m_s2=ACCELERATION_M_S2,
)
NEAR_AN_END_M = 0.03  # way from 0.5 m/s at the acceleration bound, and a window more
FloatArray = npt.NDArray[np.float64]


def plan(distances_m: list[float], time_s: float) -> list[Position]:
    """Moves from rest to rest along x and y, one after the other, on the 10 ms grid."""
    x, places = 0.0, [HOME]
    for distance_m in distances_m:
        s = np.linspace(0.0, 1.0, round(time_s / 0.01) + 1)[1:]
        path = x + distance_m * (s - np.sin(2 * np.pi * s) / (2 * np.pi))
        places += [(float(p), float(0.3 * p), 0.0) for p in path]
        x += distance_m
    return places


def hard_plan(distances_m: list[float], acceleration_m_s2: float) -> list[Position]:
    """Moves along x that speed up and brake at a constant rate, one after the other."""
    x, places = 0.0, [HOME]
    for distance_m in distances_m:
        time_s = 2.0 * (abs(distance_m) / acceleration_m_s2) ** 0.5
        s = np.linspace(0.0, 1.0, max(2, math.ceil(time_s / 0.01)) + 1)[1:]
        path = x + distance_m * np.where(s < 0.5, 2.0 * s**2, 1.0 - 2.0 * (1.0 - s) ** 2)
        places += [(float(p), 0.0, 0.0) for p in path]
        x += distance_m
    return places


def is_inside(places: list[Position]) -> bool:
    """Whether the gate of the streamer lets the plan pass."""
    gate = Gate(ENVELOPE)
    return all(gate.refusal(k * 10 * MS, place) is None for k, place in enumerate(places))


class Fate:
    """Journey of each reference, and pauses of the controller."""

    def __init__(self, choices: list[tuple[int, int, bool]], pauses: list[tuple[int, int]]) -> None:
        self._choices = choices
        self.paused: set[int] = set()
        for start, ticks in pauses:
            self.paused.update(range(start, start + ticks))

    def arrivals_ns(self, k: int) -> list[int]:
        """Arrivals of the k-th reference: none, one or two, in any order with others."""
        loss, delay_ms, doubled = self._choices[k % len(self._choices)]
        if loss == 0:
            return []
        first_ns = T_START_NS + k * 10 * MS + delay_ms * MS
        return [first_ns, first_ns + 13 * MS] if doubled else [first_ns]


def sent_ticks(
    places: list[Position], fate: Fate, policy: str = "bounded"
) -> tuple[dict[int, Position], list[Reply]]:
    """Setpoint of each tick that was served, and the reports."""
    task = ControllerTask(
        ControllerSettings(reference_stale_ns=60_000 * MS, envelope=ENVELOPE, policy=policy)
    )
    task.start(T_START_NS - TICK_NS)
    reading = axis_state(0, T_START_NS, HOME, HOME)
    task.on_message("joint_state", reading, T_START_NS)
    for verb in (Verb.ARM, Verb.START):
        order = Command(seq=0, t_ns=0, id=7, to="controller", verb=verb, t_start_ns=T_START_NS)
        task.on_message("command", order, T_START_NS)
    arrivals = [(t, k) for k in range(len(places)) for t in fate.arrivals_ns(k)]
    arrivals.sort()
    sent: dict[int, Position] = {}
    reports: list[Reply] = []
    actual = HOME
    for tick in range(2 * len(places) + 200):
        if tick in fate.paused:
            continue
        t_ns = T_START_NS + tick * TICK_NS
        while arrivals and arrivals[0][0] < t_ns:
            t_rx_ns, k = arrivals.pop(0)
            t_target_ns = T_START_NS + k * 10 * MS
            reference = Reference(
                seq=k, t_ns=t_target_ns, t_target_ns=t_target_ns, position_m=places[k]
            )
            task.on_message("reference", reference, t_rx_ns)
        reading = axis_state(0, t_ns, actual, HOME)
        task.on_message("joint_state", reading, t_ns)
        for send in task.on_tick(t_ns).sends:
            if isinstance(send.message, Setpoint):
                sent[tick] = actual = send.message.position_m
            elif isinstance(send.message, Reply):
                reports.append(send.message)
    return sent, reports


def peaks(sent: dict[int, Position]) -> tuple[float, float]:
    """Peak speed over 5 ms and acceleration over 30 ms of what is sent; the servos hold between."""
    last = max(sent)
    path = np.zeros((last + 8, 3))  # seven ticks at home before the first
    for tick in range(last + 1):
        path[tick + 7] = sent.get(tick, path[tick + 6])
    speed = np.diff(path, axis=0) / 0.005
    change = (speed[6:] - speed[:-6]) / 0.03
    served = [tick for tick in range(last + 1) if tick in sent]
    return (
        float(np.linalg.norm(speed, axis=1).max()),
        float(np.linalg.norm(change[served], axis=1).max()),
    )


fates = st.builds(
    Fate,
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 90), st.booleans()), min_size=1, max_size=40
    ),
    # pauses of at least one window, after which the servos stand
    st.lists(st.tuples(st.integers(0, 300), st.integers(6, 60)), max_size=3),
)
distances = st.lists(st.floats(-0.1, 0.1), min_size=1, max_size=3)
# to within a few millimetres of an end of the workspace, where there is no room to brake
to_an_end = st.builds(
    lambda share, sign, rest_m: [
        sign * share * (0.25 - rest_m),
        sign * (1 - share) * (0.25 - rest_m),
    ],
    st.floats(0.0, 1.0),
    st.sampled_from([-1.0, 1.0]),
    st.one_of(st.just(0.0), st.floats(0.0, 0.005)),
)
times_s = st.sampled_from([0.35, 0.5, 0.7, 1.0])
smooth_plans = st.builds(plan, st.one_of(distances, to_an_end), times_s)
plans = st.one_of(
    smooth_plans,
    st.builds(hard_plan, to_an_end, st.floats(4.0, ACCELERATION_M_S2)),
).filter(is_inside)


@settings(max_examples=300, deadline=None)
@given(plans, fates)
def test_whatever_is_lost_late_doubled_reordered_or_paused_bounded_keeps_the_envelope(
    places: list[Position], fate: Fate
) -> None:
    sent, reports = sent_ticks(places, fate, "bounded")
    speed_m_s, acceleration_m_s2 = peaks(sent)
    assert speed_m_s <= SPEED_M_S + 1e-5
    assert acceleration_m_s2 <= ACCELERATION_M_S2 + 1e-3
    assert is_in_the_workspace(sent)
    assert reports == []


@settings(max_examples=300, deadline=None)
@given(plans, fates)
def test_buffer_keeps_the_envelope_or_stops_near_an_end_with_a_hundredth_more(
    places: list[Position], fate: Fate
) -> None:
    """Across a gap it extrapolates, which near an end may go where there is no room to brake."""
    sent, reports = sent_ticks(places, fate, "buffer")
    speed_m_s, acceleration_m_s2 = peaks(sent)
    assert speed_m_s <= SPEED_M_S + 1e-5
    assert is_in_the_workspace(sent)
    if not reports:
        assert acceleration_m_s2 <= ACCELERATION_M_S2 + 1e-3
        return
    assert len(reports) == 1
    assert reports[0].text.startswith("setpoint gate: ")
    assert max(abs(x) for x, _, _ in sent.values()) >= ENVELOPE.position_max_m - NEAR_AN_END_M
    assert acceleration_m_s2 <= 1.01 * ACCELERATION_M_S2
    assert len({sent[tick] for tick in sorted(sent)[-20:]}) == 1, "it has come to rest"


def is_in_the_workspace(sent: dict[int, Position]) -> bool:
    """Whether every setpoint lies in the box, but for the rounding of a position."""
    bounds = (ENVELOPE.position_max_m, ENVELOPE.depth_m, ENVELOPE.height_m)
    return all(
        abs(value) <= bound + 1e-9
        for place in sent.values()
        for value, bound in zip(place, bounds, strict=True)
    )


@settings(max_examples=60, deadline=None)
@given(
    smooth_plans.filter(is_inside),
    st.lists(st.tuples(st.integers(0, 300), st.integers(1, 5)), max_size=5),
)
def test_short_pauses_keep_speed_and_the_way(
    places: list[Position], pauses: list[tuple[int, int]]
) -> None:
    """Under 30 ms the servos still move; the controller says nothing and ends at the goal.

    A plan that brakes hard into the very end of the workspace may be stopped by the gate instead.
    """
    sent, reports = sent_ticks(places, Fate([(1, 1, False)], pauses))
    speed_m_s, acceleration_m_s2 = peaks(sent)
    assert speed_m_s <= SPEED_M_S + 1e-5
    if reports:
        assert [report.text.split(":")[0] for report in reports] == ["setpoint gate"]
        assert abs(places[-1][0]) > ENVELOPE.position_max_m - NEAR_AN_END_M
        assert acceleration_m_s2 <= 1.05 * ACCELERATION_M_S2
        assert len({sent[tick] for tick in sorted(sent)[-20:]}) == 1, "it has come to rest"
        return
    assert sent[max(sent)] == pytest.approx(places[-1], abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(plans)
def test_undisturbed_plans_end_at_their_goal_without_a_report(places: list[Position]) -> None:
    sent, reports = sent_ticks(places, Fate([(1, 1, False)], []))
    assert reports == []
    assert sent[max(sent)] == places[-1]


# the shipped experiment


def robot_acceleration_m_s2(folder: Path) -> float:
    """Peak change of the robot's true speed over 30 ms, from the readings of its encoders."""
    run = RunLog.open(folder / LOG)
    path = PlatformPath(run.controller.robot)
    states = path.states(run.log.read("/joint_state", JointState))
    speed = {t_ns: velocity[0] for t_ns, _, velocity in states}
    changes = [abs(v - speed[t - 30 * MS]) for t, v in speed.items() if t - 30 * MS in speed]
    return float(max(changes)) / 0.03


def dropouts(folder: Path, *changes: str) -> experiment.FinishedRun:
    """Shipped experiment `dropouts` in virtual time, watched briefly."""
    chosen = config.read_experiment("dropouts", ["experiment.watch_s=2.5", *changes])
    return experiment.run(chosen, "virtual", folder, lambda *_: None, lambda *_: None)


def test_dropouts_ask_no_more_of_the_robot_than_the_envelope_and_a_tenth(tmp_path: Path) -> None:
    ran = dropouts(tmp_path)
    assert ran.outcome.exit_code == 0
    assert robot_acceleration_m_s2(ran.folder) <= 1.1 * 5.5


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_dropouts_keep_the_envelope_with_other_seeds(tmp_path: Path, seed: int) -> None:
    ran = dropouts(tmp_path, f"experiment.seed={seed}")
    assert robot_acceleration_m_s2(ran.folder) <= 1.1 * 5.5


def test_the_policy_source_leaves_the_envelope_in_dropouts(tmp_path: Path) -> None:
    ran = dropouts(tmp_path, "controller.policy=source")
    assert ran.outcome.exit_code == 0
    assert robot_acceleration_m_s2(ran.folder) > 30


def test_without_losses_the_bounded_policy_sends_what_the_source_sends_to_the_last_digit(
    tmp_path: Path,
) -> None:
    sent = []
    for policy in ("source", "bounded"):
        changes = ["camera.rate_hz=0", "experiment.watch_s=0.5", f"controller.policy={policy}"]
        chosen = config.read_experiment("move", changes)
        ran = experiment.run(chosen, "virtual", tmp_path, lambda *_: None, lambda *_: None)
        setpoints = RunLog.open(ran.folder / LOG).log.read("/setpoint", Setpoint)
        sent.append([(message.t_ns, message.values) for message in setpoints])
    assert len(sent[0]) > 500
    assert sent[0] == sent[1]
