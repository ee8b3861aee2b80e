"""Runs of the Quattro in virtual time: joints on the wire, positions on both sides of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from comms.messages import (
    JointState,
    Phase,
    Reply,
    Setpoint,
    Space,
    Truth,
    axis_setpoint,
    axis_state,
    joint_setpoint,
    joint_state,
)
from comms.replies import Replies
from planners.errors import PlanError
from rig.analysis.analyze import RunAnalysis
from rig.errors import ConfigError, Refused
from rig.run import config, experiment
from rig.run.job import plan_move, prepare
from rig.run.runs import LOG
from rig.run.runtime import bench
from rig.run.tasks.controller.joints import QuattroJoints, RobotSettings, robot_joints
from sim_rig.bench import Bench
from sim_rig.input_check import InputBounds
from sim_rig.params import BenchParams
from sim_rig.quattro_params import QuattroParams
from sim_rig.quattro_port import QuattroPort

QUATTRO = ["bench.robot.kind=quattro", "bench.pendulum.length_m=1"]
BRIEF = [*QUATTRO, "camera.rate_hz=0", "experiment.quiet_s=0.2", "experiment.watch_s=1.0"]
WIDE = [
    "safety.position_min_m=-2",
    "safety.position_max_m=2",
    "limits.acceleration_m_s2=90",
    "limits.speed_m_s=9",
]


def run(folder: Path, name: str, changes: list[str]) -> tuple[experiment.FinishedRun, RunAnalysis]:
    chosen = config.read_experiment(name, changes)
    ran = experiment.run(chosen, "virtual", folder, _quiet, _quiet)
    return ran, RunAnalysis(ran.folder / LOG)


def _quiet(*_: object) -> None:
    return None


def test_a_move_leaves_what_it_does_on_axes_of_the_same_rise_time(tmp_path: Path) -> None:
    _, joints = run(tmp_path / "quattro", "move", BRIEF)
    axes = [*BRIEF, "bench.robot.kind=cartesian"]
    _, cartesian = run(tmp_path / "cartesian", "move", axes)
    for analysis in (joints, cartesian):
        assert analysis.summary.verdict == "good", analysis.summary.reasons
    ours, theirs = joints.summary.truth, cartesian.summary.truth
    assert ours is not None
    assert theirs is not None
    assert ours.residual_swing_rad == pytest.approx(theirs.residual_swing_rad, abs=0.05e-3)
    assert ours.peak_swing_rad == pytest.approx(theirs.peak_swing_rad, abs=0.1e-3)
    assert joints.summary.latency_ms.command == pytest.approx(57.9, abs=1.0)
    assert joints.summary.motion.asked_speed_m_s == pytest.approx(
        cartesian.summary.motion.asked_speed_m_s, rel=1e-6
    )
    assert joints.summary.motion.following_error_m is not None
    assert joints.summary.motion.following_error_m < 1e-3


def test_setpoints_and_encoders_travel_in_radians(tmp_path: Path) -> None:
    _, analysis = run(tmp_path, "move", BRIEF)
    setpoints = analysis.run.log.read("/setpoint", Setpoint)
    states = analysis.run.log.read("/joint_state", JointState)
    assert {(s.space, s.count) for s in setpoints} == {(Space.RADIANS, 4)}
    assert {(s.space, s.count) for s in states} == {(Space.RADIANS, 4)}
    assert setpoints[-1].values[:4] == pytest.approx(
        [math.radians(one) for one in (-4.7121338, -4.7121338, 18.584574, 18.584574)], abs=1e-8
    ), "joints at (0.2, 0, -0.9) m, computed for this geometry"


def test_equal_seeds_give_equal_digests(tmp_path: Path) -> None:
    digests = {run(tmp_path / str(k), "move", BRIEF)[0].outcome.digest for k in range(2)}
    assert len(digests) == 1


def test_a_move_along_y_and_one_along_z_arrive(tmp_path: Path) -> None:
    _, across = run(tmp_path / "y", "move", [*BRIEF, "move.axis=y"])
    last = across.run.log.read("/truth", Truth)[-1]
    assert last.position_m == pytest.approx((0.0, 0.2, 0.0), abs=1e-4)
    assert across.summary.verdict == "good", across.summary.reasons
    up = ["move.axis=z", "move.distance_m=0.05", "experiment.planner=law"]
    _, vertical = run(tmp_path / "z", "move", [*BRIEF, *up])
    last = vertical.run.log.read("/truth", Truth)[-1]
    assert last.position_m == pytest.approx((0.0, 0.0, 0.05), abs=1e-4)
    assert last.links[0].angle_x_rad == pytest.approx(0.0, abs=1e-4)


def test_an_arm_1_mm_too_long_moves_the_platform_and_the_controller_does_not_know(
    tmp_path: Path,
) -> None:
    changes = [*BRIEF, "bench.robot.arm_error_m=[0.001, 0, 0, 0]"]
    _, analysis = run(tmp_path, "move", changes)
    truth = np.array([t.position_m for t in analysis.run.log.read("/truth", Truth)])
    believed = analysis.run.robot[-1, 3]
    assert believed == pytest.approx(0.2, abs=1e-4)
    assert 0.1e-3 < abs(truth[-1] - (0.2, 0.0, 0.0)).max() < 3e-3


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (["move.distance_m=1.2"], r"cannot follow the plan at \(.* s into the move"),
        (["robot.joint_speed_rad_s=0.1"], r"a joint turns at .* must be <= 0.1 rad/s"),
        (["robot.home_z_m=-3"], r"home_z_m = -3"),
        (["bench.robot.arm_m=-1"], r"arm_m"),
        (["bench.robot.speed_gain_n_m_s_rad=9000"], r"speed_gain_n_m_s_rad"),
    ],
)
def test_what_the_robot_cannot_do_is_refused_with_place_and_instant(
    tmp_path: Path, changes: list[str], text: str
) -> None:
    with pytest.raises((ConfigError, Refused), match=text):
        run(tmp_path, "move", [*BRIEF, *WIDE, *changes])
    assert not list(tmp_path.iterdir())


def test_a_controller_of_axes_does_not_move_a_quattro(tmp_path: Path) -> None:
    ran, analysis = run(tmp_path, "move", [*BRIEF, "robot.kinematics=axes"])
    assert ran.outcome.exit_code == 5
    assert "joint states of 4 joints in rad; must be x, y, z in m" in ran.outcome.reasons[0]
    assert not analysis.run.log.read("/setpoint", Setpoint)


def quattro_port() -> tuple[QuattroPort, Bench]:
    """Port of a robot that stops by itself beyond 1 m/s."""
    bounds = InputBounds(
        lower_m=(-0.3, -0.3, -0.1),
        upper_m=(0.3, 0.3, 0.1),
        speed_m_s=1.0,
        acceleration_m_s2=50.0,
    )
    quattro = QuattroParams()
    params = BenchParams(quattro=quattro, input=bounds)
    port = QuattroPort(params, quattro, Replies("bench"))
    return port, port.make_bench(0)


def test_the_robot_takes_the_position_from_the_joints_and_stops_by_itself_beyond_its_bounds() -> (
    None
):
    joints = QuattroJoints(-0.90)
    port, plant = quattro_port()
    assert port.take(joints.setpoint(0, 0, (0.004, 0.0, 0.0)), 0, plant) == []
    (report,) = port.take(joints.setpoint(1, 5_000_000, (0.1, 0.0, 0.0)), 5_000_000, plant)
    assert isinstance(report.message, Reply)
    assert "setpoint outside the envelope: speed 19.2" in report.message.text
    assert port.phase is Phase.FAULT


def test_a_setpoint_in_metres_stops_the_robot() -> None:
    port, plant = quattro_port()
    (report,) = port.take(axis_setpoint(0, 0, (0.0, 0.0, 0.0)), 0, plant)
    assert isinstance(report.message, Reply)
    assert "setpoint of 3 joints in m; must be 4 joints in rad" in report.message.text


def test_joints_that_do_not_close_are_named_and_stop_the_robot() -> None:
    port, plant = quattro_port()
    (report,) = port.take(joint_setpoint(0, 0, (1.5, -0.9, 1.5, -0.9)), 0, plant)
    assert isinstance(report.message, Reply)
    assert report.message.text.startswith("setpoint out of reach: ")


def test_the_controller_finds_back_the_position_of_its_own_setpoint() -> None:
    joints = QuattroJoints(-0.90)
    for k, place in enumerate([(0.0, 0.0, 0.0), (0.2, -0.1, 0.05), (-0.3, 0.3, -0.2)]):
        values = joints.setpoint(k, 0, place).values[:4]
        found = joints.platform(joint_state(k, 5, values, (0.0, 0.0, 0.0, 0.0)))
        assert found is not None
        assert found.position_m == pytest.approx(place, abs=1e-12)
        assert found.velocity_m_s == (0.0, 0.0, 0.0)


def test_joints_of_another_robot_are_no_platform() -> None:
    joints = QuattroJoints(-0.90)
    assert joints.platform(axis_state(0, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))) is None
    assert robot_joints(RobotSettings()).platform(joint_state(0, 0, [0.1] * 4, [0.0] * 4)) is None
    with pytest.raises(PlanError):
        joints.setpoint(0, 0, (5.0, 0.0, 0.0))


@pytest.mark.parametrize("key", ["row_us=20", "jitter_us=500"])
def test_exposures_between_the_milliseconds_of_the_servos_are_taken(key: str) -> None:
    chosen = config.read_experiment(
        "move", [f"bench.camera.{key}", "experiment.quiet_s=0.3", "experiment.watch_s=1"]
    )
    task = bench.task(prepare(chosen, plan_move(chosen), bench.plant(chosen)).settings["bench"])
    sends = list(task.start(0).sends)
    for t_ms in range(5, 500, 5):
        sends += task.on_tick(t_ms * 1_000_000).sends
    assert sum(send.channel == "frame_1" for send in sends) >= 22
