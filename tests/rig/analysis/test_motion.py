"""Peaks asked of the robot and reached by it, beside their bounds."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from comms.errors import LogError
from comms.messages import (
    Command,
    JointState,
    Setpoint,
    Space,
    Verb,
    axis_setpoint,
    axis_state,
)
from rig.analysis.analyze import RunAnalysis
from rig.analysis.motion import motion_peaks
from rig.analysis.run_log import RunLog
from rig.analysis.summary import MotionPeaks
from rig.run.config import read_experiment
from rig.run.job import Job, plan_move, prepare
from rig.run.recorder import Recorder
from rig.run.runtime import bench

MS = 1_000_000
TICK_NS = 5 * MS
START = {"run_id": "r", "mode": "virtual", "experiment": "move", "kind": "move"}


def windows(*speeds_m_s: float) -> list[tuple[float, float]]:
    """Place [m] and speed [m/s] at each tick of 30 ms windows."""
    x, rows = 0.0, [(0.0, 0.0)] * 10
    for speed in speeds_m_s:
        for _ in range(6):
            x += speed * 0.005
            rows.append((x, speed))
    return rows


def job(*changes: str) -> Job:
    """Job of the shipped move."""
    chosen = read_experiment("move", list(changes))
    return prepare(chosen, plan_move(chosen), bench.plant(chosen))


def peaks(
    folder: Path,
    rows: list[tuple[float, float]],
    *,
    with_bounds: bool = True,
    stop_tick: int | None = None,
    pause_tick: int | None = None,
) -> MotionPeaks:
    """Peaks of a log with these setpoints; the encoders read each one 25 ms later."""
    attachments = job("controller.policy=source").attachments()
    if not with_bounds:
        del attachments["controller.json"]
    recorder = Recorder(folder / "run.mcap", START, attachments, 0)
    for tick, (x_m, speed) in enumerate(rows):
        t_ns = tick * TICK_NS
        if pause_tick is not None and tick >= pause_tick:
            t_ns += 200 * MS
        place = (0.0, x_m, 0.0)
        recorder.message("setpoint", axis_setpoint(tick, t_ns, place), t_ns)
        t_ns += 25 * MS
        velocity = (0.0, 0.0, speed)
        recorder.message("joint_state", axis_state(tick, t_ns, place, velocity), t_ns)
        if tick == stop_tick:
            stop = Command(seq=1, t_ns=t_ns, id=1, to="controller", verb=Verb.STOP)
            recorder.message("command", stop, t_ns)
    recorder.close({}, {"exit_status": "ok", "exit_code": "0"}, 10)
    return motion_peaks(RunLog.open(folder / "run.mcap"))


def test_speed_is_over_5_ms_and_acceleration_over_30_ms(tmp_path: Path) -> None:
    found = peaks(tmp_path, windows(0.1, 0.2, 0.32, 0.3))
    assert found.asked_speed_m_s == pytest.approx(0.32)
    assert found.asked_acceleration_m_s2 == pytest.approx(0.12 / 0.03)
    assert found.reached_speed_m_s == pytest.approx(0.32)
    assert found.reached_acceleration_m_s2 == pytest.approx(0.12 / 0.03)
    assert found.setpoints_outside == 0


def test_the_bounds_are_those_of_the_controller(tmp_path: Path) -> None:
    found = peaks(tmp_path, windows(0.1))
    assert found.policy == "source"
    assert (found.speed_bound_m_s, found.acceleration_bound_m_s2) == pytest.approx((1.1, 5.5))
    assert found.following_error_bound_m == pytest.approx(0.02)


def test_the_following_error_is_against_the_setpoint_of_the_servo_lag_before(
    tmp_path: Path,
) -> None:
    """The robot lags 25 ms, of which 20 ms are expected: one tick at 0.4 m/s is left."""
    found = peaks(tmp_path, windows(0.1, 0.2, 0.3, 0.4, 0.4))
    assert found.following_error_m == pytest.approx(0.4 * 0.005)


def test_setpoints_outside_are_counted_and_make_a_run_doubtful(tmp_path: Path) -> None:
    found = peaks(tmp_path, windows(0.1, 0.3, 0.3))
    assert found.setpoints_outside == 6
    summary = RunAnalysis(tmp_path / "run.mcap").summary
    (reason,) = [r for r in summary.reasons if "envelope" in r]
    assert reason == (
        "6 setpoints left the [safety] envelope (policy source): "
        "asked 0.30 of 1.10 m/s, 6.67 of 5.50 m/s2"
    )


def test_what_is_sent_after_a_stop_is_not_asked(tmp_path: Path) -> None:
    """The setpoint freezes: 0.4 m/s to rest at once, which an emergency stop may."""
    moving = windows(0.1, 0.2, 0.3, 0.4)
    held = [(moving[-1][0], 0.0)] * 10
    stopped = peaks(tmp_path, [*moving, *held], stop_tick=len(moving) - 6)
    assert stopped.asked_acceleration_m_s2 == pytest.approx(0.1 / 0.03)


def test_after_a_pause_of_the_controller_the_robot_is_at_rest(tmp_path: Path) -> None:
    rows = windows(0.15, 0.3, 0.3)
    found = peaks(tmp_path, rows, pause_tick=len(rows) - 6)
    assert found.asked_acceleration_m_s2 == pytest.approx(0.3 / 0.03)


def test_a_log_without_bounds_has_peaks_alone(tmp_path: Path) -> None:
    found = peaks(tmp_path, windows(0.1, 0.9), with_bounds=False)
    assert found.asked_acceleration_m_s2 == pytest.approx(0.8 / 0.03)
    assert (found.policy, found.speed_bound_m_s, found.following_error_bound_m) == (None,) * 3
    assert found.setpoints_outside == 0
    assert found.text == (
        "asked 0.90 m/s, 26.67 m/s2; reached 0.90 m/s, 26.67 m/s2; following error 4.50 mm"
    )


def test_joints_that_are_no_axes_in_metres_have_no_peaks(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.mcap", START, job().attachments(), 0)
    values = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    joints = {"space": Space.RADIANS, "count": 6, "values": values}
    for tick in range(20):
        t_ns = tick * TICK_NS
        recorder.message("setpoint", Setpoint(seq=tick, t_ns=t_ns, **joints), t_ns)
        reading = JointState(seq=tick, t_ns=t_ns, rates=values, **joints)
        recorder.message("joint_state", reading, t_ns)
    recorder.close({}, {"exit_status": "ok", "exit_code": "0"}, 10)
    found = motion_peaks(RunLog.open(tmp_path / "run.mcap"))
    assert (found.asked_speed_m_s, found.asked_acceleration_m_s2) == (None, None)
    assert (found.reached_speed_m_s, found.reached_acceleration_m_s2) == (None, None)
    assert (found.following_error_m, found.setpoints_outside) == (None, 0)


def test_the_text_sets_every_peak_beside_its_bound(tmp_path: Path) -> None:
    found = peaks(tmp_path, windows(0.1, 0.2))
    assert found.text == (
        "asked 0.20 of 1.10 m/s, 3.33 of 5.50 m/s2; "
        "reached 0.20 of 1.10 m/s, 3.33 of 5.50 m/s2; following error 1.00 of 20.00 mm"
    )


def test_damaged_settings_of_the_controller_are_named(tmp_path: Path) -> None:
    attachments = job().attachments() | {"controller.json": b'{"servo_lag_ns": "long"}'}
    recorder = Recorder(tmp_path / "run.mcap", START, attachments, 0)
    recorder.close({}, {"exit_status": "ok", "exit_code": "0"}, 10)
    with pytest.raises(LogError, match="an attachment cannot be read"):
        RunLog.open(tmp_path / "run.mcap")


def test_the_peaks_are_in_the_json_document() -> None:
    assert set(msgspec.to_builtins(MotionPeaks())) == {
        "policy",
        "asked_speed_m_s",
        "reached_speed_m_s",
        "speed_bound_m_s",
        "asked_acceleration_m_s2",
        "reached_acceleration_m_s2",
        "acceleration_bound_m_s2",
        "following_error_m",
        "following_error_bound_m",
        "setpoints_outside",
        "tracking_delay_rms_m",
        "tracking_distortion_rms_m",
    }
