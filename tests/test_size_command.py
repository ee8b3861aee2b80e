"""`rig size` as its users meet it: the worked axis of source 004, a spec of one's own, and what is refused."""

from __future__ import annotations

import math
import re
import tomllib
from importlib import resources

import msgspec
import numpy as np
import pytest

from planners.drives.ball_screw import Mounting
from planners.drives.motor import Motor
from planners.drives.screw_axis import Axis, Shares, Wishes
from planners.drives.screw_cycle import Cycle, Move
from planners.drives.screw_demand import AxisLoad, Transmission
from planners.drives.screw_region import region
from planners.drives.screw_supports import SUPPORTS
from rig.sizing import example_tables, file_tables, sizing_of
from rig.sizing_published import Comparison

SPEC = """
[axis]
mass_kg = 20.0
friction_coefficient = 0.02
[screw]
length_m = 1.0
support = "fixed-fixed"
[[move]]
stroke_m = 0.4
time_s = 1.0
[[move]]
stroke_m = -0.4
time_s = 1.0
law = "quintic"
rest_s = 0.5
"""
MY_SCREW = """
[[catalogue]]
name = "mine"
diameter_m = 0.025
lead_m = 0.025
dynamic_load_n = 12000.0
static_load_n = 20000.0
lead_class = "ISO 5"
origin = "measured"
"""


@pytest.fixture
def told(rig):
    """The document of `rig size ... --json` and the exit code, which must fit each other."""

    def call(*words, code=0):
        left, said, _ = rig("size", *words, "--json")
        assert left == code
        document = msgspec.json.decode(said)
        assert "NaN" not in said
        return document

    return call


@pytest.fixture
def spec(tmp_path):
    """Write a spec; gives its path. before is what must stand ahead of the first section."""

    def write(text=SPEC, before=""):
        path = tmp_path / "spec.toml"
        path.write_text(before + text)
        return path

    return write


def test_the_worked_axis_finds_that_its_unit_is_too_slow_and_too_coarse(told):
    document = told("--example", "appendix", code=3)
    assert (document["verdict"], document["admissible"], document["choice"]) == ("bad", False, "80V hp 20x20")
    checks = {row["name"]: row for row in document["checks"]}
    assert [name for name, row in checks.items() if row["state"] == "broken"] == ["speed of the unit", "lead class"]
    assert checks["speed of the unit"]["value"] == pytest.approx(0.3 / (0.33 * 0.67), rel=1e-12)
    assert checks["speed of the unit"]["bound"] == 1.0
    assert checks["whirling"]["margin"] == pytest.approx(0.00044684, rel=1e-4)
    assert len(document["reasons"]) == 2
    assert document["allowed_speed_m_s"] == 1.0
    times = [move["allowed_time_s"] for move in document["moves"]]
    assert times == pytest.approx([0.33 * 1.3568521, 0.33 * 1.2987013, 1.0], rel=1e-7)


def test_printed_and_right_figures_stand_side_by_side_and_every_difference_has_its_reason(told, rig):
    rows = told("--example", "appendix", code=3)["published"]
    wrong = {row["name"]: row for row in rows if row["differs"]}
    assert all(row["reason"] for row in wrong.values())
    assert wrong["equivalent_force_n"]["right"] == pytest.approx(82.164912, rel=1e-7)
    assert wrong["move_3.phase_2.duration_s"]["right"] == pytest.approx(0.55)
    assert "0.619 m" in wrong["move_3.phase_2.duration_s"]["reason"]
    cells = [row for row in rows if row["name"].endswith(("force_n", "torque_n_m")) and row["name"].startswith("move_")]
    assert len(cells) == 22
    assert not any(row["differs"] for row in cells)
    _, said, _ = rig("size", "--example", "appendix")
    assert re.search(r"equivalent_force_n +│ +84.841 │ +82.1649 │ ≠", said)
    assert "move_1.phase_1.force_n" not in said
    _, said, _ = rig("size", "--example", "appendix", "--published")
    assert re.search(r"move_1.phase_1.force_n +│ +151.292 │ +151.292 │", said)


@pytest.mark.parametrize(
    ("printed", "right", "differs"),
    [
        ("0.50", 0.5049, False),
        ("0.50", 0.5051, True),
        ("3.6e3", 3550.1, False),
        ("3.6e3", 3549.0, True),
        ("4073", 4072.4, True),
    ],
)
def test_a_figure_differs_when_the_right_one_does_not_round_to_its_digits(printed, right, differs):
    assert Comparison("x", printed, right, "").differs == differs


