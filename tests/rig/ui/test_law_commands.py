"""`rig laws`, `rig spline`, `rig motor-check` against closed forms, scipy and printed figures."""

import csv
import math
import tomllib
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, make_interp_spline

from planners.laws import LAWS
from planners.laws.double_s import double_s_within
from rig.studies.published_laws import PUBLISHED

DATA = Path(__file__).parents[2] / "data"
COEFFICIENTS = tomllib.loads((DATA / "laws.toml").read_text())["coefficients"]
MOTOR = tomllib.loads((DATA / "spectra.toml").read_text())["motor"]
MOTOR_OPTIONS = (
    "--continuous-torque",
    8,
    "--peak-torque",
    20,
    "--max-speed",
    10,
    "--motor-inertia",
    1,
)


@pytest.fixture
def told(rig):
    """JSON document of a verb, which must end with the expected exit code."""

    def call(*words, code=0):
        left, said, _ = rig(*words, "--json")
        assert left == code
        return msgspec.json.decode(said)

    return call


@pytest.fixture
def points(tmp_path):
    """Function that writes a file of points and gives its path."""

    def write(*lines):
        path = tmp_path / "points.csv"
        path.write_text("\n".join(lines) + "\n")
        return path

    return write


# laws


def test_the_catalogue_in_json_is_a_list_with_the_promised_keys_of_every_law(told):
    rows = told("laws")
    assert [row["name"] for row in rows] == list(LAWS)
    assert all(set(row) == {"name", "cv", "ca", "cv_rms", "ca_rms", "continuity"} for row in rows)


def test_the_catalogue_and_its_published_figures_are_those_of_the_source_right_where_it_is_wrong(
    told,
):
    rows = {row["name"]: row for row in told("laws", "--published")}
    for known in COEFFICIENTS:
        row = rows[known["law"]]
        assert [row[key] for key in ("cv", "ca", "cv_rms", "ca_rms")] == pytest.approx(
            known["right"], rel=1e-11
        )
        assert list(row["published"].values()) == known["published"]
        assert row["wrong"] == known["wrong"]
        assert bool(row["reason"]) == bool(known["wrong"])
    assert {known["law"] for known in COEFFICIENTS} == set(PUBLISHED)
    assert rows["double_s"]["published"] is None


def test_the_tables_show_swing_free_durations_and_both_figures_side_by_side(rig):
    _, said, _ = rig("laws")
    assert all(name in said for name in LAWS)
    assert "1.4303" in next(line for line in said.splitlines() if line.startswith("cubic"))
    _, said, _ = rig("laws", "--published")
    assert "3.4131≠" in said
    assert "3.464102" in said


def test_least_times_are_sorted_keep_the_limits_and_reach_one(told):
    document = told(
        "laws", "compare", "--distance", "-0.3", "--vmax", "0.5", "--amax", "2", "--jmax", "30"
    )
    times = [move["time_s"] for move in document["laws"] if move["time_s"] is not None]
    assert times == sorted(times)
    assert len(document["laws"]) == len(LAWS)
    limits = {"speed_m_s": 0.5, "acceleration_m_s2": 2.0, "jerk_m_s3": 30.0}
    for move in document["laws"][: len(times)]:
        peaks = {key: move[f"peak_{key}"] for key in limits}
        assert all(peaks[key] <= bound * (1 + 1e-9) for key, bound in limits.items()), move["name"]
        assert move["meets"]
        assert all(peaks[key] == pytest.approx(limits[key], rel=1e-8) for key in move["meets"])
    assert all(move["reason"] and move["time_s"] is None for move in document["laws"][len(times) :])
    assert {"cubic", "harmonic", "trapezoidal"} <= {
        move["name"] for move in document["laws"][len(times) :]
    }


