"""`rig size`: the worked axis of source 004, other sizing files, and refusals."""

from __future__ import annotations

import math
import re
import tomllib
from importlib import resources

import msgspec
import numpy as np
import pytest

from rig.drives.motor import Motor
from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.balls import Balls
from rig.drives.screw.cycle import Cycle, Move
from rig.drives.screw.load import AxisLoad
from rig.drives.screw.region import region
from rig.drives.screw.requirements import Requirements, Utilisation
from rig.drives.screw.shaft import Mounting
from rig.drives.screw.supports import SUPPORTS
from rig.drives.screw.transmission import Transmission
from rig.run.toml_file import read_toml
from rig.studies.sizing.axis_file import example_tables, sizing_of
from rig.studies.sizing.published import FigureComparison

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
    """JSON document of `rig size`, which must end with the expected exit code."""

    def call(*words, code=0):
        left, said, _ = rig("size", *words, "--json")
        assert left == code
        document = msgspec.json.decode(said)
        assert "NaN" not in said
        return document

    return call


@pytest.fixture
def spec(tmp_path):
    """Function that writes a sizing file, `before` ahead of its first section; gives its path."""

    def write(text=SPEC, before=""):
        path = tmp_path / "spec.toml"
        path.write_text(before + text)
        return path

    return write


def test_the_worked_axis_finds_that_its_unit_is_too_slow_and_too_coarse(told):
    document = told("--example", "appendix", code=3)
    assert (document["verdict"], document["admissible"], document["choice"]) == (
        "bad",
        False,
        "80V hp 20x20",
    )
    checks = {row["name"]: row for row in document["checks"]}
    assert [name for name, row in checks.items() if row["state"] == "broken"] == [
        "speed of the unit",
        "lead class",
    ]
    assert checks["speed of the unit"]["value"] == pytest.approx(0.3 / (0.33 * 0.67), rel=1e-12)
    assert checks["speed of the unit"]["bound"] == 1.0
    assert checks["whirling"]["margin"] == pytest.approx(0.00044684, rel=1e-4)
    assert len(document["reasons"]) == 2
    assert document["allowed_speed_m_s"] == 1.0
    times = [move["allowed_time_s"] for move in document["moves"]]
    assert times == pytest.approx([0.33 * 1.3568521, 0.33 * 1.2987013, 1.0], rel=1e-7)


def test_printed_and_right_figures_stand_side_by_side_and_every_difference_has_its_reason(
    told, rig
):
    rows = told("--example", "appendix", code=3)["published"]
    wrong = {row["name"]: row for row in rows if row["differs"]}
    assert all(row["reason"] for row in wrong.values())
    assert wrong["equivalent_force_n"]["right"] == pytest.approx(82.164912, rel=1e-7)
    assert wrong["move_3.phase_2.duration_s"]["right"] == pytest.approx(0.55)
    assert "0.619 m" in wrong["move_3.phase_2.duration_s"]["reason"]
    cells = [
        row
        for row in rows
        if row["name"].endswith(("force_n", "torque_n_m")) and row["name"].startswith("move_")
    ]
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
    assert FigureComparison("x", printed, right, "").differs == differs


def test_the_catalogue_lists_violated_limits_and_origin_of_each_screw(told, rig):
    rows = {row["name"]: row for row in told("--example", "appendix", code=3)["catalogue"]}
    assert [name for name, row in rows.items() if row["admissible"]] == [
        "20x40",
        "25x25",
        "32x32",
        "20x20",
    ]
    slow = {check["name"]: check for check in rows["80V hp 20x5"]["broken"]}
    assert slow["whirling"]["value"] == pytest.approx(4 * 4070.5563, rel=1e-7)
    assert slow["whirling"]["bound"] == pytest.approx(4072.376, rel=1e-6)
    assert rows["20x20"]["undecided"] == ["dynamic load", "life", "lead class"]
    assert all(row["broken"] or row["admissible"] for row in rows.values())
    _, said, _ = rig("size", "--example", "appendix", "--all")
    assert "80V hp 20x5 20 x 5: violates whirling 16280 > 4072 rpm (-300%)" in " ".join(
        said.split()
    )
    assert "origin of 80V hp 20x20, 80V hp 20x5: source 004, fig. C.12" in " ".join(said.split())
    others = (
        "origin of all others: size of the kind ISO 3408-2 lists: typical, general knowledge; "
        "confirm with the maker"
    )
    assert others in " ".join(said.split())


