"""Bench with a node: frames, samples of the drive and the load on the axis, by a logic of its own.

The logic of these tests holds a torque and notes its calls; it is no drive.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comms.messages import CanMessage, Command, Reply, Truth, Verb, axis_setpoint
from comms.task import Send
from sim_rig.ball_screw_axis import AxisReading
from sim_rig.ball_screw_params import BallScrewParams
from sim_rig.can_bench import CanBench
from sim_rig.params import BenchParams, PendulumParams, RobotParams, View
from sim_rig.task import BenchTask

MS = 1_000_000
UNTIMED = settings(deadline=None)  # a busy machine is no failure
FREE = BallScrewParams(
    coulomb_force_n=0.0, viscous_friction_n_s_m=0.0, preload_drag_n_m=0.0, efficiency=1.0
)


class NotingLogic:
    """Logic that holds a torque, notes its calls, answers a frame and sends every 20 ms."""

    def __init__(self, torque_n_m: float = 0.0) -> None:
        self.torque_n_m = torque_n_m
        self.samples: list[tuple[int, AxisReading]] = []
        self.frames: list[tuple[int, int, bytes, bool]] = []

    def start(self, t_ns: int) -> list[tuple[int, bytes]]:
        self.samples, self.frames = [], []  # the bench is made once before its start, too
        return [(0x701, b"\0")]

    def frame(
        self, can_id: int, data: bytes, is_remote: bool, t_ns: int
    ) -> list[tuple[int, bytes]]:
        self.frames.append((t_ns, can_id, data, is_remote))
        return [(0x581, data)]

    def sample(self, t_ns: int, reading: AxisReading) -> float:
        self.samples.append((t_ns, reading))
        return self.torque_n_m

    def time(self, t_ns: int) -> list[tuple[int, bytes]]:
        return [(0x701, b"\x05")] if t_ns % (20 * MS) == 0 else []


def bench(
    logic: NotingLogic,
    axis: BallScrewParams = FREE,
    pendulum: PendulumParams | None = None,
) -> BenchTask:
    params = BenchParams(
        axis=axis,
        robot=RobotParams(start_m=axis.start_m),
        pendulum=pendulum or PendulumParams(),
        view=View(rate_hz=0.0),
    )
    plant = CanBench(params, lambda: logic)
    return BenchTask(params, plant.make_bench, plant)


def frame(can_id: int, data: bytes = b"", **flags: bool) -> CanMessage:
    return CanMessage(
        seq=0,
        t_ns=0,
        can_id=can_id,
        is_extended=flags.get("is_extended", False),
        is_remote=flags.get("is_remote", False),
        length=len(data),
        data=data,
    )


def frames(sends: list[Send]) -> list[tuple[int, int, bytes]]:
    """Stamp, identifier and data of the frames among what is sent."""
    found = []
    for send in sends:
        if isinstance(send.message, CanMessage):
            assert send.channel == "can_up"
            found.append((send.message.t_ns, send.message.can_id, send.message.data))
    return found


def truths(sends: list[Send]) -> list[Truth]:
    return [send.message for send in sends if isinstance(send.message, Truth)]


def run(task: BenchTask, end_ns: int, every_ns: int = 5 * MS) -> list[Send]:
    """Start at 0 and tick at a fixed period."""
    sends = list(task.start(0).sends)
    for t_ns in range(every_ns, end_ns + 1, every_ns):
        sends += task.on_tick(t_ns).sends
    return sends


def test_the_node_boots_at_the_start_and_its_frames_leave_with_their_stamps() -> None:
    sends = run(bench(NotingLogic()), 60 * MS)
    assert frames(sends) == [
        (0, 0x701, b"\0"),
        *[(t_ns, 0x701, b"\x05") for t_ns in range(0, 61 * MS, 20 * MS)],
    ]
    numbers = [s.message.seq for s in sends if isinstance(s.message, CanMessage)]
    assert numbers == list(range(len(numbers)))


@given(wakes=st.lists(st.integers(1, 30 * MS), max_size=8))
@UNTIMED
def test_the_drive_is_sampled_on_every_millisecond_however_the_task_is_woken(
    wakes: list[int],
) -> None:
    logic = NotingLogic(0.2)
    task = bench(logic)
    task.start(0)
    for t_ns in sorted([*wakes, 30 * MS]):
        task.on_tick(t_ns)
    assert [t_ns for t_ns, _ in logic.samples] == list(range(0, 31 * MS, MS))


@given(arrivals=st.lists(st.integers(1, 40 * MS), min_size=1, max_size=8, unique=True))
@UNTIMED
def test_a_frame_reaches_the_node_at_its_arrival_after_the_samples_before_it(
    arrivals: list[int],
) -> None:
    logic = NotingLogic()
    task = bench(logic)
    task.start(0)
    for number, t_ns in enumerate(sorted(arrivals)):
        answers = task.on_message("can_down", frame(0x601, bytes([number])), t_ns).sends
        assert frames(list(answers))[-1] == (t_ns, 0x581, bytes([number]))
        assert logic.frames[-1] == (t_ns, 0x601, bytes([number]), False)
        assert logic.samples[-1][0] == t_ns - t_ns % MS


def test_an_extended_frame_and_a_setpoint_do_not_reach_the_node() -> None:
    logic = NotingLogic()
    task = bench(logic)
    task.start(0)
    task.on_message("can_down", frame(0x601, b"\1", is_extended=True), MS)
    task.on_message("setpoint", axis_setpoint(0, MS, (0.1, 0.0, 0.0)), 2 * MS)
    assert logic.frames == []
    task.on_message("can_down", frame(0x181, is_remote=True), 3 * MS)
    assert logic.frames == [(3 * MS, 0x181, b"", True)]


def test_an_order_is_answered_with_the_late_ticks() -> None:
    task = bench(NotingLogic())
    task.start(0)
    order = Command(seq=0, t_ns=0, id=4, to="bench", verb=Verb.STATUS)
    (send,) = task.on_message("command", order, MS).sends
    assert isinstance(send.message, Reply)
    assert (send.message.id, send.message.ok, send.message.text) == (4, True, "0 late ticks")


def test_a_held_torque_accelerates_the_mass_of_screw_and_table() -> None:
    torque_n_m = 0.3
    load = PendulumParams(mass_kg=1e-9)
    sends = run(bench(NotingLogic(torque_n_m), FREE, load), 200 * MS)
    tau = 0.02 / (2 * math.pi)
    mass_kg = FREE.rotary_inertia_kg_m2 / tau**2 + FREE.table_mass_kg + FREE.screw_axial_mass_kg
    acceleration = torque_n_m / tau / mass_kg
    last = truths(sends)[-1]
    t_s = last.t_ns * 1e-9
    assert last.position_m[0] == pytest.approx(acceleration * t_s**2 / 2, rel=1e-3)
    assert last.velocity_m_s[0] == pytest.approx(acceleration * t_s, rel=3e-3)
    assert last.position_m[1:] == last.velocity_m_s[1:] == (0.0, 0.0)


def test_the_load_pulls_the_table_and_the_momentum_of_both_is_kept() -> None:
    heavy = PendulumParams(length_m=1.0, mass_kg=20.0, initial_swing_rad=0.2, damping_ratio=0.0)
    free = bench(NotingLogic(), FREE, heavy)
    found = truths(run(free, 800 * MS))
    tau = 0.02 / (2 * math.pi)
    carriage_kg = FREE.rotary_inertia_kg_m2 / tau**2 + FREE.table_mass_kg + FREE.screw_axial_mass_kg
    momentum = []
    for truth in found:
        link, v_m_s = truth.links[0], truth.velocity_m_s[0]
        load_m_s = v_m_s + link.rate_x_rad_s * math.cos(link.angle_x_rad)
        momentum.append(carriage_kg * v_m_s + 20.0 * load_m_s)
    scale = 20.0 * 0.2 * math.sqrt(9.81)  # of the load
    assert np.abs(momentum).max() < 0.02 * scale  # the pull lags by a sample
    moved = [truth.position_m[0] for truth in found]
    assert max(moved) > 0.01


def test_the_start_position_is_that_of_the_axis_and_its_sensors() -> None:
    axis = BallScrewParams(start_m=0.12)
    logic = NotingLogic()
    sends = run(bench(logic, axis), 20 * MS)
    assert truths(sends)[0].position_m[0] == pytest.approx(0.12)
    angle_rad = logic.samples[0][1].motor_angle_rad
    assert angle_rad == pytest.approx(0.12 / 0.02 * 2 * math.pi, abs=2 * math.pi / 10_000)


def test_an_end_switch_is_closed_in_the_sample_after_the_table_reached_it() -> None:
    logic = NotingLogic(1.0)
    axis = BallScrewParams(start_m=0.3, positive_switch_m=0.31)
    sends = run(bench(logic, axis), 300 * MS)
    first = next(t_ns for t_ns, reading in logic.samples if reading.positive_switch)
    before = [t for t in truths(sends) if t.t_ns < first]
    after = [t for t in truths(sends) if t.t_ns >= first]
    assert all(t.position_m[0] < 0.31 for t in before)
    assert all(t.position_m[0] >= 0.31 for t in after if t.t_ns < first + 20 * MS)


def test_two_benches_with_equal_calls_give_equal_floats() -> None:
    runs = [truths(run(bench(NotingLogic(0.2)), 100 * MS)) for _ in range(2)]
    assert runs[0] == runs[1]