def test_laws_of_segments_take_the_least_time_of_their_kind(told):
    v, a, j, h = 0.5, 2.0, 30.0, 0.3
    jerky = {
        move["name"]: move
        for move in told("laws", "compare", "--distance", h, "--vmax", v, "--amax", a, "--jmax", j)[
            "laws"
        ]
    }
    smooth = {
        move["name"]: move
        for move in told(
            "laws", "compare", "--distance", h, "--vmax", v, "--amax", a, "--jmax", j, "--smax", 900
        )["laws"]
    }
    assert jerky["double_s"]["time_s"] == pytest.approx(
        double_s_within(h, v, a, j).duration_s, rel=1e-12
    )
    assert smooth["fifteen_segments"]["time_s"] == pytest.approx(
        h / v + v / a + a / j + j / 900, rel=1e-12
    )
    assert smooth["double_s"]["time_s"] is None


def test_the_residual_swing_agrees_with_an_independent_integration(told):
    length, h = 0.6, 0.5
    document = told(
        "laws", "compare", "--distance", h, "--load-length", length, "--vmax", 1, "--amax", 5
    )
    moves = {move["name"]: move for move in document["laws"]}
    assert moves["trapezoidal"]["time_s"] == pytest.approx(h / 1 + 1 / 5, rel=1e-12)
    move = moves["cycloidal"]
    period, w2 = document["load_period_s"], 9.81 / length
    assert period == pytest.approx(2 * math.pi / math.sqrt(w2), rel=1e-12)

    def swing(sine, cosine):
        def rate(t, x):
            push = (
                2 * math.pi * h / move["time_s"] ** 2 * math.sin(2 * math.pi * t / move["time_s"])
            )
            return x[1], -w2 * sine(x[0]) - push / length * cosine(x[0])

        angle, speed = solve_ivp(rate, (0, move["time_s"]), (0, 0), rtol=1e-11, atol=1e-13).y[:, -1]
        return math.hypot(angle, speed / math.sqrt(w2))

    assert move["residual_swing_rad"] == pytest.approx(swing(lambda x: x, lambda x: 1.0), rel=1e-8)
    assert move["residual_swing_nonlinear_rad"] == pytest.approx(
        swing(math.sin, math.cos), rel=1e-3
    )
    assert move["swing_free_time_s"] == pytest.approx(2.0 * period, rel=1e-9)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--distance", 0), "--distance 0"),
        (("--distance", "nan"), "--distance nan"),
        (("--vmax", -1), "--vmax -1"),
        (("--amax", "nan"), "--amax nan"),
        (("--jmax", 0), "--jmax 0"),
        (("--vmax", "inf", "--amax", "inf"), "finite"),
        (("--load-length", 0), "length_m = 0"),
    ],
)
def test_an_invalid_comparison_is_refused_by_name(rig, words, said):
    code, _, complaint = rig("laws", "compare", *words)
    assert code == 2
    assert said in complaint


def test_one_law_some_laws_and_all_of_them_are_drawn(told, tmp_path):
    assert told("laws", "plot", "--plot", "all.svg")["laws"] == list(LAWS)
    assert told("laws", "plot", "cubic", "cubic", "double_s", "--plot", "two.svg")["laws"] == [
        "cubic",
        "double_s",
    ]
    assert "<svg" in (tmp_path / "all.svg").read_text()
    assert "<svg" in (tmp_path / "two.svg").read_text()


def test_an_unknown_law_or_figure_format_is_refused_with_the_known_ones(rig):
    code, _, complaint = rig("laws", "plot", "cubik")
    assert code == 2
    assert "did you mean 'cubic'" in complaint
    code, _, complaint = rig("laws", "plot", "--plot", "laws.gif")
    assert code == 2
    assert ".svg" in complaint


def test_an_option_before_a_verb_of_laws_is_refused_with_its_place(rig):
    code, _, complaint = rig("laws", "--json", "compare")
    assert code == 2
    assert "after it" in complaint


# splines


