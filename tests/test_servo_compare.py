"""Controllers on the simulated joint: the source's experiments, by our gains, against the linear loop recomputed."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path

import control
import msgspec
import numpy as np
import pytest

from planners.drives.motor import Drivetrain, effort
from planners.errors import Infeasible, PlanError
from rig.errors import ConfigError
from rig.servo.errors import PolesOutOfReach
from rig.servo.estimator import kalman
from rig.servo.loops import swinging
from rig.servo.setpoint import Setpoint
from rig.servo.state_feedback import lq
from rig.servo_studies import bench_run
from rig.servo_studies.compare import Row, compare, designs
from rig.servo_studies.controllers import CONTROLLERS
from rig.servo_studies.spec import load

EXPERIMENTS = tomllib.loads((Path(__file__).parent / "data" / "servo_compare.toml").read_text())["experiment"]
TRUTHS = ("listed", "ripple", "friction", "fitted", "together")
SPEC = load(None)


@pytest.fixture(scope="module")
def rows() -> dict[tuple[str, int, str], Row]:
    return {(row.truth, row.move, row.controller): row for row in compare(SPEC, TRUTHS, list(CONTROLLERS))}


@pytest.mark.parametrize("move", [1, 2, 3])
def test_the_moves_are_those_of_the_source(move):
    figures, path = EXPERIMENTS[move - 1], SPEC.move[move - 1].trajectory(SPEC.model.gear_ratio)
    assert path.at(path.duration_s) == pytest.approx(figures["motor_rotation_rad"], rel=1e-7)
    assert path.breaks_s[1] == pytest.approx(figures["ramp_s"], rel=1e-7)
    assert path.peak(1).value == pytest.approx(figures["top_motor_rad_s"], rel=1e-7)


@pytest.mark.parametrize("move", [1, 2, 3])
def test_a_rigid_joint_would_need_the_torque_and_the_current_of_the_source_s_data(move):
    figures, model = EXPERIMENTS[move - 1], SPEC.model
    shaft = Drivetrain(
        motor_inertia_kg_m2=model.motor_inertia_kg_m2,
        load_inertia_kg_m2=model.load_inertia_kg_m2,
        motor_friction_n_m_s_rad=model.motor_friction_n_m_s_rad,
        gear_ratio=model.gear_ratio,
    )
    found = effort(shaft, SPEC.move[move - 1].trajectory(model.gear_ratio).scaled(1.0 / model.gear_ratio))
    assert found.peak_torque_n_m.value == pytest.approx(figures["peak_torque_n_m"], rel=1e-7)
    assert found.peak_torque_n_m.value / SPEC.drive.torque_constant_n_m_a == pytest.approx(figures["peak_current_a"], rel=1e-7)
    assert found.peak_speed_rad_s.value == pytest.approx(figures["top_motor_rad_s"], rel=1e-7)


@pytest.mark.parametrize("move", [1, 2, 3])
def test_no_less_acceleration_makes_the_move_in_its_time(move):
    least, section = EXPERIMENTS[move - 1]["least_acceleration_rad_s2"], SPEC.move[move - 1]
    msgspec.structs.replace(section, motor_acceleration_rad_s2=least * (1.0 + 1e-6)).trajectory(SPEC.model.gear_ratio)
    with pytest.raises(Infeasible):
        msgspec.structs.replace(section, motor_acceleration_rad_s2=least * (1.0 - 1e-6)).trajectory(SPEC.model.gear_ratio)


def test_the_file_s_truths_are_the_parameter_sets_that_the_joint_is_known_by():
    known = tomllib.loads((Path(__file__).parent / "data" / "servo_joint.toml").read_text())
    for name, table in (("listed", "listed"), ("fitted", "fitted"), ("together", "fitted")):
        told = SPEC.truth_tables(name)
        assert {key: told[key] for key in known[table]} == pytest.approx(known[table])
    assert SPEC.joint.antiresonance_rad_s == pytest.approx(known["modes"]["listed"]["antiresonance_rad_s"], rel=1e-7)


@pytest.mark.parametrize("move", [1, 2, 3])
@pytest.mark.parametrize("truth", TRUTHS)
def test_lqg_leaves_less_vibration_than_pid_whatever_the_joint_really_is(rows, truth, move):
    pid, lqg = (rows[truth, move, name].outcome for name in ("pid", "lqg"))
    assert lqg.residual < 0.6 * pid.residual
    assert lqg.residual_measured < 0.6 * pid.residual_measured
    assert lqg.speed_error < pid.speed_error
    assert lqg.overshoot_deg < pid.overshoot_deg


@pytest.mark.parametrize("move", [1, 2, 3])
def test_sampled_on_the_listed_joint_they_leave_what_the_linear_loop_does(rows, move):
    figures = EXPERIMENTS[move - 1]
    pid, lqg = (rows["listed", move, name].outcome for name in ("pid", "lqg"))
    assert 100.0 * pid.residual == pytest.approx(figures["pid_residual_percent"], rel=0.01)
    assert 100.0 * lqg.residual == pytest.approx(figures["lqg_residual_percent"], rel=0.02)
    assert pid.overshoot_deg == pytest.approx(figures["pid_overshoot_deg"], rel=0.05)
    assert lqg.overshoot_deg == pytest.approx(figures["lqg_overshoot_deg"], rel=0.02)
    assert lqg.peak_torque_n_m == pytest.approx(figures["peak_torque_n_m"], rel=0.05)  # the encoder's steps are in it


def test_the_first_two_experiments_are_one_scaled_by_four_to_three(rows):
    for name in ("pid", "lqg"):
        first, second = (rows["fitted", move, name].outcome for move in (1, 2))
        assert first.residual == pytest.approx(second.residual, rel=0.005)
        assert first.overshoot_deg / second.overshoot_deg == pytest.approx(4.0 / 3.0, rel=0.01)


@pytest.mark.parametrize("move", [1, 2, 3])
def test_with_the_feed_forward_pair_the_load_follows_the_filter_and_hardly_anything_is_left(rows, move):
    row = rows["listed", move, "lqg_ff"]
    assert row.outcome.residual < 0.002
    assert row.late_s == pytest.approx(0.0749, abs=0.0005)  # (1 + x + x^2 / 2) exp(-x) = 0.001 at x = 11.229, 1 / 150 s
    assert rows["together", move, "lqg_ff"].outcome.residual < 0.3 * rows["together", move, "lqg"].outcome.residual


@pytest.mark.parametrize("name", [name for name in CONTROLLERS if name != "pid_shaped"])
def test_a_controller_steps_as_the_linear_system_that_its_loop_is_judged_by(name):
    spec = load(None, ["drive.torque_limit_n_m=1e9"])
    controller, random = CONTROLLERS[name](spec).controller, np.random.default_rng(1)
    told = random.normal(size=(4, 200)).cumsum(axis=1)
    right = np.asarray(control.forced_response(controller.system, inputs=told).outputs).ravel()
    found = [controller.step(Setpoint(*row[:3]), row[3]) for row in told.T.tolist()]
    assert found == pytest.approx(right, abs=1e-9 * float(np.abs(right).max()))


def test_designs_are_judged_by_their_loops():
    found = designs(SPEC, list(CONTROLLERS))
    assert found["pid"].condition == found["pid_shaped"].condition  # a shaper is outside of the loop
    assert found["lqg"].margins == found["lqg_ff"].margins
    for name, facts in found.items():
        assert facts.poles_1_s.real.max() < 0.0, name
        joint_s_own = [mode for mode in swinging(facts.zeros_1_s) if mode.frequency_rad_s < 3000.0]
        assert joint_s_own[0] == pytest.approx((107.15, 0.038), rel=0.01)  # the load swings while the motor stands
        assert facts.margins.phase_deg > 30.0
        assert facts.condition > 1.0
    apart = np.concatenate(
        [lq(SPEC.joint, SPEC.lqg.state_weights).poles_1_s(SPEC.joint), kalman(SPEC.joint).poles_1_s(SPEC.joint)]
    )
    assert np.sort_complex(found["lqg"].poles_1_s) == pytest.approx(np.sort_complex(apart), rel=1e-6)


def test_the_accelerometer_tells_the_speed_that_the_load_has(rows):
    for row in rows.values():
        r = row.recording
        error = np.sqrt(np.mean((r.measured_rad_s - r.load_rad_s) ** 2)) / np.abs(r.reference_rad_s).max()
        assert error < 0.005


def test_the_load_arrives_whatever_the_joint_really_is(rows):
    for row in rows.values():
        assert abs(row.outcome.final_error_deg) < 0.004
        assert row.recording.integration_error_rad < 1e-9


def test_peak_torques_keep_the_drive_s_limit_and_residuals_appear_when_it_is_too_low():
    tight = load(None, ["drive.torque_limit_n_m=1.0", "bench.torque_limit_n_m=1.0"])
    for row in compare(tight, ["listed"], list(CONTROLLERS)):
        assert row.outcome.peak_torque_n_m <= 1.0 + 1e-12
        assert abs(row.outcome.final_error_deg) < 0.05  # it comes back from the limit


def test_equal_seeds_make_equal_readings_and_other_seeds_others():
    def readings(seed: int) -> list[float]:
        row = next(iter(compare(msgspec.structs.replace(SPEC, seed=seed), ["together"], ["lqg"])))
        return row.recording.measured_rad_s.tolist()

    assert readings(1) == readings(1)
    assert readings(1) != readings(2)


def test_a_figure_is_what_its_definition_says():
    t = np.arange(0.0, 1.0, 0.25)
    recording = bench_run.Recording(
        t,
        0.5,
        reference_rad=np.array([0.0, 0.5, 1.0, 1.0]),
        reference_rad_s=np.array([0.0, 2.0, 0.0, 0.0]),
        load_rad=np.array([0.0, 0.4, 1.1, 1.0]),
        load_rad_s=np.array([0.0, 2.0, 0.5, -0.01]),
        measured_rad_s=np.array([0.0, 2.0, 0.4, 0.0]),
        torque_n_m=np.array([3.0, 4.0, -5.0, 0.0]),
        integration_error_rad=0.0,
    )
    found = bench_run.outcome(recording)
    assert found == bench_run.Outcome(
        residual=0.25,
        residual_measured=0.2,
        settling_s=0.25,
        speed_error=pytest.approx(math.sqrt((0.25 + 0.0001) / 4.0) / 2.0),
        overshoot_deg=pytest.approx(math.degrees(0.1)),
        final_error_deg=0.0,
        peak_torque_n_m=5.0,
        rms_torque_n_m=pytest.approx(math.sqrt(12.5)),
    )
    assert bench_run.outcome(recording, late_s=0.25).residual == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("changes", "error", "said"),
    [
        (["model.stifness_n_m_rad=3"], ConfigError, "did you mean 'stiffness_n_m_rad'"),
        (["model.stiffness_n_m_rad=-3"], Exception, "stiffness_n_m_rad = -3"),
        (["bench.load_inertia_kg_m2=-1"], ConfigError, "load_inertia_kg_m2"),
        (["bench.coulomb=1"], ConfigError, "coulomb_torque_n_m"),
        (["drive.period_s=0.05"], Exception, "half the sampling"),
        (["helpers.shaper='zzv'"], PlanError, "did you mean 'zv'"),
        (["lqg.state_weights=[1, 1, 1, 1, 0]"], Exception, "the last > 0"),
        (["assigned.poles_1_s=[[-60, 60], [-60, -60], [-105, 0], [-105, 5], [-40, 0]]"], PolesOutOfReach, "conjugate"),
    ],
)
def test_what_cannot_be_had_is_refused_before_anything_moves(changes, error, said):
    with pytest.raises(error, match=said.replace("[", r"\[")):
        next(iter(compare(load(None, changes), ["listed"], list(CONTROLLERS))))


def test_a_move_that_is_too_fast_for_its_acceleration_names_the_least_time(tmp_path):
    text = (Path(bench_run.__file__).parent / "source_001.toml").read_text().replace("= 1200.0", "= 1000.0")
    (tmp_path / "fast.toml").write_text(text)
    with pytest.raises(Infeasible, match=r"must be finite and >= 1117.01"):
        next(iter(compare(load(tmp_path / "fast.toml"), ["listed"], ["pid"])))


def test_the_command_shows_a_table_and_says_who_leaves_less(rig):
    code, out, _ = rig("servo", "compare", "--truth", "listed,fitted")
    assert code == 0
    assert "lqg leaves less vibration than pid in 6 of 6 moves" in out
    assert "40° in 0.5 s" in out
    assert "127.4, 0.385" in out  # the design's least damped pair
    assert "the gains" in out
    assert "\n" not in max(out.splitlines(), key=len)[160:]


def test_the_command_s_document_has_every_run(rig, tmp_path):
    code, out, _ = rig("servo", "compare", "--truth", "listed", "--controllers", "all", "--json", "--plot", tmp_path / "c.png")
    document = json.loads(out)
    assert code == 0
    assert [(row["move"], row["controller"]) for row in document["rows"]] == [(m, c) for m in (1, 2, 3) for c in CONTROLLERS]
    assert list(document["designs"]) == list(CONTROLLERS)
    assert len(document["designs"]["lqg"]["poles_1_s"]) == 9
    row = document["rows"][0]
    assert row["peak_current_a"] == pytest.approx(row["peak_torque_n_m"] / 1.6)
    assert row["residual_of_the_first"] is None
    assert (tmp_path / "c.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--controllers", "lqr"), "did you mean 'lqg'"),
        (("--truth", "fited"), "did you mean 'fitted'"),
        (("--controllers", ","), "--controllers ','; must name one"),
        (("--truth", ","), "--truth ','; must name one"),
        (("nothing.toml",), "servo comparison 'nothing.toml' cannot be read"),
        (("--plot", "x.gif"), "must end in one of"),
        (("--set", "period=1"), "must be section.key=value"),
    ],
)
def test_the_command_names_what_it_cannot_use(rig, words, said):
    code, out, err = rig("servo", "compare", *words)
    assert (code, out) == (2, "")
    assert said in err