def test_the_values_of_rejected_entries_are_listed_on_demand_only(rig):
    said = " ".join(rig("size", "--example", "appendix")[1].split())
    assert (
        "17 not admissible (--all lists the values): 25x20 (ball speed), "
        "32x20 (ball speed, motor torque), " in said
    )
    assert "12x5 (whirling, ball speed, motor speed)" in said
    assert " violates " not in said
    assert "not admissible (" not in rig("size", "--example", "appendix", "--all")[1]


def test_a_margin_beyond_1000_percent_is_shown_as_a_bound(told, rig, spec):
    path = spec(SPEC.replace("length_m = 1.0", "length_m = 6.0"))
    worst = min(row["margin"] for row in told(path, code=3)["catalogue"])
    assert worst < -10.0
    _, said, _ = rig("size", path, "--all")
    assert "(< -1000%)" in said
    assert not re.search(r"-\d{4,}%", said.replace("< -1000%", ""))


def test_the_catalogue_is_listed_best_first(told, rig):
    rows = told("--example", "appendix", code=3)["catalogue"]
    keys = [(not row["admissible"], -row["margin"]) for row in rows]
    assert keys == sorted(keys)
    _, said, _ = rig("size", "--example", "appendix", "--all")
    places = [said.index(f"  {row['name']} ") for row in rows]
    assert places == sorted(places)


def test_the_document_has_the_motion_law_table_as_rows(told):
    document = told("--example", "appendix", code=3)
    rows = {(row["move"], row["phase"]): row for row in document["motion"]}
    assert len(rows) == len(document["motion"]) == 11
    assert rows[1, 1]["force_n"] == pytest.approx(151.292, abs=5e-4)
    assert rows[2, 1]["peak_torque_n_m"] == pytest.approx(document["figures"]["peak_torque_n_m"])
    assert rows[1, 3]["peak_power_w"] == pytest.approx(-375.84, abs=5e-3)  # the load drives
    assert not any(name.startswith("move_") for name in document["figures"])
    figures = document["figures"]
    assert figures["preload_low_n"] == pytest.approx(0.05 * 11600)
    assert figures["preload_high_n"] == pytest.approx(0.1 * 11600)
    assert figures["bandwidth_low_rad_s"] == pytest.approx(0.5 * figures["antiresonance_rad_s"])
    assert figures["bandwidth_high_rad_s"] == pytest.approx(0.7 * figures["antiresonance_rad_s"])
    checks = {row["name"]: row["value"] for row in document["checks"]}
    assert figures["driving_power_w"] == checks["motor power"] > figures["braking_power_w"]


def test_a_remark_gives_the_critical_speed_of_a_thinner_core(rig, spec):
    said = " ".join(rig("size", "--example", "appendix")[1].split())
    assert (
        "one of 0.9 d, 18 mm, has a critical speed of 3665 in place of 4072 rpm, "
        "too low for 4071 rpm: give core" in said
    )
    assert "too low" not in rig("size", "--example", "appendix", "--entry", "20x40")[1]
    cored = MY_SCREW.replace("lead_m", "core_diameter_m = 0.0223\nlead_m")
    _, said, _ = rig("size", spec(SPEC + cored, before='choice = "mine"\n'))
    assert "the core is taken" not in said


def test_an_unusual_ball_speed_limit_is_accepted_with_a_remark(rig, told, spec):
    text = SPEC + "[balls]\nlimit_m_rpm = 150\n"
    assert {row["name"]: row for row in told(spec(text))["checks"]}["ball speed d n"][
        "bound"
    ] == 150.0
    _, said, _ = rig("size", spec(text))
    assert "d n of 150000 mm rpm is outside the usual 70000 to 120000 of steel balls" in said
    assert "d n of" not in rig("size", spec())[1]


def test_equal_moves_are_listed_once(rig, told, spec):
    there, back = SPEC.split("[[move]]")[1:]
    path = spec(SPEC + 9 * f"[[move]]{there}[[move]]{back}")
    document = told(path)
    assert (len(document["moves"]), len(document["motion"])) == (20, 50)
    _, said, _ = rig("size", path)
    assert "equal moves once" in said
    assert re.search(r"│ +2\.0 │", said)
    assert not re.search(r"│ +3\.1 │", said)
    assert "move 1 and 9 like it reaches" in rig("size", path, "--entry", "80V hp 20x5")[1]