@pytest.mark.parametrize("start", ["equal", "proportional", "sqrt"])
@pytest.mark.parametrize(
    ("kind", "least_s"), [("cubic", 6 + math.sqrt(21)), ("four_three_four", 12.089598)]
)
def test_the_least_time_through_the_points_of_source_003_is_found_from_every_start(
    told, points, kind, start, least_s
):
    file = points("x_m", "0", "2", "12", "5")
    document = told("spline", file, "--kind", kind, "--allocation", start, "--vmax", 3, "--amax", 2)
    assert document["duration_s"] == pytest.approx(least_s, abs=1e-5)
    assert max(document["limits_reached"].values()) == pytest.approx(1.0, abs=1e-9)
    assert document["allocated_duration_s"] > document["duration_s"]
    assert not document["warnings"]


def test_only_scaled_allocations_take_the_times_known_of_them(told, points):
    file = points("x_m", "0", "2", "12", "5")
    known = {"equal": 13.7477, "proportional": 16.1856, "sqrt": 11.9515}
    for name, time_s in known.items():
        document = told(
            "spline", file, "--kind", "cubic", "--allocation", name, "--vmax", 3, "--amax", 2
        )
        assert document["allocated_duration_s"] == pytest.approx(time_s, abs=1e-4)


def test_a_cubic_through_the_file_s_times_is_scipy_s_and_its_csv_too(told, points):
    t, x = np.array([2.0, 2.5, 3.7, 4.0]), np.array([0.0, 0.2, -0.1, 0.3])
    file = points("# a comment", "t_s, x_m", *(f"{a}, {b}" for a, b in zip(t, x, strict=True)), "")
    document = told("spline", file, "--kind", "cubic", "--csv", "out.csv")
    truth = CubicSpline(t - 2.0, x, bc_type="clamped")
    turns = [0.0, 2.0, *truth.derivative().roots(extrapolate=False)]
    assert document["times_s"] == pytest.approx(t - 2.0)
    assert document["axes"]["x"]["position_m"]["high"] == pytest.approx(
        truth(turns).max(), rel=1e-12
    )
    with Path("out.csv").open() as source:
        rows = list(csv.DictReader(source))
    assert len(rows) == 201
    times = np.array([float(row["t_s"]) for row in rows])
    for order, column in enumerate(("x_m", "x_m_s", "x_m_s2")):
        np.testing.assert_allclose(
            [float(row[column]) for row in rows], truth(times, order), rtol=1e-8, atol=1e-8
        )


def test_three_axes_share_their_times_and_keep_the_limits_together(told, points):
    file = points("y_m,x_m,z_m", "0,0,0.2", "0.3,0.1,0.2", "-0.1,0.4,0.2", "0,0.5,0.2")
    document = told("spline", file, "--kind", "b_spline_4", "--vmax", 1, "--amax", 3, "--jmax", 40)
    assert list(document["axes"]) == ["x", "y", "z"]
    for name, bound in (("speed_m_s", 1.0), ("acceleration_m_s2", 3.0), ("jerk_m_s3", 40.0)):
        peaks = [axis[name]["peak"] for axis in document["axes"].values()]
        assert max(peaks) == pytest.approx(bound * document["limits_reached"][name], rel=1e-6)
        assert max(peaks) <= bound * (1 + 1e-9)
        assert peaks[2] == 0.0


def test_a_total_time_is_shared_by_the_distance_and_gives_scipy_s_b_spline(told, points):
    document = told(
        "spline", points("x_m", "0", "1", "5", "4"), "--time", 7, "--allocation", "proportional"
    )
    t = np.array([0.0, 7 / 6, 35 / 6, 7.0])
    assert document["times_s"] == pytest.approx(t)
    ends = [(1, 0.0), (2, 0.0)]
    truth = make_interp_spline(t, [0.0, 1.0, 5.0, 4.0], k=5, bc_type=(ends, ends))
    speed = np.abs(truth(np.linspace(0, 7, 20001), 1)).max()
    assert document["axes"]["x"]["speed_m_s"]["peak"] == pytest.approx(speed, rel=1e-6)


