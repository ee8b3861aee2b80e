"""Torque and power of a screw's motor with losses, against dense sampling and hand calculation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.errors import PlanError
from planners.laws import LAWS
from rig.drives.screw.cycle import Cycle, Move
from rig.drives.screw.demand import demand, shaft_demand
from rig.drives.screw.load import AxisLoad
from rig.drives.screw.shaft import BallScrew, Mounting
from rig.drives.screw.table import table
from rig.drives.screw.transmission import Transmission

SCREW = BallScrew(diameter_m=0.032, lead_m=0.01, mounting=Mounting(length_m=1.2))
LOSSY = Transmission(efficiency=0.8, motor_inertia_kg_m2=1e-5, drag_torque_n_m=0.1)
SLOPES = (0.0, -20.0, 5.0, 90.0)
STEPS = 20_000


def there_and_back(law):
    return Cycle(
        (
            Move(stroke_m=0.5, time_s=1.0, law=law, rest_s=0.3),
            Move(stroke_m=-0.5, time_s=0.8, law=law, rest_s=0.2),
        )
    )


def load_at(slope_deg):
    return AxisLoad(mass_kg=80.0, slope_rad=math.radians(slope_deg), friction_coefficient=0.05)


def sampled(cycle, load):
    """Sample weights, speed, force and torque at the middles of many short steps.

    The equations are written independently of the tested code.
    """
    tau, eta, drag = 0.01 / (2 * math.pi), 0.8, 0.1
    inertia = 7800 * math.pi * 0.032**4 / 32 * 1.2 + 1e-5
    parts = []
    for move in cycle.moves:
        s = math.copysign(1.0, move.stroke_m)
        for piece in move.trajectory.pieces:
            t = (np.arange(STEPS) + 0.5) * piece.duration_s / STEPS
            v, a = piece.at(t, 1), piece.at(t, 2)
            force = (
                80 * 9.81 * (math.sin(load.slope_rad) + 0.05 * math.cos(load.slope_rad) * s)
                + 80 * a
            )
            torque = (
                np.where(force * s > 0, force / eta, force * eta) * tau
                + inertia * a / tau
                + drag * s
            )
            parts.append((np.full(STEPS, piece.duration_s / STEPS), v, force, torque))
        held = 80 * 9.81 * math.sin(load.slope_rad)
        parts.append(
            (np.array([move.rest_s]), np.zeros(1), np.array([held]), np.array([held * tau / eta]))
        )
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))


@pytest.mark.parametrize("slope_deg", SLOPES)
@pytest.mark.parametrize("law", LAWS)
def test_torque_and_powers_with_losses_are_those_of_a_dense_sampling(law, slope_deg):
    cycle, load = there_and_back(law), load_at(slope_deg)
    w, v, force, torque = sampled(cycle, load)
    power = torque * v / SCREW.ratio_m_rad
    need = shaft_demand(cycle, load, LOSSY, SCREW)
    scale = np.abs(power).max()
    assert need.peak_torque_n_m == pytest.approx(np.abs(torque).max(), rel=2e-4)
    assert need.driving_power_w == pytest.approx(max(power.max(), 0.0), abs=1e-4 * scale)
    assert need.braking_power_w == pytest.approx(max(-power.min(), 0.0), abs=1e-4 * scale)
    assert need.driving_power_w >= power.max() - 1e-7 * scale
    assert need.braking_power_w >= -power.min() - 1e-7 * scale
    assert need.peak_power_w == max(need.driving_power_w, need.braking_power_w)
    assert need.rms_torque_n_m == pytest.approx(math.sqrt(w @ torque**2 / w.sum()), rel=1e-5)
    assert need.mean_driving_power_w == pytest.approx(
        w @ np.maximum(power, 0.0) / w.sum(), rel=1e-3
    )
    assert need.mean_braking_power_w == pytest.approx(
        w @ np.maximum(-power, 0.0) / w.sum(), rel=1e-3, abs=1e-9
    )
    way = w * np.abs(v)
    worn = (way @ np.abs(force) ** 3 / way.sum()) ** (1 / 3)
    assert demand(cycle, load).equivalent_force_n == pytest.approx(worn, rel=1e-6)


@pytest.mark.parametrize("slope_deg", SLOPES)
@pytest.mark.parametrize("law", LAWS)
def test_the_rows_of_the_table_hold_the_peaks_that_are_checked(law, slope_deg):
    cycle, load = there_and_back(law), load_at(slope_deg)
    need, rows = shaft_demand(cycle, load, LOSSY, SCREW), table(cycle, load, LOSSY, SCREW)
    assert max(abs(row.peak_torque_n_m) for row in rows) == need.peak_torque_n_m
    assert max(abs(row.peak_power_w) for row in rows) == need.peak_power_w
    assert all(abs(row.torque_n_m) <= abs(row.peak_torque_n_m) for row in rows)


def test_a_smooth_law_has_its_peak_torque_elsewhere_than_its_largest_force():
    rows = table(there_and_back("elliptic"), load_at(5.0), LOSSY, SCREW)
    assert max(abs(row.peak_torque_n_m) / abs(row.torque_n_m) for row in rows) > 1.01


def test_lowering_a_load_slowly_is_braking():
    """By hand: 100 kg straight up and down, ramps of 1 % of the time, no friction and no loss."""
    load, free = AxisLoad(mass_kg=100.0, slope_rad=math.pi / 2), Transmission(efficiency=1.0)
    up = Move(stroke_m=1.0, time_s=10.0, lambda_acc=0.01, lambda_dec=0.01)
    down = Move(stroke_m=-1.0, time_s=5.0, lambda_acc=0.01, lambda_dec=0.01)
    light = BallScrew(diameter_m=1e-3, lead_m=0.01, mounting=Mounting(length_m=2.0))
    need = shaft_demand(Cycle((up, down)), load, free, light)
    speeds = 1.0 / 9.9, 1.0 / 4.95
    driving, braking = (
        100 * (9.81 + speed / t) * speed for speed, t in zip(speeds, (0.1, 0.05), strict=True)
    )
    assert need.driving_power_w == pytest.approx(driving, rel=1e-4)
    assert need.braking_power_w == pytest.approx(braking, rel=1e-4)
    assert need.peak_power_w == need.braking_power_w
    kinetic = (
        100 * speeds[0] ** 2 / 2 - 100 * speeds[1] ** 2 / 2
    )  # given and taken back, of either move
    assert need.mean_driving_power_w == pytest.approx(100 * 9.81 / 15, rel=1e-3)
    assert need.mean_driving_power_w - need.mean_braking_power_w == pytest.approx(
        0.0, abs=1e-6 * abs(kinetic) + 1e-9
    )


def test_the_mean_braking_power_is_the_driving_power_without_losses():
    need = shaft_demand(
        there_and_back("quintic"), AxisLoad(mass_kg=10.0), Transmission(efficiency=1.0), SCREW
    )
    assert need.mean_braking_power_w == pytest.approx(need.mean_driving_power_w, rel=1e-3)


def test_a_brake_relieves_the_motor_in_the_rests_and_nowhere_else():
    cycle, load = there_and_back("trapezoidal"), load_at(90.0)
    held, braked = (
        table(cycle, load, replace(LOSSY, hold=hold), SCREW) for hold in ("motor", "brake")
    )
    for row, other in zip(held, braked, strict=True):
        assert other == (row if row.phase else row._replace(torque_n_m=0.0, peak_torque_n_m=0.0))
    rest = next(row for row in held if not row.phase)
    assert rest.torque_n_m == pytest.approx(80 * 9.81 * 0.01 / (2 * math.pi) / 0.8, rel=1e-12)
    heats = [
        shaft_demand(cycle, load, replace(LOSSY, hold=hold), SCREW).rms_torque_n_m ** 2
        for hold in ("motor", "brake")
    ]
    assert heats[0] - heats[1] == pytest.approx(rest.torque_n_m**2 * 0.5 / 2.3, rel=1e-9)


def test_a_thousand_equal_moves_have_the_demand_of_two_and_are_computed_once():
    few, many = there_and_back("quintic"), Cycle(there_and_back("quintic").moves * 500)
    assert many.instants.weight_s.size == few.instants.weight_s.size
    assert many.duration_s == pytest.approx(500 * few.duration_s)
    assert many.instants.weight_s.sum() == pytest.approx(many.duration_s)
    load = load_at(5.0)
    assert demand(many, load) == pytest.approx(demand(few, load), rel=1e-12)
    assert shaft_demand(many, load, LOSSY, SCREW) == pytest.approx(
        shaft_demand(few, load, LOSSY, SCREW), rel=1e-12
    )
    rows = table(many, load, LOSSY, SCREW)
    assert len(rows) == 500 * len(table(few, load, LOSSY, SCREW))
    assert rows[-1] == rows[3]._replace(move=1000)


def test_a_move_counts_as_often_as_it_occurs():
    """By hand: forces of friction and inertia, twice 0.25 m there and once 0.5 m back."""
    short = Move(stroke_m=0.25, time_s=1.0, rest_s=1.0)
    back = Move(stroke_m=-0.5, time_s=1.0)
    need = demand(Cycle((short, short, back)), AxisLoad(mass_kg=10.0, friction_coefficient=0.1))
    assert need.mean_speed_m_s == pytest.approx(1.0 / 5.0)
    assert need.rms_friction_n == pytest.approx(9.81 * math.sqrt(3 / 5))
    forces = [
        (9.81 + 10 * s * 4.5 * h, h * share)
        for h in (0.25, 0.25, 0.5)
        for s, share in ((1, 0.25), (0, 0.5), (-1, 0.25))
    ]
    assert need.equivalent_force_n == pytest.approx(
        sum(abs(f) ** 3 * way for f, way in forces) ** (1 / 3), rel=1e-9
    )


@settings(max_examples=40)
@given(
    st.floats(-90.0, 90.0),
    st.floats(0.3, 1.0),
    st.sampled_from(("quintic", "cycloidal", "trapezoidal")),
)
def test_no_loss_makes_power(slope_deg, efficiency, law):
    """The braking power is below the driving power and not above that without losses."""
    cycle, load = there_and_back(law), load_at(slope_deg)
    gear = Transmission(efficiency=efficiency, drag_torque_n_m=0.1)
    lossy, free = (
        shaft_demand(cycle, load, g, SCREW) for g in (gear, Transmission(efficiency=1.0))
    )
    assert lossy.mean_braking_power_w < lossy.mean_driving_power_w
    assert lossy.mean_braking_power_w <= free.mean_braking_power_w * (1 + 1e-3)
    assert lossy.mean_driving_power_w >= free.mean_driving_power_w * (1 - 1e-3)


def test_moves_of_an_axis_may_come_as_a_list():
    there = Move(stroke_m=0.2, time_s=1.0, durations_s=[1 / 3, 1 / 3, 1 / 3])
    cycle = Cycle([there, replace(there, stroke_m=-0.2)])
    assert len(cycle.counts) == 2
    with pytest.raises(PlanError, match=r"time_s = -1\.0; must be"):
        replace(there, time_s=-1.0)