def test_the_catalogue_says_of_each_screw_what_it_breaks_and_where_its_figures_come_from(told, rig):
    rows = {row["name"]: row for row in told("--example", "appendix", code=3)["catalogue"]}
    assert [name for name, row in rows.items() if row["admissible"]] == ["20x20", "20x40", "25x25", "32x32"]
    slow = {check["name"]: check for check in rows["80V hp 20x5"]["broken"]}
    assert slow["whirling"]["value"] == pytest.approx(4 * 4070.5563, rel=1e-7)
    assert slow["whirling"]["bound"] == pytest.approx(4072.376, rel=1e-6)
    assert rows["20x20"]["undecided"] == ["dynamic load", "life", "static load", "lead class"]
    assert all(row["broken"] or row["admissible"] for row in rows.values())
    _, said, _ = rig("size", "--example", "appendix")
    assert "80V hp 20x5   20 x 5: breaks whirling 16282 > 4072.4 rpm (-300%)" in said
    assert "origin of 80V hp 20x5, 80V hp 20x20: source 004, fig. C.12" in said
    assert "confirm with the maker" in said


def test_only_the_source_s_units_have_load_ratings_and_every_entry_an_origin():
    entries = tomllib.loads((resources.files("rig") / "screws" / "catalogue.toml").read_text())["catalogue"]
    assert len({row["name"] for row in entries}) == len(entries)
    for row in entries:
        assert "source 004" in row["origin"] or "confirm with the maker" in row["origin"]
        assert ("dynamic_load_n" in row) == ("source 004" in row["origin"])


def test_another_entry_can_be_judged_and_its_open_checks_make_it_doubtful(told):
    document = told("--example", "appendix", "--entry", "25x25")
    assert (document["verdict"], document["admissible"]) == ("doubtful", True)
    assert len(document["reasons"]) == 4
    assert document["published"] == []
    assert document["allowed_by"] == "ball speed d n"


def test_a_spec_of_one_s_own_with_a_screw_of_one_s_own_fits_and_is_good(told, spec):
    document = told(spec(SPEC + MY_SCREW, before='choice = "mine"\n'))
    assert (document["verdict"], document["reasons"]) == ("good", [])
    assert document["figures"]["peak_speed_m_s"] == pytest.approx(1.875 * 0.4, rel=1e-12)  # the quintic law's
    acceleration = 10 / 3 * 3**0.5 * 0.4  # likewise
    assert document["figures"]["peak_force_n"] == pytest.approx(20 * (acceleration + 0.02 * 9.81), rel=1e-9)
    assert document["figures"]["life_h"] > 0
    assert next(row for row in document["checks"] if row["name"] == "life")["state"] == "not asked"


def test_every_key_of_a_spec_reaches_the_axis(spec):
    path = spec("""
[axis]
mass_kg = 1.5
slope_deg = 30
friction_coefficient = 0.2
force_n = 7.0
carried_kg = 0.5
[screw]
length_m = 1.25
support = "supported-supported"
free_length_m = 1.1
density_kg_m3 = 7700.0
youngs_modulus_pa = 210e9
shear_modulus_pa = 80e9
whirl_coefficient = 9.8
buckling_coefficient = 0.9
bearing_n_m = 1e8
nut_n_m = 2e8
[balls]
material = "ceramic"
limit_m_rpm = 200
[shares]
whirl = 0.8
buckling = 0.55
balls = 0.9
bandwidth = 0.6
service_factor = 1.4
[wishes]
life_h = 1000
lead_class = "ISO 3"
travel_deviation_m = 1e-5
position_error_m = 2e-5
angle_error_rad = 1e-3
sag_m = 1e-4
stiffness_n_m = 1e7
bandwidth_rad_s = 300
[transmission]
efficiency = 0.92
motor_inertia_kg_m2 = 1e-5
coupling_inertia_kg_m2 = 2e-5
drag_torque_n_m = 0.03
[motor]
continuous_torque_n_m = 1.0
peak_torque_n_m = 3.0
max_speed_rad_s = 400.0
peak_power_w = 700.0
[[move]]
stroke_m = 0.2
time_s = 0.5
lambda_acc = 0.2
lambda_dec = 0.4
rest_s = 0.3
durations_s = [0.1, 0.2, 0.2]
[[move]]
stroke_m = -0.2
time_s = 0.5
law = "cubic"
""")
    expected = Axis(
        mounting=Mounting(
            length_m=1.25,
            support=SUPPORTS["supported-supported"]._replace(whirl=9.8, buckling=0.9),
            free_length_m=1.1,
            density_kg_m3=7700.0,
            youngs_modulus_pa=210e9,
            shear_modulus_pa=80e9,
        ),
        load=AxisLoad(mass_kg=1.5, slope_rad=math.radians(30), friction_coefficient=0.2, force_n=7.0),
        cycle=Cycle(
            [
                Move(stroke_m=0.2, time_s=0.5, lambda_acc=0.2, lambda_dec=0.4, rest_s=0.3, durations_s=(0.1, 0.2, 0.2)),
                Move(stroke_m=-0.2, time_s=0.5, law="cubic"),
            ]
        ),
        transmission=Transmission(efficiency=0.92, motor_inertia_kg_m2=1e-5, coupling_inertia_kg_m2=2e-5, drag_torque_n_m=0.03),
        ball_limit_m_rpm=200.0,
        shares=Shares(whirl=0.8, buckling=0.55, balls=0.9, bandwidth=0.6, service_factor=1.4),
        wishes=Wishes(
            life_h=1000.0,
            lead_class="ISO 3",
            travel_deviation_m=1e-5,
            position_error_m=2e-5,
            angle_error_rad=1e-3,
            sag_m=1e-4,
            stiffness_n_m=1e7,
            bandwidth_rad_s=300.0,
        ),
        motor=Motor(continuous_torque_n_m=1.0, peak_torque_n_m=3.0, max_speed_rad_s=400.0, peak_power_w=700.0),
        bearing_n_m=1e8,
        nut_n_m=2e8,
        carried_kg=0.5,
    )
    assert sizing_of(file_tables(path)).axis == expected


