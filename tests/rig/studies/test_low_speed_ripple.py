"""Shipped case of ripple inside the band of the Kalman filter, against the linear loop."""

from __future__ import annotations

import json
import math

import control
import numpy as np
import pytest

from planners.errors import PlanError
from rig.analysis.joint_move import cruise_ripple_rad_s
from rig.drives.servo.estimator import Noise, sampled_kalman
from rig.drives.servo.loops import oscillatory_pairs
from rig.drives.servo.wiring import SETPOINT, STATES, interconnect, plant
from rig.studies.servo.compare import build_drives, compare
from rig.studies.servo.spec import read_spec

SPEC = read_spec(None, example="low_speed_ripple")
CYCLES = {"encoder": 8.0, "torque": 2.0}  # per revolution


@pytest.fixture(scope="module")
def ripple():
    """(M,) standard deviation of the load speed [rad/s] of every variant and controller."""
    found = {}
    for run in compare(SPEC, list(SPEC.truth), build_drives(SPEC, ["lqg", "pid_ff"])):
        assert run.outcome.arrived
        found.setdefault((run.plant_variant, run.controller), []).append(
            cruise_ripple_rad_s(run.recording)
        )
    return {key: np.array(values) for key, values in found.items()}


def speeds_rad_s():
    paths = [move.trajectory(SPEC.model.gear_ratio) for move in SPEC.move]
    return np.array([path.peak(1).value for path in paths])


def estimator_band_rad_s():
    """Natural frequency -+ decay rate of the least damped pole pair of the Kalman filter."""
    noise = Noise(
        motor_torque_n2_m2_s=SPEC.lqg.torque_noise_n2_m2_s,
        load_torque_n2_m2_s=SPEC.lqg.torque_noise_n2_m2_s,
        encoder_counts_per_rev=SPEC.lqg.encoder_counts_per_rev,
    )
    found = sampled_kalman(SPEC.joint, noise, SPEC.drive.period_s)
    pair = min(oscillatory_pairs(found.poles_1_s(SPEC.joint)), key=lambda mode: mode.damping)
    width = pair.damping * pair.frequency_rad_s
    return pair.frequency_rad_s - width, pair.frequency_rad_s + width


def linear_ripple_rad_s(variant, omega_rad_s):
    """Compute the standard deviation of the load speed from the sampled linear loop."""
    period_s, table = SPEC.drive.period_s, SPEC.plant_variant_tables(variant)
    controller = build_drives(SPEC, ["lqg"])["lqg"].loop
    blocks = [
        control.summing_junction(["motor_angle", "encoder_error"], "reading"),
        control.ss(controller, inputs=[*SETPOINT, "reading"], outputs="drive_torque"),
        control.summing_junction(["drive_torque", "ripple_torque"], "torque"),
        plant(SPEC.joint, period_s),
    ]
    closed = interconnect(blocks, ["encoder_error", "ripple_torque"], STATES)
    source, amplitude = "encoder_error", table.get("encoder_ripple_rad")
    if variant == "torque":
        source, amplitude = "ripple_torque", table["torque_ripple_n_m"]
    gain = np.abs(closed["load_speed", source](np.exp(1j * omega_rad_s * period_s)))
    return amplitude * gain / math.sqrt(2.0) / SPEC.model.gear_ratio


def test_the_moves_have_the_speeds_that_the_file_states():
    assert speeds_rad_s()[[0, -1]] == pytest.approx([5.0, 200.0], rel=0.01)
    assert estimator_band_rad_s() == pytest.approx((127.4 - 49.1, 127.4 + 49.1), rel=0.01)


@pytest.mark.parametrize("variant", CYCLES)
def test_the_load_speed_under_lqg_ripples_most_where_speed_times_cycles_is_in_the_band(
    ripple, variant
):
    omega = CYCLES[variant] * speeds_rad_s()
    low, high = estimator_band_rad_s()
    found = ripple[variant, "lqg"]
    inside = (omega > low) & (omega < high)
    assert low < omega[found.argmax()] < high
    assert found.max() > 1.5 * found[~inside].max()
    assert found.max() > 5.0 * max(found[0], found[-1])


@pytest.mark.parametrize("variant", CYCLES)
def test_the_ripple_is_that_of_the_linear_loop(ripple, variant):
    """Encoder steps add about 1e-4 rad/s; a torque held for a sample lags the ripple a little."""
    right = linear_ripple_rad_s(variant, CYCLES[variant] * speeds_rad_s()[:6])
    assert ripple[variant, "lqg"][:6] == pytest.approx(right, rel=0.1, abs=3e-4)


def test_encoder_ripple_in_the_band_costs_lqg_more_than_the_cascade(ripple):
    lqg, cascade = ripple["encoder", "lqg"], ripple["encoder", "pid_ff"]
    assert lqg.max() > 2.0 * cascade.max()


def test_torque_ripple_in_the_band_costs_lqg_less_than_the_cascade(ripple):
    assert ripple["torque", "lqg"].max() < ripple["torque", "pid_ff"].max()


def test_without_ripple_the_speed_does_not_depend_on_the_band(ripple):
    assert ripple["smooth", "lqg"].max() < 0.05 * ripple["encoder", "lqg"].max()


def test_the_example_runs_from_the_command_line(rig):
    words = ("--example", "low_speed_ripple", "--truth", "encoder", "--controllers", "lqg")
    code, said, _ = rig("servo", "compare", *words, "--json")
    rows = json.loads(said)["rows"]
    assert code == 0
    ripple = [row["speed_ripple_rad_s"] for row in rows]
    assert len(ripple) == len(SPEC.move)
    assert ripple.index(max(ripple)) == 2
    assert json.loads(said)["source_001"] == ""


def test_an_unknown_example_and_an_example_with_a_file_are_refused(rig):
    with pytest.raises(PlanError, match="did you mean 'low_speed_ripple'"):
        read_spec(None, example="low_speed_riple")
    code, _, told = rig("servo", "compare", "a.toml", "--example", "source_001")
    assert code == 2
    assert "SPEC.toml and --example source_001; must be one of them" in told
