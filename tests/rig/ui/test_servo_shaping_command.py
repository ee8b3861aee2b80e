"""`rig servo shaping` against printed figures, an independent integration, and scaling."""

import math
import tomllib
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lsim

from planners.shapers import zv
from rig.drives.servo.loops import PolePair
from rig.drives.servo.shaped_setpoint import eigenvalue_1_s
from rig.studies.servo.shaping import impulse_response, pulse_response

DATA = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_shaping.toml").read_text())
PULSE = DATA["pulse"]
CASES = [(1.0, 1.0), *map(tuple, DATA["cases"])]


@pytest.fixture
def told(rig):
    """JSON document of `rig servo shaping`, which must end with exit code 0."""

    def call(*words):
        left, said, heard = rig("servo", "shaping", *words, "--json")
        assert (left, heard) == (0, "")
        return msgspec.json.decode(said)

    return call


def two_masses(frequency, damping, rho):
    """System matrix of [motor speed, load speed, twist, constant torque]; 1 kg m2 in total."""
    motor, load = 1 / (1 + rho), rho / (1 + rho)
    k = frequency**2 * motor * load
    d = 2 * damping * frequency * motor * load
    return np.array(
        [
            [-d / motor, d / motor, -k / motor, 1 / motor],
            [d / load, -d / load, k / load, 0],
            [1, -1, 0, 0],
            [0, 0, 0, 0],
        ]
    )


def integrated_residual(frequency, damping, shaper, pulse_s, rho=1.0, points=4000):
    """Largest deviation from the final speed after the torque, relative: matrix exponential."""
    a, x, t = two_masses(frequency, damping, rho), np.zeros(4), 0.0
    steps = [
        (at, amplitude)
        for at, amplitude in zip(shaper["times_s"], shaper["amplitudes"], strict=True)
    ]
    for at, step in sorted([*steps, *((at + pulse_s, -amplitude) for at, amplitude in steps)]):
        x = expm(a * (at - t)) @ x
        x[3] += step
        t = at
    one, speeds = expm(a * 2 * math.pi / frequency / points), []
    for _ in range(points):
        speeds.append(x[1])
        x = one @ x
    return np.abs(np.array(speeds) / pulse_s - 1).max()


# the table


@pytest.mark.parametrize(
    "known", DATA["robustness"], ids=lambda known: f"{known['shaper']} {known['damping']}"
)
def test_impulses_and_residuals_are_the_printed_ones(told, known):
    document = told("--damping", known["damping"], "--shapers", known["shaper"])
    assert [list(case.values()) for case in document["true_over_assumed"]] == [
        pytest.approx(case) for case in DATA["cases"]
    ]
    (row,) = document["shapers"]
    assert row["amplitudes"] == pytest.approx(known["amplitudes"], rel=1e-7)
    assert row["times_s"] == pytest.approx(known["times_s"], rel=1e-7)
    assert 100 * np.array(row["same_instant"]) == pytest.approx(known["same_instant_pct"], rel=1e-7)
    assert 100 * np.array(row["singer_seering"]) == pytest.approx(
        known["singer_seering_pct"], rel=1e-7
    )
    assert row["residual"] < 1e-14
    if "insensitivity" in known:
        assert row["insensitivity"] == pytest.approx(known["insensitivity"], rel=1e-7)
    if "damping_only_pct" in known:
        assert 100 * np.array(row["damping_only_same_instant"]) == pytest.approx(
            known["damping_only_pct"], abs=5e-4
        )


def test_the_tables_show_the_figures_and_what_was_inferred(rig):
    left, said, heard = rig("servo", "shaping")
    assert (left, heard) == (0, "")
    rows = [line.split() for line in said.splitlines()]
    for known in DATA["robustness"]:
        if known["damping"] == 0.05:
            shown = next(row for row in rows if row[:3] == [known["shaper"], "same", "instant"])
            assert [float(word) for word in shown[3:7]] == pytest.approx(
                known["same_instant_pct"], abs=6e-7
            )
    assert ["unshaped", "14.4900"] in [row[:2] for row in rows]
    assert "Inferred, not published" in said
    assert " 0.02 s " in rig("servo", "shaping", "--sample-time", "0.02")[1]