def test_two_points_and_natural_ends_are_only_scaled_to_the_limits(told, points):
    two = told("spline", points("x_m", "0", "1"), "--vmax", 0.5)
    assert two["axes"]["x"]["speed_m_s"]["peak"] == pytest.approx(0.5)
    free = told("spline", points("x_m", "0", "1", "0.5"), "--kind", "natural", "--vmax", 0.5)
    assert free["axes"]["x"]["speed_m_s"]["peak"] == pytest.approx(0.5)
    assert free["axes"]["x"]["continuity"] == "C0"


def test_blends_pass_by_their_points_at_the_distance_of_the_closed_form(told, points):
    file = points("t_s,x_m", "0,0", "1,1", "2,0.5", "3,0.5")
    document = told("spline", file, "--kind", "blends", "--amax", 20)
    first = 1.0 / (1.0 - (1.0 - math.sqrt(1.0 - 2.0 / 20.0)) / 2.0)  # speed of the first line
    assert document["axes"]["x"]["largest_miss_m"] == pytest.approx(
        (first + 0.5) ** 2 / (8 * 20), rel=1e-9
    )


def test_an_exceeded_limit_gives_exit_code_3_and_its_place(rig, points):
    file = points("t_s,x_m", "0,0", "0.1,1", "2,0.5")
    code, said, _ = rig("spline", file, "--vmax", 1, "--position-max", 0.9)
    assert code == 3
    assert "|speed_m_s| reaches" in said
    assert "position_m reaches" in said


def test_a_jerk_limit_counts_the_step_of_a_cubic_s_acceleration(told, points):
    document = told(
        "spline",
        points("t_s,x_m", "0,0", "1,0.1", "2,0.5"),
        "--kind",
        "cubic",
        "--jmax",
        1e6,
        code=3,
    )
    assert "without bound" in document["warnings"][0]


def test_a_motion_is_drawn_and_printed_as_a_table(rig, points, tmp_path):
    code, said, _ = rig(
        "spline", points("x_m,z_m", "0,0", "1,0.3", "0.5,0"), "--time", 3, "--plot", "motion.svg"
    )
    assert code == 0
    assert "acceleration [m/s²]" in said
    assert "<svg" in (tmp_path / "motion.svg").read_text()


@pytest.mark.parametrize(
    ("lines", "words", "said"),
    [
        (("t_s,x_m", "0,0", "1,abc"), (), ("points.csv", "3", "x_m", "'abc'")),
        (("t_s,x_m", "0,0", "1,nan"), (), ("points.csv", "3", "x_m", "'nan'")),
        (("t_s,x_m", "0,0", "1"), (), ("points.csv", "3", "must be 2")),
        (("t_s,x_m", "0,0", "2,1", "1,2"), (), ("1", "2", "must increase")),
        (("t_s,x_m", "0,0", "1,1", "1,2"), (), ("1", "must increase")),
        (("t_s,x_mm", "0,0", "1,1"), (), ("x_mm", "x_m")),
        (("0,0", "1,1", "2,1"), (), ("points.csv", "'0'")),
        (("x_m", "0"), (), ("points.csv", ">= 2")),
        (("x_m", "0", "1"), (), ("--time", "--vmax")),
        (("x_m", "0", "1", "1"), ("--time", 1), ("points 1 and 2", "remove")),
        (("t_s,x_m", "0,0", "1,1"), ("--time", 2), ("--retime",)),
        (("x_m", "0", "1", "2"), ("--kind", "blends", "--time", 2), ("--amax",)),
        (("x_m", "0", "1", "2"), ("--kind", "cubik", "--time", 2), ("did you mean 'cubic'",)),
        (("x_m", "0", "1", "2"), ("--allocation", "eqal", "--time", 2), ("did you mean 'equal'",)),
        (
            ("x_m", "0", "1", "2"),
            ("--kind", "cubic", "--vmax", 1, "--jmax", 1),
            ("jerk_m_s3", "cubic"),
        ),
        (("x_m", "0", "1", "2"), ("--vmax", -1), ("speed_m_s = -1",)),
    ],
)
def test_invalid_points_are_refused_by_name(rig, points, lines, words, said):
    code, _, complaint = rig("spline", points(*lines), *words)
    assert code == 2
    assert all(word in complaint for word in said), complaint