def test_missing_data_make_the_verdict_doubtful_only_for_a_requirement(told, spec):
    assert told(spec(SPEC), "--entry", "25x25")["verdict"] == "good"
    doubtful = told(spec(SPEC + "[requirements]\nlife_h = 1000\n"), "--entry", "25x25")
    assert doubtful["verdict"] == "doubtful"
    assert [reason.partition(":")[0] for reason in doubtful["reasons"]] == ["dynamic load", "life"]
    with_one_that_tells = told(spec(SPEC + MY_SCREW + "[requirements]\nlife_h = 1000\n"))
    assert with_one_that_tells["verdict"] == "good"


def test_every_key_of_an_entry_reaches_the_candidate(spec):
    keys = [
        "static_load_n",
        "preload_n",
        "core_diameter_m",
        "ball_circle_m",
        "limit_m_rpm",
        "speed_m_s",
        "stroke_m",
    ]
    values = dict(zip(keys, (2e4, 600.0, 0.022, 0.026, 130.0, 1.5, 0.9), strict=True))
    lines = "".join(
        f"{name} = {value}\n" for name, value in values.items() if name != "static_load_n"
    )
    choice = sizing_of(
        read_toml(spec(SPEC + MY_SCREW + lines, before='choice = "mine"\n'), "sizing")
    ).choice
    assert {name: getattr(choice, name) for name in keys} == values
    assert (choice.dynamic_load_n, choice.lead_class, choice.origin) == (
        12000.0,
        "ISO 5",
        "measured",
    )


def test_only_the_source_s_units_have_load_ratings_and_every_entry_an_origin():
    entries = tomllib.loads(
        (resources.files("rig.studies.sizing") / "screws" / "catalogue.toml").read_text()
    )["catalogue"]
    assert len({row["name"] for row in entries}) == len(entries)
    for row in entries:
        assert "source 004" in row["origin"] or "confirm with the maker" in row["origin"]
        assert ("dynamic_load_n" in row) == ("source 004" in row["origin"])


def test_another_entry_can_be_judged_and_its_open_checks_make_it_doubtful(told):
    document = told("--example", "appendix", "--entry", "25x25")
    assert (document["verdict"], document["admissible"]) == ("doubtful", True)
    assert len(document["reasons"]) == 3
    assert document["published"] == []
    assert document["allowed_by"] == "ball speed d n"


def test_a_sizing_file_with_its_own_screw_is_good(told, spec):
    document = told(spec(SPEC + MY_SCREW, before='choice = "mine"\n'))
    assert (document["verdict"], document["reasons"]) == ("good", [])
    assert document["figures"]["peak_speed_m_s"] == pytest.approx(
        1.875 * 0.4, rel=1e-12
    )  # the quintic law's
    acceleration = 10 / 3 * 3**0.5 * 0.4  # likewise
    assert document["figures"]["peak_force_n"] == pytest.approx(
        20 * (acceleration + 0.02 * 9.81), rel=1e-9
    )
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
[utilisation]
whirl = 0.8
buckling = 0.55
balls = 0.9
bandwidth = 0.6
service_factor = 1.4
preload = 0.06
[requirements]
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
hold = "brake"
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
    expected = AxisSpec(
        mounting=Mounting(
            length_m=1.25,
            support=SUPPORTS["supported-supported"]._replace(whirl=9.8, buckling=0.9),
            free_length_m=1.1,
            density_kg_m3=7700.0,
            youngs_modulus_pa=210e9,
            shear_modulus_pa=80e9,
        ),
        load=AxisLoad(
            mass_kg=1.5, slope_rad=math.radians(30), friction_coefficient=0.2, force_n=7.0
        ),
        cycle=Cycle(
            [
                Move(
                    stroke_m=0.2,
                    time_s=0.5,
                    lambda_acc=0.2,
                    lambda_dec=0.4,
                    rest_s=0.3,
                    durations_s=(0.1, 0.2, 0.2),
                ),
                Move(stroke_m=-0.2, time_s=0.5, law="cubic"),
            ]
        ),
        transmission=Transmission(
            efficiency=0.92,
            motor_inertia_kg_m2=1e-5,
            coupling_inertia_kg_m2=2e-5,
            drag_torque_n_m=0.03,
            hold="brake",
        ),
        balls=Balls(material="ceramic", limit_m_rpm=200.0),
        utilisation=Utilisation(
            whirl=0.8, buckling=0.55, balls=0.9, bandwidth=0.6, service_factor=1.4, preload=0.06
        ),
        requirements=Requirements(
            life_h=1000.0,
            lead_class="ISO 3",
            travel_deviation_m=1e-5,
            position_error_m=2e-5,
            angle_error_rad=1e-3,
            sag_m=1e-4,
            stiffness_n_m=1e7,
            bandwidth_rad_s=300.0,
        ),
        motor=Motor(
            continuous_torque_n_m=1.0,
            peak_torque_n_m=3.0,
            max_speed_rad_s=400.0,
            peak_power_w=700.0,
        ),
        bearing_n_m=1e8,
        nut_n_m=2e8,
        carried_kg=0.5,
    )
    assert sizing_of(read_toml(path, "sizing")).axis == expected