def test_without_errors_nothing_is_left_and_a_shaper_named_twice_is_shown_once(told):
    document = told("--frequency-error", 0, "--damping-error", 0, "--shapers", "zvd, zv,zvd")
    assert [row["name"] for row in document["shapers"]] == ["zvd", "zv"]
    assert max(max(row["same_instant"]) for row in document["shapers"]) < 1e-14
    left = document["pulse"]["residual_of_final_speed"]
    assert max(left["zv"]["cases"]) < 1e-13
    assert left["unshaped"]["cases"] == [pytest.approx(left["unshaped"]["nominal"], rel=1e-12)] * 4


# the pulse


@pytest.mark.parametrize("rho", [1.0, 0.2, 5.0])
def test_the_residual_of_a_pulse_agrees_with_two_masses_of_any_ratio(told, rho):
    document = told()
    shapers = {"unshaped": {"amplitudes": [1.0], "times_s": [0.0]}} | {
        row["name"]: row for row in document["shapers"]
    }
    for name, left in document["pulse"]["residual_of_final_speed"].items():
        ours = [left["nominal"], *left["cases"]]
        theirs = [integrated_residual(f, 0.05 * d, shapers[name], 10.0, rho) for f, d in CASES]
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-12)


def test_a_simulation_in_steps_gives_the_printed_digits_and_misses_the_exact_ones_by_its_step(told):
    document = told("--shapers", "zv,zvd")
    shapers = {"unshaped": ([1.0], [0.0])} | {
        row["name"]: (row["amplitudes"], row["times_s"]) for row in document["shapers"]
    }
    t = np.arange(0.0, 40.0, PULSE["step_s"])
    on = np.where(t < 10.0 - 1e-9, 1.0, 0.0)
    for name, (amplitudes, times) in shapers.items():
        torque = sum(
            a * np.interp(t - d, t, on, left=0.0) for a, d in zip(amplitudes, times, strict=True)
        )
        stepped = []
        for f, d in CASES:
            w, z = f, 0.05 * d
            speed = lsim(([2 * z * w, w * w], [1, 2 * z * w, w * w, 0]), torque, t)[1]
            stepped.append(100 * np.abs(speed[t > 10.0 + times[-1]] - 10.0).max() / 10.0)
        assert stepped[1:] == pytest.approx(PULSE[f"{name}_pct"], abs=6e-4)
        left = document["pulse"]["residual_of_final_speed"][name]
        assert 100 * np.array(left["cases"]) == pytest.approx(
            PULSE[f"{name}_pct"], abs=PULSE["off_by_pct"]
        )
        if name == "unshaped":
            assert stepped[0] == pytest.approx(PULSE["nominal_pct"], abs=6e-4)
            assert 100 * left["nominal"] == pytest.approx(
                PULSE["nominal_pct"], abs=PULSE["off_by_pct"]
            )


def test_a_faster_joint_with_a_shorter_pulse_leaves_the_same(told):
    slow, fast = told(), told("--frequency", 50, "--pulse", 0.2)
    for one, other in zip(slow["shapers"], fast["shapers"], strict=True):
        assert np.array(one["times_s"]) / 50 == pytest.approx(other["times_s"], rel=1e-12)
        assert one["same_instant"] == pytest.approx(other["same_instant"], rel=1e-10)
        assert one["insensitivity"] == pytest.approx(other["insensitivity"], rel=1e-9)
    for one, other in zip(
        *(d["pulse"]["residual_of_final_speed"].values() for d in (slow, fast)), strict=True
    ):
        assert one["cases"] == pytest.approx(other["cases"], rel=1e-9)


def test_an_undamped_joint_stands_still_after_a_pulse_of_a_whole_period(told):
    document = told("--damping", 0, "--pulse", 2 * math.pi, "--frequency-error", 0)
    assert document["pulse"]["residual_of_final_speed"]["unshaped"]["nominal"] < 1e-13


# samples, picture, refusals


def test_on_a_drive_s_samples_the_mode_is_left_at_rest_and_the_impulses_are_whole_samples(told):
    period_s = 0.03
    for row in told("--sample-time", period_s, "--shapers", "zv,zvd,mzv,um_zv")["shapers"]:
        sampled = row["sampled"]
        counts = np.array(sampled["times_s"]) / period_s
        assert counts == pytest.approx(np.rint(counts), abs=1e-9)
        assert sampled["residual"] < 1e-13
        assert sampled["insensitivity"] == pytest.approx(row["insensitivity"], rel=2e-3)
        assert sampled["duration_s"] - row["duration_s"] < period_s
    assert told()["shapers"][0]["sampled"] is None


