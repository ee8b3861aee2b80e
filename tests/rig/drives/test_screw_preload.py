"""Effects of a preload: load on the balls, life and drag."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from rig.drives.screw.checks import assess
from rig.drives.screw.preload import ball_load_n, drag_torque_n_m
from rig.drives.screw.table import table
from rig.studies.sizing.axis_file import example_tables, sizing_of

SIZING = sizing_of(example_tables("appendix"))
AXIS, UNIT = SIZING.axis, SIZING.choice


def checks_of(axis, candidate):
    return {check.name: check for check in assess(axis, candidate).checks}


@given(st.floats(1.0, 1e4))
def test_a_preloaded_nut_is_two_balls_that_share_a_force(preload):
    """Hertz: the deflection of a ball is proportional to load^(2/3), equal in both halves.

    The rule is a fit.
    """
    for share in (0.1, 0.5, 1.0, 2.0, 2.5):
        force = share * preload

        def difference(loaded, force=force):
            unloaded = max(loaded - force, 0.0)
            return (loaded ** (2 / 3) - preload ** (2 / 3)) - (
                preload ** (2 / 3) - unloaded ** (2 / 3)
            )

        exact = brentq(difference, preload, 3 * preload + force)
        assert ball_load_n(np.array([force]), preload)[0] == pytest.approx(exact, rel=0.03)


def test_a_force_that_lifts_one_half_is_carried_by_the_other_alone():
    limit = 2**1.5 * 100.0
    assert ball_load_n(np.array([0.0, limit, -limit, 1.5 * limit]), 100.0) == pytest.approx(
        [100.0, limit, limit, 1.5 * limit]
    )
    assert ball_load_n(np.array([-3.0, 7.0]), 0.0) == pytest.approx([3.0, 7.0])


@given(st.floats(1.0, 1e4), st.floats(-1e5, 1e5), st.floats(1.01, 3.0))
def test_more_preload_or_more_force_never_presses_less(preload, force, more):
    here = ball_load_n(np.array([force]), preload)[0]
    assert here >= max(preload, abs(force)) * (1 - 1e-12)
    assert ball_load_n(np.array([force]), preload * more)[0] >= here * (1 - 1e-12)
    assert ball_load_n(np.array([force * more]), preload)[0] >= here * (1 - 1e-12)


@pytest.mark.parametrize("preload", [580.0, 1160.0])
def test_the_preload_is_in_the_life_phase_by_phase(preload):
    """By hand from the forces of the table, constant within each phase, and its distances."""
    rows = [
        row
        for row in table(AXIS.cycle, AXIS.load, AXIS.transmission, UNIT.screw(AXIS.mounting))
        if row.phase
    ]
    loads = [preload * (1 + abs(row.force_n) / (2**1.5 * preload)) ** 1.5 for row in rows]
    ways = [row.duration_s * abs(row.mean_speed_m_s) for row in rows]
    worn = (sum(load**3 * way for load, way in zip(loads, ways, strict=True)) / sum(ways)) ** (
        1 / 3
    )
    hours = 1e6 * 0.02 / 3600 / (1.2 / 1.86) * (11600 / (1.2 * worn)) ** 3
    found = checks_of(AXIS, replace(UNIT, preload_n=preload))["life"]
    assert found.value == pytest.approx(hours, rel=1e-9)
    assert found.state == "broken"
    constant = (
        preload * (1 + 82.164912 / (2**1.5 * preload)) ** 1.5
    )  # the same of the equivalent force, a little more
    assert hours == pytest.approx(
        1e6 * 0.02 / 3600 / (1.2 / 1.86) * (11600 / (1.2 * constant)) ** 3, rel=0.12
    )


def test_the_usual_share_is_for_nuts_without_a_preload_of_their_own():
    shared = replace(AXIS, utilisation=replace(AXIS.utilisation, preload=0.05))
    assert (
        checks_of(shared, UNIT)["life"].value
        == checks_of(AXIS, replace(UNIT, preload_n=580.0))["life"].value
    )
    assert (
        checks_of(shared, replace(UNIT, preload_n=0.0))["life"].value
        == checks_of(AXIS, UNIT)["life"].value
    )
    assert shared.preload_n(replace(UNIT, dynamic_load_n=None)) == 0.0


def test_a_preload_drags_unless_the_drag_is_given():
    """0.05 / sqrt(tan beta) F_pr p / 2 pi is about 0.16 N m for 5 % of the unit's rating."""
    drag = 0.05 / math.sqrt(0.02 / (math.pi * 0.02)) * 580.0 * 0.02 / (2 * math.pi)
    assert drag_torque_n_m(580.0, 0.02, 0.02) == pytest.approx(drag, rel=1e-12)
    assert drag == pytest.approx(0.16, abs=0.005)
    pressed = replace(UNIT, preload_n=580.0)
    loose, dragged = assess(AXIS, UNIT).shaft, assess(AXIS, pressed).shaft
    assert dragged.peak_torque_n_m - loose.peak_torque_n_m == pytest.approx(drag, rel=1e-9)
    given_ = replace(AXIS, transmission=replace(AXIS.transmission, drag_torque_n_m=0.3))
    dragged_as_given = assess(given_, pressed).shaft
    assert dragged_as_given.peak_torque_n_m - loose.peak_torque_n_m == pytest.approx(0.3, rel=1e-9)


def test_the_static_load_has_the_preload_in_it():
    pressed = 580.0 * (1 + 157.8778 / (2**1.5 * 580.0)) ** 1.5
    assert checks_of(AXIS, replace(UNIT, preload_n=580.0))["static load"].value == pytest.approx(
        1.2 * pressed, rel=1e-6
    )


def test_the_command_states_the_life_with_the_recommended_preload(rig):
    def hours(preload):
        return checks_of(AXIS, replace(UNIT, preload_n=preload))["life"].value

    _, said, _ = rig("size", "--example", "appendix")
    least, most = (float(f"{hours(preload):.4g}") for preload in (1160.0, 580.0))
    words = f"580 to 1160 N, leave a life of {most:g} to {least:g} h; required: 300000 h"
    assert words in " ".join(said.split())
