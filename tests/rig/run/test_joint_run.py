"""Runs of the elastic joint over the bus, in virtual time, against the comparison on the bench."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from comms.messages import CanMessage, Truth
from rig.analysis.analyze import RunAnalysis
from rig.analysis.conclusion import conclude
from rig.errors import ConfigError, Refused
from rig.run import config, experiment
from rig.run.field_bus.decoding import Decoder
from rig.run.field_bus.names import dbc_text
from rig.run.field_bus.traffic import read_traffic
from rig.run.runs import LOG
from rig.studies.servo.compare import build_drives, compare
from rig.studies.servo.spec import read_spec
from rig.ui.report import write

CONTROLLERS = ("pid", "lqg")
PLANTS = ("listed", "fitted")


def run(folder: Path, name: str, *changes: str) -> tuple[experiment.FinishedRun, RunAnalysis]:
    ran = experiment.run(
        config.read_experiment(name, list(changes)), "virtual", folder, _quiet, _quiet
    )
    return ran, RunAnalysis(ran.folder / LOG)


def _quiet(*_: object) -> None:
    return None


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_moves_of_source_001_leave_what_the_comparison_predicts(
    tmp_path: Path, controller: str, plant: str
) -> None:
    spec = read_spec(None)
    for row in compare(spec, [plant], build_drives(spec, [controller])):
        changes = (f"joint.controller={controller}", f"bench.robot.parameters={plant}")
        _, analysis = run(tmp_path, f"joint_{row.move}", *changes)
        figures = analysis.summary.joint
        assert figures is not None
        assert analysis.summary.verdict == "good", analysis.summary.reasons
        assert figures.residual == pytest.approx(row.outcome.residual, rel=0.02)
        assert figures.peak_torque_n_m == pytest.approx(row.outcome.peak_torque_n_m, rel=0.05)
        assert figures.settled_s == pytest.approx(row.outcome.settled_s, abs=0.003)
        assert figures.arrived
        off = figures.residual_measured - (figures.residual or 0.0)
        assert abs(off) < 4.0 * figures.residual_sigma


def test_equal_seeds_give_equal_digests_and_other_seeds_others(tmp_path: Path) -> None:
    first, _ = run(tmp_path, "joint_2")
    second, _ = run(tmp_path, "joint_2")
    other, _ = run(tmp_path, "joint_2", "experiment.seed=2")
    assert first.outcome.digest == second.outcome.digest != other.outcome.digest


def test_the_traffic_has_names_units_and_the_acceleration_of_the_load(tmp_path: Path) -> None:
    ran, analysis = run(tmp_path, "joint_1")
    traffic = read_traffic(str(ran.folder), tmp_path)
    decoder = Decoder.of_drive(traffic.bus.node)
    assert "load_acceleration" in dbc_text(traffic.bus.node)
    status = [frame for frame in traffic.frames if frame.arbitration_id == 0x281]
    values = [
        {name: (value, unit) for name, value, unit in decoder.decode(f).signals} for f in status
    ]
    largest = max(abs(row["load_acceleration"][0]) for row in values)
    joint = analysis.joint
    assert joint is not None
    assert values[0]["load_acceleration"][1] == "rad/s2"
    assert largest > 1200.0 / 100.0, "the load oscillates around the acceleration of the plan"
    assert analysis.summary.field_bus is not None
    assert 0.3 < analysis.summary.field_bus.load < 0.5


def test_a_fault_of_the_drive_ends_the_run_and_the_joint_brakes(tmp_path: Path) -> None:
    fault = 'bench.drive_faults=[{kind="drive_fault", after_motion_s=0.2}]'
    ran, analysis = run(tmp_path, "joint_1", fault)
    assert ran.outcome.exit_code == 5
    assert "0x2310" in ran.outcome.reasons[0]
    assert analysis.summary.verdict == "bad"


def test_a_node_that_falls_silent_ends_the_run_and_the_joint_brakes_at_its_ramp(
    tmp_path: Path,
) -> None:
    silent = 'bench.drive_faults=[{kind="silent", after_motion_s=0.2, duration_s=3.0}]'
    ran, analysis = run(tmp_path, "joint_1", silent, "joint.drive.quick_stop_rad_s2=1000")
    assert ran.outcome.exit_code == 5
    assert "no heartbeat of node 1" in ran.outcome.reasons[0]
    truth = analysis.run.log.read("/truth", Truth)
    speed = {t.t_ns // 1_000_000: t.links[0].rate_x_rad_s for t in truth}
    top_ms = max(speed, key=lambda t_ms: speed[t_ms])
    rest_ms = next(t for t in sorted(speed) if t > top_ms and speed[t] < 0.02 * speed[top_ms])
    braked_s = speed[top_ms] * 100.0 / 1000.0
    assert (rest_ms - top_ms) * 1e-3 < braked_s + 0.06 + 0.1, "silence, ramp and oscillation"


def test_the_load_stays_at_rest_until_the_move(tmp_path: Path) -> None:
    _, analysis = run(tmp_path, "joint_1")
    truth = analysis.run.log.read("/truth", Truth)
    still = [t for t in truth if t.t_ns * 1e-9 < analysis.run.t_move_s]
    assert max(abs(t.links[0].angle_x_rad) for t in still) < 1e-4
    targets = [
        struct.unpack("<Hih", m.data)
        for m in analysis.run.log.read("/can_down", CanMessage)
        if m.can_id == 0x201
    ]
    assert max(torque for *_, torque in targets) == round(1000 * 1200 * (1.5e-4 + 2.7e-4))


def test_the_report_shows_the_joint_and_the_load_of_the_bus(tmp_path: Path) -> None:
    ran, analysis = run(tmp_path, "joint_1")
    page = write(ran.folder, analysis).read_text()
    assert "Under pid the load keeps 7." in conclude(analysis.run, analysis.summary).sentence
    for text in ("residual vibration", "Vibration after the move", "Field bus", "load, without"):
        assert text in page


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ("joint.controller=pud", "did you mean 'pid'"),
        ("joint.move.load_angle_deg=200", "position_limit_deg"),
        ("joint.move.motor_acceleration_rad_s2=100", "must be >="),
        ("joint.drive.rated_torque_n_m=0.01", "rated_torque_n_m"),
        ("bench.robot.parameters=third", "listed, fitted"),
        ("bench.robot.kind=cartesian", "experiments of the kind joint"),
        ("move.distance_m=0.1", "[move] in an experiment of the kind joint"),
        ("drive.node_id=3", "[drive] in an experiment of the kind joint"),
        ("camera.rate_hz=20", "[camera] in an experiment of the kind joint"),
        ('bench.drive_faults=[{kind="encoder_step", after_motion_s=0.1, step_m=0.1}]', "step_rad"),
    ],
)
def test_what_is_wrong_is_named_before_anything_moves(
    tmp_path: Path, change: str, text: str
) -> None:
    with pytest.raises((ConfigError, Refused, ValueError)) as caught:
        run(tmp_path, "joint_1", change)
    assert text in str(caught.value)
    assert not list(tmp_path.iterdir())