def test_a_missing_file_of_points_is_named(rig):
    code, _, complaint = rig("spline", "nowhere.csv")
    assert code == 2
    assert "nowhere.csv" in complaint


# motor


@pytest.mark.parametrize(("example", "name"), [("1", "cycloidal"), ("2", "trapezoidal")])
def test_the_worked_tasks_show_the_printed_figure_and_the_right_one(told, rig, example, name):
    document, known = told("motor-check", "--example", example), MOTOR[name]
    assert document["feasible"]
    assert document["rms_torque_n_m"] == pytest.approx(known["rms_n_m"], rel=1e-12)
    assert document["peak_torque_n_m"] == pytest.approx(known["peak_n_m"], abs=6e-7)
    assert document["peak_speed_rad_s"] == pytest.approx(known["speed_rad_s"], rel=1e-12)
    assert document["published"]["rms_torque_n_m"] == known["published_rms_n_m"]
    _, said, _ = rig("motor-check", "--example", example)
    assert f"{known['rms_n_m']:.6g} N m" in said
    assert f"{known['published_rms_n_m']}{' ≠' if name == 'trapezoidal' else ' '}" in said


def test_a_task_of_options_alone_is_the_example_s(told):
    document = told(
        "motor-check", *MOTOR_OPTIONS, "--motor-friction", 0.3, "--angle", 15, "--time", 3
    )
    assert document["margins"] == told("motor-check", "--example", "1")["margins"]


def test_screw_and_gear_ratio_agree_with_their_closed_form(told):
    document = told(
        "motor-check", *MOTOR_OPTIONS, "--load-inertia", 4, "--gear-ratio", 2,
        "--distance", 0.1, "--radius", 0.02, "--time", 3, "--law", "cubic",
    )  # fmt: skip
    angle = 0.1 / 0.02 * 2
    assert document["inertia_kg_m2"] == pytest.approx(2.0)
    assert document["peak_torque_n_m"] == pytest.approx(2.0 * 6 * angle / 9, rel=1e-12)
    assert document["peak_speed_rad_s"] == pytest.approx(1.5 * angle / 3, rel=1e-12)


def test_a_motor_above_its_rms_torque_is_refused_and_the_rest_it_names_is_sufficient(told):
    words = ("motor-check", "--example", "2", "--continuous-torque", 7)
    document = told(*words, code=3)
    assert document["verdict"] == "bad"
    assert "rms torque" in document["reasons"][0]
    assert document["published"]["rms_torque_n_m"] == 7.7104
    rest = document["least_rest_s"]
    assert told(*words, "--rest", rest * (1 + 1e-9))["margins"]["thermal"] == pytest.approx(
        0.0, abs=1e-8
    )
    assert told(*words, "--rest", rest * 0.99, code=3)["tightest"] == "thermal"