def test_what_a_spec_leaves_out_is_what_the_axis_takes_by_itself(spec):
    axis = sizing_of(read_toml(spec(), "sizing")).axis
    assert (axis.utilisation, axis.requirements, axis.motor) == (
        Utilisation(),
        Requirements(),
        None,
    )
    assert axis.mounting == Mounting(length_m=1.0, support=SUPPORTS["fixed-fixed"])
    assert axis.transmission == Transmission()
    assert axis.balls.allowed_m_rpm == 70.0


def test_without_a_choice_the_catalogue_is_searched(told, spec):
    document = told(spec())
    assert document["choice"] is None
    assert document["admissible"]
    assert document["criterion"] == "complete data first, then largest minimum margin"
    fits = [row["name"] for row in document["catalogue"] if row["admissible"]]
    assert document["judged"] == fits[0]
    assert {row["name"]: row["state"] for row in document["checks"]}["whirling"] == "kept"
    assert document["verdict"] == "good"
    text = SPEC.replace("time_s = 1.0", "time_s = 0.05")
    document = told(spec(text), code=3)
    assert document["verdict"] == "bad"
    assert (
        "0 of 21 entries of the catalogue fit; must be at least one: add entries"
        in document["reasons"][0]
    )
    assert document["judged"] == document["catalogue"][0]["name"]
    assert document["reasons"][1:] == [
        check["reason"] for check in document["catalogue"][0]["broken"]
    ]
    assert document["criterion"] == "largest minimum margin"


def test_without_a_choice_the_verdict_names_the_screw_and_its_missing_data(rig, told, spec):
    path = spec(SPEC + "[requirements]\nlife_h = 1000\nlead_class = 'ISO 5'\n")
    searched = told(path)
    named = told(path, "--entry", searched["judged"])
    differing = {name for name in searched if searched[name] != named[name]}
    assert differing == {"choice", "criterion"}
    assert searched["verdict"] == "doubtful"
    assert [reason.partition(":")[0] for reason in searched["reasons"]] == [
        "dynamic load",
        "life",
        "lead class",
    ]
    verdict = " ".join(rig("size", path)[1].partition("verdict: ")[2].split())
    assert verdict.startswith(
        f"{searched['judged']}, best of 7 admissible "
        "(complete data first, then largest minimum margin): "
    )
    assert all(reason in verdict for reason in searched["reasons"])
    told_in_full = told(
        spec(SPEC + MY_SCREW + "[requirements]\nlife_h = 1000\nlead_class = 'ISO 5'\n")
    )
    assert (told_in_full["judged"], told_in_full["verdict"], told_in_full["reasons"]) == (
        "mine",
        "good",
        [],
    )


def test_a_copy_of_the_worked_axis_has_no_printed_figures(rig, told, spec):
    text = (resources.files("rig.studies.sizing") / "screws" / "appendix.toml").read_text()
    shipped, copied = told("--example", "appendix", code=3), told(spec(text), code=3)
    assert len(shipped["published"]) == 96
    assert copied == {**shipped, "published": []}
    assert "printed figures" not in rig("size", spec(text))[1]
    lines = [line for line in text.splitlines() if not line.startswith("choice")]
    assert told(spec("\n".join(lines)))["choice"] is None