@pytest.mark.parametrize(
    ("shapers", "panels"), [("zv", 3), ("zv,zvd,zvdd", 5), ("zv,zvd,mzv,ei", 6)]
)
def test_the_figure_has_a_panel_for_each_shaper_one_for_the_speed_and_one_for_the_torque(
    rig, tmp_path, shapers, panels
):
    left, _, heard = rig("servo", "shaping", "--shapers", shapers, "--plot", "shaping.svg")
    assert (left, heard) == (0, "")
    drawn = (tmp_path / "shaping.svg").read_text()
    assert drawn.count('<g id="axes_') == panels


def test_the_picture_s_curves_are_the_impulses_formula_and_the_pulse_s_end():
    t_s = np.linspace(0.0, 9.0, 50)
    shaper, mode = zv(eigenvalue_1_s(PolePair(2.0, 0.1))), PolePair(1.7, 0.12)
    wd, sigma, by_formula = 1.7 * math.sqrt(1 - 0.12**2), 1.7 * 0.12, np.zeros(50)
    for k, at in zip(*shaper, strict=True):
        since = t_s - at
        by_formula += (
            np.where(since > 0, k * 1.7 / wd * np.exp(-sigma * since) * np.sin(wd * since), 0.0)
            * 1.7
        )
    np.testing.assert_allclose(1.7 * impulse_response(shaper, mode, t_s), by_formula, atol=1e-14)
    done = pulse_response(3.0, shaper, PolePair(2.0, 0.1), watch_s=50.0)
    assert done.load_speed.duration_s == pytest.approx(3.0 + shaper.times_s[-1] + 50.0)
    assert done.load_speed.at([0.0, 60.0]) == pytest.approx([0.0, 3.0], abs=1e-12)


@pytest.mark.parametrize(
    ("words", "told_so"),
    [
        (("--damping", 1), "damping = 1.0; must be 0 to 0.99: give the damping ratio of the mode"),
        (("--damping", -0.1), "damping = -0.1; must be 0 to 0.99"),
        (
            ("--damping", 0.9, "--damping-error", 0.2),
            "damping x (1 + damping error) = 1.08; must be 0 to 0.99: lower",
        ),
        (("--frequency", 0), "frequency = 0.0; must be 1e-06 to 1e+06"),
        (("--frequency-error", -0.1), "frequency error = -0.1; must be 0 to 0.9: give a share"),
        (("--damping-error", -0.2), "damping error = -0.2; must be 0 to 1: give a share"),
        (("--shapers", "zv,zvvd"), "shaper = 'zvvd'; did you mean 'zvd'? must be one of ei,"),
        (("--shapers", ","), "shapers = (); must be one or more of zv, zvd"),
        (("--shapers", "ei", "--damping", 0.6), "for shaper ei; must be <= 0.5"),
        (("--pulse", 0), "pulse = 0.0; must be 1e-06 to 1e+06: give its length in s"),
        (("--pulse", "nan"), "pulse = nan; must be 1e-06"),
        (
            ("--sample-time", 4),
            "shaper's mode = 0.998749 rad/s with a sample time of 4 s; must be < 0.785398 rad/s",
        ),
        (("--sample-time", 0), "period_s = 0.0; must be 1e-07 to 10"),
        (("--plot", "shaping.txt"), "must end in one of .svg, .png, .pdf"),
        (("--plot", "nowhere/shaping.svg"), "no folder 'nowhere'"),
    ],
)
def test_bad_input_is_refused_with_value_bound_and_next_step(rig, words, told_so):
    left, said, heard = rig("servo", "shaping", *words)
    assert (left, said) == (2, "")
    assert told_so in " ".join(heard.split())


def test_help_states_units_and_defaults(rig):
    left, said, _ = rig("servo", "shaping", "--help")
    assert left == 0
    assert all(
        word in said
        for word in ("--damping-error", "rad/s", "torque pulse [s]", "0.05", "zv,zvd,zvdd")
    )
