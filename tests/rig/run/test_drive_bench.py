"""Runs in virtual time with a drive on the field bus: load, controllers, losses, faults."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from comms.messages import CanMessage, Truth
from rig.analysis.run_log import FloatArray, RunLog
from rig.run import config, experiment
from rig.run.experiment import FinishedRun
from rig.run.runs import LOG

MS = 1_000_000
AXIS = [
    "bench.robot.kind=ball_screw",
    "bench.pendulum.length_m=1",
    "camera.rate_hz=0",
    "experiment.quiet_s=0.1",
]
MOVE = [*AXIS, "move.distance_m=0.2", "move.time_s=1.5", "experiment.watch_s=0.6"]
BRIEF = [*AXIS, "move.distance_m=0.05", "move.time_s=1.0", "experiment.watch_s=0.2"]
INCREMENT_M = 0.02 / 10_000


def quietly(*_: object) -> None:
    return None


def run(folder: Path, changes: list[str]) -> tuple[FinishedRun, RunLog]:
    ran = experiment.run(
        config.read_experiment("move", changes), "virtual", folder, quietly, quietly
    )
    log = RunLog.open(ran.folder / LOG)
    for name, row in log.links().items():
        assert row.count.unaccounted == 0, name
    return ran, log


def process_data(log: RunLog) -> tuple[dict[int, tuple[int, int]], dict[int, int]]:
    """Control word and target, and position, by the instant of their SYNC."""
    down = log.log.read("/can_down", CanMessage)
    up = log.log.read("/can_up", CanMessage)
    sent = {m.t_ns: struct.unpack("<Hi", m.data) for m in down if m.can_id == 0x201}
    read = {m.t_ns: struct.unpack("<ii", m.data)[0] for m in up if m.can_id == 0x181}
    return sent, read


def following_error_m(log: RunLog, sync_ns: int = 5 * MS) -> FloatArray:
    """Encoder less the target of one SYNC before, which the drive interpolates to [m]."""
    sent, read = process_data(log)
    errors = []
    for t_ns, position in read.items():
        word, target = sent.get(t_ns - sync_ns, (0, 0))
        if word == 0x0F:
            errors.append((position - target) * INCREMENT_M)
    return np.array(errors)


def speeds(log: RunLog) -> FloatArray:
    """Instant [s], x [m] and speed along x [m/s] of the platform (N, 3)."""
    truth = log.log.read("/truth", Truth)
    return np.array([(t.t_ns * 1e-9, t.position_m[0], t.velocity_m_s[0]) for t in truth])


@pytest.mark.parametrize("controller", ["cascade", "lqg"])
def test_a_move_follows_rests_and_leaves_the_swing_of_its_plan(
    tmp_path: Path, controller: str
) -> None:
    ran, log = run(tmp_path, [*MOVE, f"drive.controller={controller}"])
    assert (ran.outcome.exit_code, ran.outcome.reasons) == (0, [])
    errors = following_error_m(log)
    assert errors.size > 400
    assert np.abs(errors).max() < 1e-3
    motion = speeds(log)
    last = motion[motion[:, 0] > motion[-1, 0] - 0.1]
    assert np.abs(last[:, 1] - 0.2).max() < 5e-6
    assert np.ptp(last[:, 1]) < 1e-6
    # the amplitude of the swing by its energy, from a plant at rest
    t_s, angle, rate, _ = log.truth[log.truth[:, 0] > log.t_settled_s].T
    assert t_s.size > 20
    residual_rad = np.hypot(angle, rate / np.sqrt(9.81))
    assert log.plan.metrics is not None
    planned_rad = log.plan.metrics["residual_swing_nonlinear_rad"]
    assert np.abs(residual_rad - planned_rad).max() < 1e-4


def test_equal_seeds_give_equal_digests_and_others_do_not(tmp_path: Path) -> None:
    lossy = [*BRIEF, "links.can_up.jitter_ms=0.4"]
    one, other = (run(tmp_path, lossy)[0].outcome.digest for _ in range(2))
    assert one == other
    assert run(tmp_path, [*lossy, "experiment.seed=2"])[0].outcome.digest != one


def test_a_sync_of_1_ms_follows_more_closely(tmp_path: Path) -> None:
    ran, log = run(tmp_path, [*BRIEF, "drive.sync_ms=1"])
    assert (ran.outcome.exit_code, ran.outcome.reasons) == (0, [])
    sent, read = process_data(log)
    gaps = np.diff(np.array(sorted(sent)))
    assert set(gaps) == {MS}
    assert len(read) > len(sent) - 5
    assert np.abs(following_error_m(log, MS)).max() < 1e-3
    assert speeds(log)[-1, 1] == pytest.approx(0.05, abs=5e-6)


LOSSES = [
    ["links.can_down.loss=0.05"],
    ["links.can_up.loss=0.05"],
    ["links.can_down.loss=0.01", "links.can_up.loss=0.01"],
]


@pytest.mark.parametrize("losses", LOSSES)
def test_a_run_with_lost_frames_ends_in_a_stated_outcome(tmp_path: Path, losses: list[str]) -> None:
    for seed in range(1, 4):
        ran, log = run(tmp_path, [*BRIEF, *losses, f"experiment.seed={seed}"])
        assert ran.outcome.exit_code in (0, 3, 5)
        assert bool(ran.outcome.reasons) == (ran.outcome.exit_code != 0)
        rows = log.links()
        lost = sum(rows[name].count.lost_link for name in ("can_down", "can_up"))
        assert lost > 0
        assert np.abs(speeds(log)[-1, 2]) < 1e-3  # at rest, whatever the outcome


def test_a_following_error_of_the_drive_in_motion_ends_the_run_at_rest(tmp_path: Path) -> None:
    ran, log = run(tmp_path, [*MOVE, "drive.following_error_mm=0.2"])
    assert ran.outcome.exit_code == 5
    assert "emergency of node 1: error 0x8611" in ran.outcome.reasons[0]
    motion = speeds(log)
    assert np.abs(motion[:, 2]).max() > 0.02
    assert abs(motion[-1, 2]) < 1e-4
    frames = [m for m in log.log.read("/can_up", CanMessage) if m.can_id == 0x081]
    assert [m.data[:2] for m in frames] == [bytes.fromhex("1186")]