def test_printed_figures_of_a_screw_are_compared_only_where_it_is_chosen(told, spec):
    printed = (
        '[published]\npeak_torque_n_m = { printed = "1" }\npeak_speed_m_s = { printed = "0.75" }\n'
    )
    assert [row["name"] for row in told(spec(SPEC + printed))["published"]] == ["peak_speed_m_s"]
    chosen = told(spec(SPEC + MY_SCREW + printed, before='choice = "mine"\n'))["published"]
    assert [row["name"] for row in chosen] == ["peak_torque_n_m", "peak_speed_m_s"]


def test_a_catalogue_without_admissible_entry_is_printed_and_drawn(rig, spec, tmp_path):
    code, said, _ = rig(
        "size", spec(SPEC.replace("time_s = 1.0", "time_s = 0.05")), "--plot", "chart.svg"
    )
    assert code == 3
    assert "catalogue: 0 of 21 admissible" in said
    assert ", nearest of 21, none admissible: diameter " in said
    assert "0 of 21 entries of the catalogue fit" in said
    assert (tmp_path / "chart.svg").stat().st_size > 1000


def test_a_sizing_file_without_a_choice_is_printed_as_tables(rig, spec):
    code, said, _ = rig("size", spec())
    assert code == 0
    assert "least admissible lead" in said
    assert "20x40, best of 8 admissible: diameter 20 mm, lead 40 mm" in said
    last = (
        "verdict: 20x40, best of 8 admissible "
        "(complete data first, then largest minimum margin): admissible"
    )
    assert " ".join(said.split()).endswith(last)


