"""Master and simulated axis in one loop: what the drive does when the master or a bound is gone."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from comms.messages import CanMessage, Command, JointState, Reply, Truth, Verb, axis_setpoint
from comms.task import Step
from rig.run.drive_section import AxisDriveSection
from rig.run.drive_settings import drive_settings
from rig.run.node_settings import NodeSettings
from rig.run.runtime import drive_node
from rig.run.runtime.drive_controllers import axis_model, lq_feedback
from rig.run.tasks.drive.task import DriveTask
from rig.run.tasks.safety import Envelope

MS = 1_000_000
SYNC_S = 0.005
QUICK_STOP_M_S2 = 20.0
SETTLING_S = 0.1  # of the controllers, after the ramp
ENVELOPE = Envelope(
    position_min_m=-0.25,
    position_max_m=0.25,
    depth_m=0.1,
    height_m=0.1,
    speed_m_s=1.1,
    acceleration_m_s2=5.5,
)


class Loop:
    """Master and bench; a frame arrives in the instant in which it is sent."""

    def __init__(self, drive: AxisDriveSection, start_m: float = 0.0) -> None:
        plant = {
            "axis": {"start_m": start_m},
            "robot": {"start_m": start_m},
            "pendulum": {"length_m": 1.0},
            "view": {"rate_hz": 0.0},
        }
        self.bench = drive_node.task(NodeSettings(drive=drive, plant=plant))
        self.master = DriveTask(drive_settings(drive, ENVELOPE))
        self.t_ns = 0
        self.is_master_alive = True
        self.replies: list[Reply] = []
        self.states: list[JointState] = []
        self.truth: list[Truth] = []
        self.take(self.bench.start(0))
        self.take(self.master.start(0))

    def take(self, step: Step) -> None:
        for send in step.sends:
            message = send.message
            if send.channel == "can_up" and self.is_master_alive:
                self.take(self.master.on_message("can_up", message, self.t_ns))
            elif send.channel == "can_down":
                self.take(self.bench.on_message("can_down", message, self.t_ns))
            elif isinstance(message, Reply):
                self.replies.append(message)
            elif isinstance(message, JointState):
                self.states.append(message)
            elif isinstance(message, Truth):
                self.truth.append(message)

    def tick(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.t_ns += 5 * MS
            self.take(self.bench.on_tick(self.t_ns))
            if self.is_master_alive:
                self.take(self.master.on_tick(self.t_ns))

    def order(self, verb: Verb) -> None:
        order = Command(seq=0, t_ns=self.t_ns, id=1, to="drive", verb=verb)
        self.take(self.master.on_message("command", order, self.t_ns))

    def until_running(self) -> Loop:
        for _ in range(100):
            self.tick()
            self.order(Verb.STATUS)
            if self.replies[-1].ok:
                break
        self.order(Verb.ARM)
        self.tick(8)
        assert self.replies[-1].ok, self.replies[-1].text
        self.order(Verb.START)
        return self

    def follow(self, x_m: Callable[[float], float], duration_s: float) -> None:
        """Give setpoints, x of the time from now on."""
        for k in range(1, round(duration_s / SYNC_S) + 1):
            setpoint = axis_setpoint(k, self.t_ns, (x_m(k * SYNC_S), 0.0, 0.0))
            self.take(self.master.on_message("setpoint", setpoint, self.t_ns))
            self.tick()

    def motion(self) -> Iterator[tuple[float, float, float]]:
        """Instant [s], x [m], speed [m/s]."""
        for truth in self.truth:
            yield truth.t_ns * 1e-9, truth.position_m[0], truth.velocity_m_s[0]


def smooth(t_s: float, distance_m: float, time_s: float) -> float:
    """Rest to rest, by a polynomial of fifth degree."""
    s = min(t_s / time_s, 1.0)
    return distance_m * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


@pytest.mark.parametrize("controller", ["cascade", "lqg"])
def test_an_axis_whose_master_fell_silent_brakes_by_itself(controller: str) -> None:
    loop = Loop(AxisDriveSection(controller=controller)).until_running()
    loop.follow(lambda t_s: smooth(t_s, 0.2, 1.0), 0.5)
    lost_s, x_m, speed_m_s = list(loop.motion())[-1]
    assert speed_m_s > 0.3
    loop.is_master_alive = False
    loop.tick(60)
    after = np.array([row for row in loop.motion() if row[0] > lost_s])
    heartbeats_s = 0.040 + 2 * SYNC_S  # two of the master's, and the grid
    braking_s = speed_m_s / QUICK_STOP_M_S2
    at_rest = after[:, 0] > lost_s + heartbeats_s + braking_s + SETTLING_S
    assert np.abs(after[at_rest, 2]).max() < 1e-4
    # it stands at the last target until then, or one SYNC beyond
    longest_m = speed_m_s * (heartbeats_s + 2 * SYNC_S) + speed_m_s**2 / (2 * QUICK_STOP_M_S2)
    assert after[-1, 1] - x_m < longest_m
    assert np.abs(after[:, 1]).max() < 0.25


@pytest.mark.parametrize("controller", ["cascade", "lqg"])
@pytest.mark.parametrize("verb", [Verb.ESTOP, None])
def test_a_quick_stop_in_motion_takes_the_ramp_of_20_m_s2(
    controller: str, verb: Verb | None
) -> None:
    loop = Loop(AxisDriveSection(controller=controller)).until_running()
    loop.follow(lambda t_s: smooth(t_s, 0.2, 1.0), 0.5)
    stopped_s, x_m, speed_m_s = list(loop.motion())[-1]
    if verb:
        loop.order(verb)
    else:  # the end of the task: nothing follows its last SYNC
        loop.take(loop.master.stop(loop.t_ns))
        loop.is_master_alive = False
    loop.tick(40)
    after = np.array([row for row in loop.motion() if row[0] > stopped_s])
    ramp_m = speed_m_s**2 / (2 * QUICK_STOP_M_S2)
    assert after[-1, 1] - x_m == pytest.approx(ramp_m, abs=speed_m_s * 3 * SYNC_S)
    assert np.abs(after[after[:, 0] > stopped_s + 0.03 + SETTLING_S, 2]).max() < 1e-4


def test_a_setpoint_beyond_the_bounds_of_607d_is_limited_by_the_drive() -> None:
    loop = Loop(AxisDriveSection()).until_running()
    loop.follow(lambda t_s: smooth(t_s, 0.3, 1.5), 2.0)
    motion = np.array(list(loop.motion()))
    assert motion[-1, 1] == pytest.approx(0.25, abs=1e-5)
    assert motion[:, 1].max() < 0.25 + 5e-3  # it meets the bound in motion
    assert all(reply.ok for reply in loop.replies[-1:])
    assert loop.states[-1].position_m is not None
    assert loop.states[-1].position_m[0] == pytest.approx(0.25, abs=1e-5)


def test_an_axis_that_starts_off_the_middle_is_enabled_where_it_stands() -> None:
    loop = Loop(AxisDriveSection(), start_m=0.1).until_running()
    loop.tick(10)
    motion = np.array(list(loop.motion()))
    assert np.abs(motion[:, 1] - 0.1).max() < 5e-6
    assert loop.states[-1].position_m == pytest.approx((0.1, 0.0, 0.0), abs=2e-6)


def test_a_restart_of_the_node_in_motion_is_a_fault_that_ends_at_rest() -> None:
    loop = Loop(AxisDriveSection()).until_running()
    loop.follow(lambda t_s: smooth(t_s, 0.2, 1.0), 0.5)
    reset = CanMessage(
        seq=0, t_ns=0, can_id=0, is_extended=False, is_remote=False, length=2, data=b"\x81\x01"
    )
    loop.take(loop.bench.on_message("can_down", reset, loop.t_ns))
    given = [reply for reply in loop.replies if reply.exit is not None]
    assert [(reply.exit, reply.text) for reply in given] == [(5, "node 1 has restarted")]
    loop.tick(100)
    motion = np.array(list(loop.motion()))
    assert abs(motion[-1, 2]) < 1e-4  # by its friction: a node that restarts has no power stage
    assert np.abs(motion[:, 1]).max() < 0.25


@pytest.mark.parametrize("counts", [1_000, 10_000, 100_000])
@pytest.mark.parametrize("mass_kg", [2.0, 10.65, 60.0])
def test_the_slow_poles_of_lqg_are_those_of_butterworth_on_any_axis(
    counts: int, mass_kg: float
) -> None:
    drive = AxisDriveSection(moving_mass_kg=mass_kg, encoder_counts_per_rev=counts)
    poles = lq_feedback(drive).poles_1_s(axis_model(drive))
    slow = poles[np.abs(poles) < 400.0]
    radius = np.sqrt(drive.speed_loop_rad_s * drive.position_loop_rad_s)
    butterworth = radius * np.exp(1j * np.pi * np.array([2 / 3, 1.0, 4 / 3]))
    assert np.sort_complex(slow) == pytest.approx(np.sort_complex(butterworth), rel=0.02)
    assert poles.real.max() < -0.4 * radius