def test_what_a_spec_leaves_out_is_what_the_axis_takes_by_itself(spec):
    axis = sizing_of(file_tables(spec())).axis
    assert (axis.shares, axis.wishes, axis.motor) == (Shares(), Wishes(), None)
    assert axis.mounting == Mounting(length_m=1.0, support=SUPPORTS["fixed-fixed"])
    assert axis.transmission == Transmission()
    assert axis.ball_limit_m_rpm == 70.0


def test_without_a_choice_the_catalogue_is_searched(told, spec):
    document = told(spec())
    assert document["choice"] is None
    assert document["admissible"] is None
    assert document["checks"] == []
    assert document["verdict"] == "doubtful"
    text = SPEC.replace("time_s = 1.0", "time_s = 0.05")
    document = told(spec(text), code=3)
    assert document["verdict"] == "bad"
    assert "no entry of the catalogue fits" in document["reasons"][0]


def test_a_spec_without_a_choice_is_told_as_tables_too(rig, spec):
    code, said, _ = rig("size", spec())
    assert code == 0
    assert "least lead of all screws" in said
    assert "phase by phase" not in said
    assert "verdict: fits as far as the catalogue tells" in said


@pytest.mark.parametrize("columns", [80, 120, 160])
def test_the_tables_fit_the_terminal(rig, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    _, said, _ = rig("size", "--example", "appendix", "--published")
    assert all(len(line.rstrip()) <= 80 for line in said.splitlines() if line.startswith(("┏", "┃", "│", "└")))


def test_the_chart_is_drawn_with_a_line_for_every_limit_that_is_asked(rig, spec, tmp_path):
    wishes = "[wishes]\nlife_h = 1e4\nsag_m = 5e-4\nposition_error_m = 2e-5\nangle_error_rad = 3e-3\nbandwidth_rad_s = 300\n"
    path = spec(SPEC + wishes + MY_SCREW, before='choice = "mine"\n')
    code, _, _ = rig("size", path, "--plot", "chart.svg")
    assert code == 0
    assert "<svg" in (tmp_path / "chart.svg").read_text()
    axis = sizing_of(file_tables(path)).axis
    names = [line.name for line in region(axis, np.array([0.02]), 12000.0).lines]
    assert names == ["whirling", "balls", "buckling", "life", "sag", "accuracy", "bandwidth"]


def test_the_example_s_region_is_bounded_by_the_crossing_that_the_document_tells(told):
    figures = told("--example", "appendix", code=3)["figures"]
    axis = sizing_of(example_tables("appendix")).axis
    spread = np.linspace(0.01, 0.04, 3001)
    low = region(axis, spread).low_m
    assert low.min() == pytest.approx(figures["lead_min_abs_m"], rel=3e-4)
    assert spread[low.argmin()] == pytest.approx(figures["diameter_at_lead_min_abs_m"], abs=1.1e-5)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass_kg = 20.0", "mass_kg = -20.0", ("mass_kg = -20.0", "must be")),
        ("mass_kg = 20.0", "", ("[axis] mass_kg", "missing")),
        ("mass_kg = 20.0", "mass_kg = nan", ("mass_kg = nan",)),
        ("mass_kg = 20.0", 'mass_kg = "20"', ("[axis] mass_kg = '20'",)),
        ("length_m = 1.0", "length_m = 0.3", ("travel = 0.4 m", "length_m = 0.3")),
        ("length_m = 1.0", "lenght_m = 1.0", ("[screw] lenght_m", "did you mean 'length_m'")),
        ('"fixed-fixed"', '"fixed-fix"', ("[screw] support", "did you mean 'fixed-fixed'")),
        ("stroke_m = -0.4", "stroke_m = -0.3", ("sum to 0.1 m", "add a move of -0.1 m")),
        ("stroke_m = -0.4", "stroke_m = 0.0", ("[[move]] 2", "stroke_m = 0")),
        ('law = "quintic"', 'law = "quintik"', ("[[move]] 2", "did you mean 'quintic'")),
        ('law = "quintic"', "lambda_acc = 0.7\nlambda_dec = 0.4", ("[[move]] 2", "lambda_acc + lambda_dec = 1.1")),
        ('law = "quintic"', "lamda_acc = 0.7", ("[move.2] lamda_acc", "did you mean 'lambda_acc'")),
        ('law = "quintic"', "durations_s = [0.3, 0.5, 0.2]", ("[[move]] 2", "durations_s", "must be 1 s and 0.4 m")),
        ("[axis]", '[balls]\nmaterial = "glas"\n[axis]', ("material of the balls = 'glas'", "ceramic, steel")),
        ("[axis]", "[balls]\nlimit_m_rpm = 300.0\n[axis]", ("limit_m_rpm of steel balls = 300.0", "70 to 120")),
        ("[axis]", '[wishes]\nlead_class = "ISO 2"\n[axis]', ("lead_class = 'ISO 2'", "did you mean 'ISO")),
        ("[axis]", "[motor]\npeak_torque_n_m = 1.0\n[axis]", ("[motor]", "missing")),
        ("[axis]", 'choice = "80V hp 20x2"\n[axis]', ("choice = '80V hp 20x2'", "did you mean '80V hp 20x20'")),
        ("[axis]", '[published]\npeak_spead_m_s = { printed = "1" }\n[axis]', ("did you mean 'peak_speed_m_s'",)),
        ("[axis]", '[published]\npeak_speed_m_s = { printed = "fast" }\n[axis]', ("printed = 'fast'", "digits")),
        ("[axis]", '[published]\npeak_speed_m_s = { print = "1" }\n[axis]', ("did you mean 'printed'",)),
        ("[axis]", '[[catalogue]]\nname = "20x20"\ndiameter_m = 0.02\nlead_m = 0.02\norigin = ""\n[axis]', ("twice",)),
        (
            "[axis]",
            '[[catalogue]]\nname = "x"\ndiameter_m = -0.02\nlead_m = 0.02\norigin = ""\n[axis]',
            ("[[catalogue]] x: diameter_m = -0.02",),
        ),
        ("[axis]", '[[catalogue]]\nname = "x"\nlead_m = 0.02\norigin = ""\n[axis]', ("diameter_m: missing",)),
        ("[axis]", "[axis", ("not valid TOML",)),
    ],
)
def test_a_spec_without_sense_is_refused_by_name_and_in_json_too(rig, spec, old, new, words):
    text = SPEC.replace(old, new)
    assert text != SPEC
    code, said, complaint = rig("size", spec(text))
    assert (code, said) == (2, "")
    assert all(word in complaint for word in words), complaint
    code, said, _ = rig("size", spec(text), "--json")
    document = msgspec.json.decode(said)
    assert (code, document["exit_code"], document["verdict"]) == (2, 2, "bad")
    assert all(word in document["reasons"][0] for word in words)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), ("SPEC.toml: missing", "--example appendix")),
        (("--example", "apendix"), ("did you mean 'appendix'",)),
        (("spec.toml", "--example", "appendix"), ("one of the two",)),
        (("nowhere.toml",), ("nowhere.toml",)),
        (("--example", "appendix", "--entry", "20x2"), ("--entry", "did you mean '20x20'")),
        (("--example", "appendix", "--plot", "chart.gif"), (".svg",)),
    ],
)
def test_options_without_sense_are_refused_by_name(rig, words, said):
    code, _, complaint = rig("size", *words)
    assert code == 2
    assert all(word in complaint for word in said), complaint


def test_the_verb_explains_itself(rig):
    code, said, _ = rig("size", "--help")
    assert code == 0
    assert all(word in said for word in ("Usage", "--example", "--json", "--plot", "--entry"))