@pytest.mark.parametrize("columns", [80, 120])
def test_no_line_is_wider_than_the_terminal(rig, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    _, said, _ = rig("size", "--example", "appendix", "--published", "--all")
    assert max(len(line) for line in said.splitlines()) <= columns
    assert "…" not in said


def test_the_chart_is_drawn_with_a_line_for_every_limit_that_is_asked(rig, spec, tmp_path):
    requirements = (
        "[requirements]\nlife_h = 1e4\nsag_m = 5e-4\nposition_error_m = 2e-5\n"
        "angle_error_rad = 3e-3\nbandwidth_rad_s = 300\n"
    )
    path = spec(SPEC + requirements + MY_SCREW, before='choice = "mine"\n')
    code, _, _ = rig("size", path, "--plot", "chart.svg")
    assert code == 0
    assert "<svg" in (tmp_path / "chart.svg").read_text()
    sizing = sizing_of(read_toml(path, "sizing"))
    axis = sizing.axis
    names = [line.name for line in region(axis, np.array([0.02]), sizing.choice).lines]
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
        (
            'law = "quintic"',
            "lambda_acc = 0.7\nlambda_dec = 0.4",
            ("[[move]] 2", "lambda_acc + lambda_dec = 1.1"),
        ),
        ('law = "quintic"', "lamda_acc = 0.7", ("[move.2] lamda_acc", "did you mean 'lambda_acc'")),
        (
            'law = "quintic"',
            "durations_s = [0.3, 0.5, 0.2]",
            ("[[move]] 2", "durations_s", "must be 1 s and 0.4 m"),
        ),
        (
            "[axis]",
            '[balls]\nmaterial = "glas"\n[axis]',
            ("[balls] material = 'glas'", "ceramic, steel"),
        ),
        ("[axis]", "[balls]\nlimit_m_rpm = 0\n[axis]", ("[balls] limit_m_rpm = 0",)),
        ("[axis]", "[motor]\n[axis]", ("[motor] continuous_torque_n_m", "missing")),
        (
            "[axis]",
            "[motor]\ncontinuous_torque_n_m = 2\npeak_torque_n_m = 1\nmax_speed_rad_s = 1\n[axis]",
            ("[motor] cont",),
        ),
        (
            "mass_kg = 20.0",
            "mass_kg = 20.0\nslope_deg = 200",
            ("[axis] slope_deg = 200", "-90 to 90"),
        ),
        ("mass_kg = 20.0", "mass_kg = 20.0\ncarried_kg = -1", ("[axis] carried_kg = -1",)),
        (
            "friction_coefficient = 0.02",
            "friction_coefficient = -1",
            ("[axis] friction_coefficient = -1",),
        ),
        ("length_m = 1.0", "length_m = 0.4", ("travel = 0.4 m", "length_m = 0.4")),
        (
            "length_m = 1.0",
            "length_m = 1.0\nfree_length_m = 1.5",
            ("[screw] free_length_m = 1.5", "to 1:"),
        ),
        (
            "length_m = 1.0",
            "length_m = 1.0\nwhirl_coefficient = -1",
            ("[screw] whirl_coefficient = -1",),
        ),
        ("length_m = 1.0", "length_m = 1.0\nnut_n_m = 0", ("[screw] nut_n_m = 0",)),
        ("time_s = 1.0\nlaw", "time_s = 0\nlaw", ("[[move]] 2: time_s = 0",)),
        (
            "[axis]",
            "[requirements]\nsag_m = 0\n[axis]",
            ("[requirements] sag_m = 0", "leave it out"),
        ),
        ("[axis]", "[utilisation]\nwhirl = 2\n[axis]", ("[utilisation] whirl = 2",)),
        ("[axis]", "[transmission]\nefficiency = 2\n[axis]", ("[transmission] efficiency = 2",)),
        (
            "[axis]",
            '[[catalogue]]\nname = ""\ndiameter_m = 0.02\nlead_m = 0.02\norigin = "x"\n[axis]',
            ("name = ''", "empty"),
        ),
        (
            "[axis]",
            '[requirements]\nlead_class = "ISO 2"\n[axis]',
            ("lead_class = 'ISO 2'", "ISO 5, ISO 7, ISO 10"),
        ),
        ("[axis]", "[motor]\npeak_torque_n_m = 1.0\n[axis]", ("[motor]", "missing")),
        (
            "[axis]",
            'choice = "80V hp 20x2"\n[axis]',
            ("choice = '80V hp 20x2'", "did you mean '80V hp 20x20'"),
        ),
        (
            "[axis]",
            '[published]\npeak_spead_m_s = { printed = "1" }\n[axis]',
            ("did you mean 'peak_speed_m_s'",),
        ),
        (
            "[axis]",
            '[published]\npeak_speed_m_s = { printed = "fast" }\n[axis]',
            ("printed = 'fast'", "digits"),
        ),
        (
            "[axis]",
            '[published]\npeak_speed_m_s = { print = "1" }\n[axis]',
            ("did you mean 'printed'",),
        ),
        (
            "[axis]",
            '[[catalogue]]\nname = "20x20"\ndiameter_m = 0.02\nlead_m = 0.02\norigin = ""\n[axis]',
            ("twice",),
        ),
        (
            "[axis]",
            '[[catalogue]]\nname = "x"\ndiameter_m = -0.02\nlead_m = 0.02\norigin = ""\n[axis]',
            ("[[catalogue]] x: diameter_m = -0.02",),
        ),
        (
            "[axis]",
            '[[catalogue]]\nname = "x"\nlead_m = 0.02\norigin = ""\n[axis]',
            ("diameter_m: missing",),
        ),
        ("[axis]", "[axis", ("not valid TOML",)),
    ],
)
def test_an_invalid_sizing_file_is_refused_by_name(rig, spec, old, new, words):
    text = SPEC.replace(old, new)
    assert text != SPEC
    code, said, complaint = rig("size", spec(text))
    assert (code, said) == (2, "")
    assert all(word in complaint for word in words), complaint


def test_a_refusal_is_a_document_where_one_is_asked_for(rig, spec):
    text = SPEC.replace("mass_kg = 20.0", "mass_kg = -20.0")
    code, said, _ = rig("size", spec(text), "--json")
    document = msgspec.json.decode(said)
    assert (code, document["exit_code"], document["verdict"]) == (2, 2, "bad")
    assert "[axis] mass_kg = -20.0" in document["reasons"][0]


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
def test_invalid_options_are_refused_by_name(rig, words, said):
    code, _, complaint = rig("size", *words)
    assert code == 2
    assert all(word in complaint for word in said), complaint


def test_the_verb_explains_itself(rig):
    code, said, _ = rig("size", "--help")
    assert code == 0
    assert all(word in said for word in ("Usage", "--example", "--json", "--plot", "--entry"))
