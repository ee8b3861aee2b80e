"""Faults of a drive in motion, as keys of the experiment file: what the run says and does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from comms.messages import RobotState
from rig.analysis.analyze import RunAnalysis
from rig.errors import ConfigError
from rig.run import config, experiment
from rig.run.runs import LOG
from rig.run.runtime import bench

BRIEF = ("camera.rate_hz=0", "experiment.quiet_s=0.3", "experiment.watch_s=0.4")
AFTER_S = 0.6


def quietly(*_: object) -> None:
    """Show nothing."""


def loaded(tmp_path: Path, fault: str, *changes: str) -> config.Experiment:
    """The shipped experiment `axis` with a fault after 0.6 s of motion."""
    shipped = Path(config.__file__).parent / "experiments" / "axis.toml"
    path = tmp_path / "faulty.toml"
    table = f"\n[[bench.drive_faults]]\nafter_motion_s = {AFTER_S}\n{fault}\n"
    path.write_text(shipped.read_text() + table)
    return config.read_experiment(str(path), [*BRIEF, *changes])


def run(tmp_path: Path, fault: str, *changes: str) -> tuple[experiment.FinishedRun, RunAnalysis]:
    """Run in virtual time."""
    loaded_one = loaded(tmp_path, fault, *changes)
    ran = experiment.run(loaded_one, "virtual", tmp_path, quietly, quietly)
    return ran, RunAnalysis(ran.folder / LOG)


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ('kind = "drive_fault"', "emergency of node 1: error 0x2310"),
        ('kind = "node_reset"', "node 1 has restarted"),
        ('kind = "silent"', "no heartbeat of node 1 for"),
        ('kind = "encoder_step"\nstep_m = 0.03', "emergency of node 1: error 0x8611"),
    ],
)
def test_a_fault_in_motion_ends_the_run_with_its_name_and_the_axis_at_rest(
    tmp_path: Path, fault: str, text: str
) -> None:
    ran, analysis = run(tmp_path, fault)
    assert ran.outcome.exit_code == 5
    assert text in ran.outcome.reasons[0]
    t_s, _, _, x_m = analysis.run.truth.T
    at_the_end = x_m[t_s > t_s[-1] - 0.1]
    assert np.ptp(at_the_end) < 20e-6
    assert all(row.unexplained == 0 for row in analysis.summary.links.values())


def test_a_fault_of_the_power_stage_shows_in_the_phase_within_two_states(tmp_path: Path) -> None:
    _, analysis = run(tmp_path, 'kind = "drive_fault"')
    log = analysis.run.log
    emergency_ns = min(
        entry.log_ns for entry in log.topics["/can_up"] if b'"can_id":129,' in entry.data
    )
    states = log.read("/robot_state", RobotState)
    fault_ns = min(s.t_ns for s in states if s.phase.value == "fault")
    assert 0 <= fault_ns - emergency_ns <= 20_000_000


def test_a_small_step_of_the_encoder_is_driven_out(tmp_path: Path) -> None:
    ran, analysis = run(tmp_path, 'kind = "encoder_step"\nstep_m = 0.002')
    assert ran.outcome.exit_code == 0
    assert analysis.run.truth[-1, 3] == pytest.approx(0.198, abs=20e-6)


def test_a_sender_that_goes_bus_off_ends_the_run(tmp_path: Path) -> None:
    ran, analysis = run(tmp_path, 'kind = "silent"', "links.can_up.corrupt=0.3")
    assert ran.outcome.exit_code == 5
    assert analysis.summary.field_bus is not None
    assert analysis.summary.field_bus.bus_off


def test_corrupted_frames_cost_time_and_nothing_else(tmp_path: Path) -> None:
    loaded_one = config.read_experiment("axis", [*BRIEF, "links.can_down.corrupt=0.05"])
    ran = experiment.run(loaded_one, "virtual", tmp_path, quietly, quietly)
    summary = RunAnalysis(ran.folder / LOG).summary
    assert (ran.outcome.exit_code, summary.verdict) == (0, "good")
    assert summary.field_bus is not None
    assert summary.field_bus.errors > 20
    assert not summary.field_bus.bus_off


def test_faults_of_a_drive_need_a_drive() -> None:
    plain = config.read_experiment("move", [])
    table = {"kind": "silent", "after_motion_s": 1.0}
    faulty = plain.__class__(
        experiment=plain.experiment, bench=plain.bench.__class__(drive_faults=[table])
    )
    with pytest.raises(ConfigError, match="of a robot without a drive"):
        bench.params(faulty)


def test_corruption_of_a_link_that_repeats_nothing_is_refused() -> None:
    with pytest.raises(ConfigError, match="only a field bus repeats"):
        config.read_experiment("move", ["links.reference.corrupt=0.1"])


def test_an_unknown_robot_is_named_with_those_there_are() -> None:
    odd = config.read_experiment("move", ["bench.robot.kind=scara"])
    with pytest.raises(ConfigError, match="must be one of cartesian, quattro, ball_screw"):
        bench.params(odd)
