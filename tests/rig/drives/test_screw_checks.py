"""Checks of a screw, the admissible region, and invalid data."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.errors import PlanError
from rig.drives.motor import Motor
from rig.drives.screw import digits
from rig.drives.screw.balls import Balls
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.checks import allowed_speed, assess
from rig.drives.screw.cycle import Cycle, Move
from rig.drives.screw.lead_classes import LEAD_CLASSES, TABULATED, lead_class, travel_deviation_m
from rig.drives.screw.load import AxisLoad
from rig.drives.screw.region import region
from rig.drives.screw.requirements import Requirements, Utilisation
from rig.drives.screw.shaft import Mounting
from rig.drives.screw.supports import SUPPORTS
from rig.drives.screw.transmission import Transmission
from rig.drives.screw.verdict import NOT_ASKED, UNDECIDED, LimitCheck
from rig.studies.sizing.axis_file import example_tables, sizing_of

SIZING = sizing_of(example_tables("appendix"))
AXIS, UNIT = replace(SIZING.axis, motor=None), SIZING.choice
MOVES = tuple(replace(move, durations_s=None) for move in AXIS.cycle.moves)
SCREW = UNIT.screw(AXIS.mounting)


def to_and_fro(**move):
    """Build a cycle of one law there and back."""
    there = Move(**move)
    return Cycle((there, replace(there, stroke_m=-there.stroke_m)))


def by_name(found):
    return {check.name: check for check in found.checks}


def test_the_chosen_unit_is_too_slow_and_too_coarse_and_the_rest_holds():
    found = assess(AXIS, UNIT)
    assert [check.name for check in found.broken] == ["speed of the unit", "lead class"]
    assert not found.undecided
    checks = by_name(found)
    assert checks["speed of the unit"].value == pytest.approx(1.3568521, rel=1e-7)
    assert checks["speed of the unit"].margin == pytest.approx(1 - 1.3568521, rel=1e-6)
    reason = checks["speed of the unit"].reason
    assert "must be <= 1 m/s" in reason
    assert (
        "move 1 reaches 1.357 m/s in 0.33 s and needs 0.4478 s; move 2 reaches 1.299 m/s" in reason
    )
    assert "move 3" not in reason
    assert (
        "lead class 52 µm per 300 mm; must be <= 23 µm per 300 mm: ISO 7 is coarser"
        in checks["lead class"].reason
    )
    assert checks["whirling"].margin == pytest.approx(4.47e-4, rel=1e-3)
    assert checks["static load"].value == pytest.approx(1.2 * 157.8778, rel=1e-6)
    assert allowed_speed(AXIS, found) == (1.0, "speed of the unit")


def test_the_unit_keeps_its_speed_with_the_times_that_the_check_names():
    moves = tuple(replace(move, time_s=move.time_at(1.0)) for move in MOVES)
    assert [move.time_s for move in moves] == pytest.approx([0.3 / 0.67, 0.3 / 0.7, 1.0])
    found = assess(replace(AXIS, cycle=Cycle(moves)), replace(UNIT, lead_class="ISO 5"))
    assert found.admissible
    assert found.tightest.name == "speed of the unit"
    assert found.tightest.margin == pytest.approx(0.0, abs=1e-12)


def test_checks_without_catalogue_data_are_undecided_and_unrequired_ones_have_no_bound():
    bare = CatalogueEntry(name="20x20", diameter_m=0.02, lead_m=0.02, origin="a guess")
    found = assess(AXIS, bare)
    assert found.admissible
    assert [check.name for check in found.undecided] == ["dynamic load", "life", "lead class"]
    assert "ask the maker for ISO 5 or a finer one" in found.undecided[2].reason
    states = {check.name: check.state for check in found.checks}
    assert (
        states["sag"]
        == states["motor power"]
        == states["static load"]
        == states["speed of the unit"]
        == NOT_ASKED
    )
    unbounded = assess(replace(AXIS, requirements=Requirements()), bare)
    assert not unbounded.undecided


def test_every_requirement_can_be_the_one_that_a_screw_breaks():
    def broken(**requirements):
        return [
            check.name
            for check in assess(
                replace(AXIS, requirements=Requirements(**requirements)), good
            ).broken
        ]

    good = replace(UNIT, speed_m_s=2.0, lead_class="ISO 5")
    assert broken() == []
    assert broken(sag_m=3e-5) == ["sag"]
    assert broken(stiffness_n_m=6e7) == ["stiffness"]
    assert broken(bandwidth_rad_s=1105.0) == ["bandwidth"]
    assert broken(bandwidth_rad_s=1104.0) == []
    assert broken(position_error_m=1e-5, angle_error_rad=3.2e-3) == ["lead for accuracy"]
    assert broken(life_h=1.5e7) == ["dynamic load", "life"]
    assert broken(lead_class="ISO 3") == ["lead class"]


def test_the_dynamic_load_and_the_life_fail_together():
    hours = by_name(assess(AXIS, UNIT))["life"].value
    for factor, kept in ((1 - 1e-9, True), (1 + 1e-6, False)):
        checks = by_name(
            assess(replace(AXIS, requirements=Requirements(life_h=hours * factor)), UNIT)
        )
        assert (checks["life"].state == "kept", checks["dynamic load"].state == "kept") == (
            kept,
            kept,
        )


def test_the_deviation_over_the_travel_is_that_of_the_table_and_beyond_it_undecided():
    short = replace(
        AXIS,
        cycle=to_and_fro(stroke_m=0.35, time_s=1.0),
        requirements=Requirements(travel_deviation_m=20e-6),
    )
    fine = replace(UNIT, lead_class="ISO 3")
    assert by_name(assess(short, fine))["lead over the travel"].value == pytest.approx(13.0)
    assert by_name(assess(short, replace(UNIT, lead_class="ISO 5")))[
        "lead over the travel"
    ].margin == pytest.approx(-0.25)
    far = by_name(assess(replace(AXIS, requirements=Requirements(travel_deviation_m=20e-6)), fine))[
        "lead over the travel"
    ]
    assert far.state == UNDECIDED
    assert "no deviation of ISO 3 over 0.6 m" in far.reason


def test_a_unit_must_be_as_long_as_the_travel():
    for stroke, broken in ((0.6, []), (0.599, ["stroke of the unit"])):
        found = assess(AXIS, replace(UNIT, stroke_m=stroke, speed_m_s=2.0, lead_class="ISO 5"))
        assert [check.name for check in found.broken] == broken


def test_a_class_outside_the_table_has_a_note_though_no_class_is_required():
    unbounded = replace(AXIS, requirements=Requirements())
    found = by_name(assess(unbounded, UNIT))["lead class"]
    assert (found.state, found.value, found.bound) == (NOT_ASKED, pytest.approx(52.0), None)
    assert (
        found.note == "ISO 7 is outside the classes that source 004 tabulates, ISO 1, ISO 3, ISO 5"
    )
    assert by_name(assess(unbounded, replace(UNIT, lead_class="ISO 3")))["lead class"].note == ""


def test_the_dynamic_load_to_ask_for_reaches_the_life():
    bare = CatalogueEntry(
        name="20x20", diameter_m=0.02, lead_m=0.02, origin="a guess", preload_n=580.0
    )
    reason = by_name(assess(AXIS, bare))["life"].reason
    load = float(re.search(r"ask the maker for ([0-9.]+) N or more", reason)[1])
    assert by_name(assess(AXIS, replace(bare, dynamic_load_n=load)))["life"].state == "kept"
    assert (
        by_name(assess(AXIS, replace(bare, dynamic_load_n=0.999 * load)))["life"].state == "broken"
    )


@pytest.mark.parametrize(
    ("values", "unit", "text"),
    [
        ((4070.5563, 4072.376), "rpm", (["4070.56", "4072.38"], "rpm")),
        ((4070.5563, 5000.0), "rpm", (["4071", "5000"], "rpm")),
        ((81.411126, 96.0), "m rpm", (["81410", "96000"], "mm rpm")),
        ((5.1976e7, None), "N/m", (["51.98", ""], "N/µm")),
        ((3.34344e-5, 3.34344e-5), "m", (["0.03343", "0.03343"], "mm")),
        ((math.inf, 1.402271e7), "h", (["inf", "1.402e+07"], "h")),
    ],
)
def test_numbers_have_four_digits_unless_those_hide_a_difference_and_the_units_of_the_field(
    values, unit, text
):
    assert digits.shown(values, unit) == text


def test_a_margin_is_a_share_of_the_bound_whichever_side_is_the_safe_one():
    for value, margin in ((50.0, 0.5), (100.0, 0.0), (130.0, -0.3)):
        assert LimitCheck("", value, 100.0, "").margin == pytest.approx(margin)
        assert LimitCheck("", 200.0 - value, 100.0, "", at_least=True).margin == pytest.approx(
            margin
        )


def test_an_entry_with_complete_data_ranks_before_one_with_undecided_checks():
    loose = replace(AXIS, requirements=Requirements(life_h=1000.0))
    complete = assess(loose, replace(UNIT, speed_m_s=None))
    bare = assess(loose, replace(UNIT, speed_m_s=None, lead_m=0.025, dynamic_load_n=None))
    refused = assess(loose, UNIT)
    assert complete.tightest.margin < bare.tightest.margin
    assert sorted((refused, bare, complete), key=lambda a: a.rank) == [complete, bare, refused]


def test_an_admissible_entry_ranks_before_a_broken_one_and_a_larger_margin_before_a_smaller_one():
    fits = assess(AXIS, replace(UNIT, speed_m_s=None, lead_class="ISO 5"))
    better = assess(AXIS, replace(UNIT, speed_m_s=None, lead_class="ISO 5", lead_m=0.025))
    worse = assess(AXIS, replace(UNIT, lead_class="ISO 5"))
    assert sorted((worse, fits, better), key=lambda a: a.rank) == [better, fits, worse]


def test_a_motor_is_judged_like_any_other_limit():
    small = Motor(
        continuous_torque_n_m=0.5, peak_torque_n_m=1.0, max_speed_rad_s=400.0, peak_power_w=460.0
    )
    found = assess(replace(AXIS, motor=small), replace(UNIT, speed_m_s=2.0, lead_class="ISO 5"))
    assert [check.name for check in found.broken] == [
        "motor torque, peak", "motor torque, rms", "motor speed", "motor power",
    ]  # fmt: skip
    assert "move 1 reaches 1.357 m/s in 0.33 s and needs" in by_name(found)["motor speed"].reason


def test_classes_are_ordered_and_the_table_covers_half_a_metre():
    bands = [row.per_300_mm_m for row in LEAD_CLASSES.values()]
    assert bands == sorted(bands)
    for name in TABULATED:
        assert travel_deviation_m(name, 0.5) is not None
        assert travel_deviation_m(name, 0.5001) is None
    assert travel_deviation_m("ISO 7", 0.1) is None
    with pytest.raises(
        PlanError,
        match="lead_class = 'ISO 8'; must be one of ISO 1, ISO 3, ISO 5, ISO 7, ISO 10, from fine "
        "to coarse: take the next finer one",
    ):
        lead_class("ISO 8")


# the region

REQUIREMENTS = Requirements(
    life_h=3e8,
    sag_m=5e-5,
    position_error_m=1e-5,
    angle_error_rad=1.5e-3,
    stiffness_n_m=4e7,
    bandwidth_rad_s=1000.0,
)


@pytest.mark.parametrize(
    ("line", "check"),
    [
        ("whirling", "whirling"),
        ("balls", "ball speed d n"),
        ("buckling", "buckling"),
        ("life", "life"),
        ("sag", "sag"),
        ("accuracy", "lead for accuracy"),
        ("stiffness", "stiffness"),
        ("bandwidth", "bandwidth"),
    ],
)
def test_a_screw_on_a_limit_curve_has_a_margin_of_0(line, check):
    axis = replace(AXIS, requirements=REQUIREMENTS, bearing_n_m=2e8, nut_n_m=2.5e8, carried_kg=2.0)
    spread = np.array([0.018, 0.022, 0.03])
    found = next(row for row in region(axis, spread, UNIT).lines if row.name == line)
    points = (
        zip(spread, found.lead_m, strict=True)
        if found.diameter_m is None
        else [(found.diameter_m, 0.02)]
    )
    tried = 0
    for d, p in points:
        if 0.0 < p < 1.0:
            margin = by_name(assess(axis, replace(UNIT, diameter_m=float(d), lead_m=float(p))))[
                check
            ].margin
            assert margin == pytest.approx(0.0, abs=1e-9)
            tried += 1
    assert tried


@settings(max_examples=40)
@given(st.floats(0.004, 0.05), st.floats(0.002, 0.06))
def test_a_screw_within_the_region_keeps_every_limit_that_has_a_line(d, p):
    axis = replace(AXIS, requirements=replace(REQUIREMENTS, life_h=3e7))
    here = region(axis, np.array([d]), UNIT)
    inside = bool(here.low_m[0] <= p <= here.high_m[0])
    checks = by_name(
        assess(axis, replace(UNIT, diameter_m=d, lead_m=p, speed_m_s=None, lead_class="ISO 5"))
    )
    lined = (
        "whirling",
        "ball speed d n",
        "buckling",
        "life",
        "sag",
        "lead for accuracy",
        "stiffness",
        "bandwidth",
    )
    worst = min(checks[name].margin for name in lined)
    if abs(worst) > 1e-9:
        assert inside == (worst > 0.0)


# what is refused


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Mounting(length_m=-0.8), r"length_m = -0\.8; must be 0\.0001 to 100: measure"),
        (lambda: Mounting(length_m=math.nan), "length_m = nan"),
        (
            lambda: Mounting(length_m=1.0, youngs_modulus_pa=200.0),
            r"youngs_modulus_pa = 200\.0; must be 1e\+08 to",
        ),
        (lambda: Mounting(length_m=1.0, free_length_m=0.0), "free_length_m = 0.0; must be"),
        (
            lambda: Mounting(length_m=1.0, free_length_m=1.1),
            r"free_length_m = 1\.1; must be 0\.0001 to 1: give the part",
        ),
        (
            lambda: Mounting(
                length_m=1.0, support=SUPPORTS["fixed-supported"]._replace(whirl=-1.0)
            ),
            r"support whirl = -1\.0; must be",
        ),
        (
            lambda: replace(SCREW, diameter_m=20.0),
            r"diameter_m = 20\.0; must be 0\.0001 to 10: give it in metres",
        ),
        (lambda: replace(SCREW, lead_m=-0.02), r"lead_m = -0\.02; must be"),
        (lambda: Move(stroke_m=0.0, time_s=1.0), "stroke_m = 0; must not be 0: leave the move out"),
        (lambda: Move(stroke_m=1.0, time_s=0.0), r"time_s = 0\.0; must be"),
        (lambda: Move(stroke_m=1.0, time_s=1.0, rest_s=-1.0), r"rest_s = -1\.0; must be 0 to"),
        (
            lambda: Move(stroke_m=1.0, time_s=1.0, lambda_acc=0.6, lambda_dec=0.5),
            r"lambda_acc \+ lambda_dec = 1\.1; must be <= 1",
        ),
        (lambda: Move(stroke_m=1.0, time_s=1.0, lambda_acc=0.0), r"lambda_acc = 0\.0; must be"),
        (
            lambda: Move(stroke_m=1.0, time_s=1.0, law="cubik"),
            "law = 'cubik'; did you mean 'cubic'",
        ),
        (
            lambda: Move(stroke_m=1.0, time_s=1.0, law="cubic", lambda_acc=0.3),
            "lambda_acc with law = 'cubic'; must be",
        ),
        (
            lambda: Move(stroke_m=1.0, time_s=1.0, durations_s=(0.5, 0.5)),
            r"durations_s = \[0\.5, 0\.5\]; must be three",
        ),
        (
            lambda: replace(MOVES[2], durations_s=(0.2, 0.6, 0.2)),
            r"cover 0\.6194 m at 0\.7742 m/s; must be 1 s and 0\.6 m: lambda_acc = 0\.2 and "
            r"lambda_dec = 0\.25 give 0\.2, 0\.55, 0\.25",
        ),
        (
            lambda: replace(MOVES[2], durations_s=(0.4, 0.45, 0.25)),
            r"last 1\.1 s and cover 0\.6 m at .*must be 1 s",
        ),
        (
            lambda: replace(MOVES[0], durations_s=(0.1, 0.1, 0.1)),
            r"last 0\.3 s and cover .*must be 0\.33 s",
        ),
        (lambda: Cycle(()), "a cycle of 0 moves; must be >= 2"),
        (
            lambda: Cycle(MOVES[:2]),
            r"strokes 0\.3, 0\.3 m sum to 0\.6 m; must be 0, .* add a move of -0\.6 m",
        ),
        (lambda: AxisLoad(mass_kg=-1.0), r"mass_kg = -1\.0; must be"),
        (lambda: AxisLoad(mass_kg=1.0, slope_rad=2.0), r"slope_rad = 2\.0; must be"),
        (
            lambda: AxisLoad(mass_kg=1.0, friction_coefficient=-0.1),
            r"friction_coefficient = -0\.1; must be 0 to",
        ),
        (lambda: Transmission(efficiency=1.1), r"efficiency = 1\.1; must be 0\.001 to 1"),
        (lambda: Transmission(motor_inertia_kg_m2=-1.0), r"motor_inertia_kg_m2 = -1\.0; must be"),
        (lambda: Utilisation(whirl=1.5), r"whirl = 1\.5; must be 0\.01 to 1"),
        (lambda: Utilisation(service_factor=0.5), r"service_factor = 0\.5; must be 1 to 10"),
        (lambda: Requirements(lead_class="ISO 6"), "lead_class = 'ISO 6'; must be one of ISO 1"),
        (lambda: Requirements(life_h=-1.0), r"life_h = -1\.0; must be"),
        (
            lambda: Requirements(position_error_m=1e-5),
            "position_error_m = 1e-05 with angle_error_rad = None; must be given together",
        ),
        (lambda: replace(UNIT, dynamic_load_n=0.0), r"dynamic_load_n = 0\.0; must be"),
        (lambda: replace(UNIT, lead_class="7"), "lead_class = '7'; .*must be one of ISO 1"),
        (
            lambda: replace(AXIS, mounting=Mounting(length_m=0.5)),
            r"travel = 0\.6 m on a screw of length_m = 0\.5; must be",
        ),
        (lambda: replace(AXIS, bearing_n_m=-1.0), r"bearing_n_m = -1\.0; must be"),
        (
            lambda: replace(AXIS, mounting=Mounting(length_m=0.6)),
            r"travel = 0\.6 m on a screw of length_m = 0\.6; must be",
        ),
        (lambda: replace(AXIS, carried_kg=-1.0), r"carried_kg = -1\.0; must be"),
        (lambda: Balls(material="cermic"), "material = 'cermic'; did you mean 'ceramic'"),
        (lambda: Balls(limit_m_rpm=0.0), r"limit_m_rpm = 0\.0; must be"),
        (lambda: Transmission(hold="break"), "hold = 'break'; did you mean 'brake'"),
        (lambda: Utilisation(preload=0.6), r"preload = 0\.6; must be 0 to 0\.5"),
        (
            lambda: Requirements(sag_m=0.0),
            r"sag_m = 0\.0; must be .*: leave it out where nothing is required",
        ),
        (lambda: replace(UNIT, name=" "), "name = ' '; must not be empty"),
        (lambda: replace(UNIT, preload_n=-1.0), r"preload_n = -1\.0; must be"),
        (lambda: replace(UNIT, limit_m_rpm=0.0), r"limit_m_rpm = 0\.0; must be"),
        (
            lambda: replace(UNIT, core_diameter_m=0.021),
            r"core_diameter_m = 0\.021; must be 0\.0001 to 0\.02",
        ),
        (lambda: replace(UNIT, ball_circle_m=0.0), r"ball_circle_m = 0\.0; must be"),
    ],
)
def test_invalid_data_are_refused_by_name_value_and_bound(call, words):
    with pytest.raises(PlanError, match=words):
        call()