def test_options_override_the_keys_of_a_file(told, rig, tmp_path):
    (tmp_path / "task.toml").write_text(
        "[motor]\ncontinuous_torque_n_m = 8\npeak_torque_n_m = 20\n"
        "max_speed_rad_s = 10\npeak_power_w = 90\n"
        "[drivetrain]\nmotor_inertia_kg_m2 = 1\nradius_m = 0.1\n"
        '[motion]\nlaw = "trapezoidal"\ndistance_m = 1.5\ntime_s = 3\nacceleration_m_s2 = 1.5\n'
    )
    assert told("motor-check", "task.toml")["peak_torque_n_m"] == pytest.approx(15.0, rel=1e-12)
    assert told("motor-check", "task.toml", "--acceleration", 1.0)[
        "peak_torque_n_m"
    ] == pytest.approx(10.0, rel=1e-12)
    code, said, _ = rig("motor-check", "task.toml", "--peak-power", 50, "--plot", "motor.svg")
    assert code == 3
    assert "peak power" in said
    assert "<svg" in (tmp_path / "motor.svg").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), ("[motor] continuous_torque_n_m", "--continuous-torque", "--example")),
        (("--example", 3), ("--example", "3", "1, 2")),
        ((*MOTOR_OPTIONS, "--time", 1), ("distance",)),
        ((*MOTOR_OPTIONS, "--time", 1, "--distance", 1), ("radius_m",)),
        ((*MOTOR_OPTIONS, "--time", 1, "--angle", 1, "--radius", 1), ("one unit",)),
        (("--example", 1, "--distance", 1), ("one unit",)),
        (("--example", 1, "--acceleration", 15), ("cycloidal", "trapezoidal")),
        (("--example", 2, "--acceleration", 1), ("acceleration",)),
        (("--example", 1, "--law", "cycloid"), ("did you mean 'cycloidal'",)),
        (("--example", 1, "--time", 0), ("duration_s = 0",)),
        (("--example", 1, "--rest", -1), ("rest_s = -1",)),
        (("--example", 1, "--peak-torque", 5), ("exchanged",)),
        (("nowhere.toml",), ("nowhere.toml",)),
    ],
)
def test_an_invalid_task_is_refused_by_name(rig, words, said):
    code, _, complaint = rig("motor-check", *words)
    assert code == 2
    assert all(word in complaint for word in said), complaint


def test_an_unknown_key_and_a_broken_file_are_named(rig, tmp_path):
    (tmp_path / "task.toml").write_text("[motor]\ntorque = 1\n")
    code, _, complaint = rig("motor-check", "task.toml", *MOTOR_OPTIONS, "--angle", 1, "--time", 1)
    assert code == 2
    assert "torque" in complaint
    (tmp_path / "task.toml").write_text("[motor\n")
    code, _, complaint = rig("motor-check", "task.toml")
    assert code == 2
    assert "not valid TOML" in complaint


@pytest.mark.parametrize(
    "verb", [("laws",), ("laws", "compare"), ("laws", "plot"), ("spline",), ("motor-check",)]
)
def test_the_help_of_each_verb_shows_its_usage(rig, verb):
    code, said, _ = rig(*verb, "--help")
    assert code == 0
    assert "Usage" in said
    assert "--json" in said


def test_a_search_that_would_take_minutes_is_refused_before_it_starts(rig, tmp_path):
    (tmp_path / "many.csv").write_text("x_m\n" + "\n".join(str(k % 7) for k in range(40)))
    code, _, why = rig("spline", tmp_path / "many.csv", "--vmax", 3, "--amax", 2)
    assert code == 2
    assert "minimum time through 40 points by --kind b_spline_5; must be <= 25 points" in why


def test_a_table_of_a_hundred_million_rows_is_refused(rig, tmp_path):
    (tmp_path / "p.csv").write_text("x_m\n0\n1\n2\n")
    code, _, why = rig("spline", tmp_path / "p.csv", "--time", 1e6, "--csv", tmp_path / "out.csv")
    assert code == 2
    assert "must be <= 1000000 rows" in why


def test_a_long_way_under_a_short_cable_is_compared_in_seconds(rig):
    code, said, _ = rig("laws", "compare", "--distance", 100, "--load-length", 1, "--json")
    assert code == 0
    assert all(
        row["swing_free_time_s"] is None or row["swing_free_time_s"] >= row["time_s"]
        for row in msgspec.json.decode(said)["laws"]
    )


@pytest.mark.parametrize(
    "words",
    [
        ("spline", "--json"),
        ("motor-check", "--time", "abc", "--json"),
        ("plan", "--bogus", "--json"),
    ],
)
def test_a_command_line_that_cannot_be_understood_gives_a_document_too(rig, words):
    code, said, why = rig(*words)
    document = msgspec.json.decode(said)
    assert (code, document["exit_code"], document["verdict"]) == (2, 2, "bad")
    assert "Usage" in why
