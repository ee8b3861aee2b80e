"""`rig servo notch` against the example of source 001 and an independent integration."""

import tomllib
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

FIGURES = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_loops.toml").read_text())
EXAMPLE = FIGURES["example"]


@pytest.fixture
def told(rig):
    """JSON document of `rig servo notch`, which must end with exit code 0."""

    def call(*words):
        left, said, _ = rig("servo", "notch", *words, "--json")
        assert left == 0
        return msgspec.json.decode(said)

    return call


def close(pairs, frequencies, dampings):
    assert [pair["frequency_rad_s"] for pair in pairs] == pytest.approx(frequencies, rel=1e-5)
    assert [pair["damping"] for pair in pairs] == pytest.approx(dampings, abs=1e-5)


def test_poles_margins_and_responses_of_all_places_are_those_of_the_reference(told):
    rows = {row["name"]: row for row in told()["placements"]}
    assert list(rows) == ["none", "inside", "upstream"]
    for name, row in rows.items():
        known = EXAMPLE[name]
        close(row["position_modes"], known["position_rad_s"], known["position_damping"])
        if name != "upstream":
            close(row["speed_modes"], known["speed_rad_s"], known["speed_damping"])
            assert row["phase_margin_deg"] == pytest.approx(known["phase_margin_deg"], abs=1e-3)
        if name != "none":
            close(row["hidden"], [known["hidden_rad_s"]], [known["hidden_damping"]])
        assert row["motor_step_variation"] == pytest.approx(known["motor_step_variation"], rel=2e-4)
        assert row["load_step_variation"] == pytest.approx(known["load_step_variation"], rel=2e-4)
        assert row["position_step_peak_rad_s"] == pytest.approx(
            known["position_step_peak_rad_s"], rel=2e-4
        )
        assert row["oscillation"] == pytest.approx(known["oscillation"], abs=1e-3)
        assert row["settling_s"] == pytest.approx(known["settling_s"], abs=3e-4)
        assert row["overshoot"] < 1e-6
    assert rows["none"]["hidden"] == []
    assert rows["none"]["notch"] is None


def test_the_variation_after_a_torque_on_the_load_is_that_of_an_integration_of_the_equations(told):
    """P/PI cascade without notch on the harmonic drive with its listed constants."""
    j, gains = FIGURES["drive"], told("--joint", "listed")
    row, gains = gains["placements"][0], gains["gains"]
    jl = j["load_inertia_kg_m2"] / j["gear_ratio"] ** 2

    def rate(_, x):
        motor, speed, load, load_speed, integral = x
        error = -gains["position_gain_1_s"] * motor - speed
        torque = gains["speed_gain_n_m_s_rad"] * (error + integral / gains["reset_time_s"])
        twist = j["stiffness_n_m_rad"] * (motor - load) + j["elastic_damping_n_m_s_rad"] * (
            speed - load_speed
        )
        motor_rate = (torque - twist - j["motor_friction_n_m_s_rad"] * speed) / j[
            "motor_inertia_kg_m2"
        ]
        return speed, motor_rate, load_speed, (twist + 1.0) / jl, error

    found = solve_ivp(
        rate, (0.0, 1.5), np.zeros(5), t_eval=np.linspace(0.0, 1.5, 6001), rtol=1e-8, atol=1e-10
    )
    assert row["load_step_variation"] == pytest.approx(np.abs(np.diff(found.y[3])).sum(), rel=1e-3)


def opened(row, omega):
    """Open position loop of the example at j omega.

    Kpp / s, times the notch upstream, times the closed speed loop with the notch inside.
    """
    s, jm, jl, k, d = 1j * omega, 0.5, 0.5, 0.5 * 200.0**2, 2.0 * 0.1 * 200.0 * 0.5
    tuned = row["notch"] or {
        "frequency_rad_s": 1.0,
        "numerator_damping": 1.0,
        "denominator_damping": 1.0,
    }
    w, low, high = (
        tuned["frequency_rad_s"],
        tuned["numerator_damping"],
        tuned["denominator_damping"],
    )
    notch = (s * s + 2.0 * low * w * s + w * w) / (s * s + 2.0 * high * w * s + w * w)
    inside, upstream = (notch, 1.0) if row["name"] == "inside" else (1.0, notch)
    plant = (jl * s * s + d * s + k) / (s * (jm * jl * s * s + (jm + jl) * (d * s + k)))
    speed = 200.0 * (1.0 + 1.0 / (0.05 * s)) * inside * plant
    return 20.0 / s * upstream * speed / (1.0 + speed)


def test_margin_and_crossover_of_the_position_loop_are_those_of_its_equations(told):
    for row in told()["placements"]:
        crossover = brentq(lambda omega, row=row: abs(opened(row, omega)) - 1.0, 1.0, 60.0)
        assert row["position_crossover_rad_s"] == pytest.approx(crossover, rel=1e-6)
        margin = 180.0 + np.degrees(np.angle(opened(row, crossover)))
        assert row["position_margin_deg"] == pytest.approx(margin, abs=1e-4)


@pytest.mark.parametrize("detune", ["1", "0.9"])
def test_the_reported_limit_of_the_position_gain_is_the_stability_limit(rig, detune):
    def ask(gain):
        return rig("servo", "notch", "--json", "--detune", detune, "--position-loop", gain)

    limits = [5.0]
    while ask(limits[-1] * 0.999)[0]:
        left, _, err = ask(limits[-1] * 0.999)
        assert left == 2
        assert "the position loop has a pole at" in err
        limits.append(float(err.split("must be < ")[1].split()[0]))
    assert ask(limits[-1] * 1.001)[0] == 2
    assert 0.1 < limits[-1] < 5.0


def test_the_joint_of_a_comparison_file_is_its_model(told, tmp_path):
    drive = FIGURES["drive"] | {"stiffness_n_m_rad": 12.0}
    lines = [f"{key} = {value}" for key, value in drive.items()]
    move = ["load_angle_deg = 40.0", "time_s = 0.5", "motor_acceleration_rad_s2 = 1200.0"]
    (tmp_path / "mine.toml").write_text(
        "\n".join(["[[move]]", *move, "[model]", *lines, "[bench]", *lines])
    )
    jm, jl = drive["motor_inertia_kg_m2"], drive["load_inertia_kg_m2"] / drive["gear_ratio"] ** 2
    k, d, dm = 12.0, drive["elastic_damping_n_m_s_rad"], drive["motor_friction_n_m_s_rad"]
    (pole,) = (
        p
        for p in np.roots([jm * jl, (jm + jl) * d + jl * dm, (jm + jl) * k + dm * d, dm * k])
        if p.imag > 0.0
    )
    notch = told("--joint", "mine.toml")["placements"][1]["notch"]
    assert notch["frequency_rad_s"] == pytest.approx(abs(pole), rel=1e-9)
    assert notch["numerator_damping"] == pytest.approx(-pole.real / abs(pole), rel=1e-9)


def test_a_detuned_notch_cancels_no_pole_pair(told):
    document = told("--detune", "0.9")
    rows = [(row["name"], row["factor"]) for row in document["detuned"]]
    assert rows == [
        ("inside", 0.9),
        ("upstream", 0.9),
        ("inside", pytest.approx(1 / 0.9)),
        ("upstream", pytest.approx(1 / 0.9)),
    ]
    right = {row["name"]: row for row in document["placements"]}
    for row in document["detuned"]:
        known = right[row["name"]]
        assert row["notch"]["frequency_rad_s"] == pytest.approx(
            row["factor"] * known["notch"]["frequency_rad_s"], rel=1e-12
        )
        assert row["hidden"] == []
        least = min(mode["damping"] for mode in row["position_modes"])
        assert least < min(mode["damping"] for mode in known["position_modes"])


@pytest.mark.parametrize("known", FIGURES["notch"]["sampled"][:2])
def test_without_prewarp_the_digital_notch_of_the_printed_mode_moves_as_the_reference_says(
    told, known
):
    rows = told("--joint", "fitted", "--sample-time", known["period_s"])["sampled"]
    row = next(row for row in rows if row["name"] == "inside")
    assert row["frequency_rad_s"] == pytest.approx(known["frequency_rad_s"], rel=1e-8)
    assert row["shift"] == pytest.approx(known["shift"], rel=1e-5)
    assert row["prewarped"] == pytest.approx(row["depth"], rel=1e-9)
    assert row["unwarped"] > row["depth"]


def test_the_tables_show_the_figures_and_say_what_is_inferred(rig, tmp_path):
    left, said, _ = rig("servo", "notch", "--plot", tmp_path / "poles.svg")
    assert left == 0
    lines = said.splitlines()
    assert any("inside" in line and "282.84  0.141" in line and "45.49" in line for line in lines)
    assert any("upstream" in line and "336.26  0.927" in line for line in lines)
    assert "Inferred, not published" in said
    assert "Jm 0.5, Jlr 0.5 kg m²" in lines[0]
    assert "within 2 % of the step" in " ".join(said.split())
    assert "Notch sampled every 1 ms" in said
    assert next(line for line in lines if line.startswith("inside: ")).startswith(
        "inside: worse damped, damping ratio 0.251 instead of 0.391"
    )
    assert next(line for line in lines if line.startswith("upstream: ")).startswith(
        "upstream: better damped, damping ratio 0.927"
    )
    assert (tmp_path / "poles.svg").stat().st_size > 10_000
    assert "Fitted" in rig("servo", "notch", "--joint", "fitted")[1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--joint", "lifted"),
            "did you mean 'listed'? "
            "must be one of FILE.toml (its [model]), fitted, listed, normalised",
        ),
        (("--joint", "mine.toml"), "'mine.toml' cannot be read"),
        (
            ("--damping", "0"),
            "the pole pair of the joint at 282.843 rad/s is undamped; must be damped",
        ),
        (("--speed-loop", "-1"), "--speed-loop = -1.0; must be 0.001 to 1000"),
        (("--position-loop", "nan"), "--position-loop = nan; must be 0.0001 to 100"),
        (
            ("--joint", "listed", "--inertia-ratio", "2"),
            "--inertia-ratio 2 with --joint listed; must be with --joint normalised",
        ),
        (("--damping", "1.0"), "gives an overdamped joint; must be < 0.7071"),
        (("--speed-loop", "0"), "--speed-loop = 0.0; must be"),
        (("--notch-damping", "0.1"), "--notch-damping 0.1; must be > 0.1414"),
        (("--detune", "0"), "--detune = 0.0; must be 0.1 to 10"),
        (
            ("--sample-time", "0.02"),
            "frequency_rad_s = 282.843 rad/s with a sample time of 0.02 s; must be < 157.08 rad/s",
        ),
        (("--sample-time", "0"), "--sample-time = 0.0; must be"),
        (
            ("--speed-loop", "0.5", "--damping", "0.6"),
            "makes a speed loop without a complex pole pair",
        ),
        (("--plot", "poles.txt"), "must end in one of"),
        (("--plot", "nowhere/poles.svg"), "no folder 'nowhere'"),
    ],
)
def test_invalid_options_are_refused_with_the_bound(rig, words, said):
    left, out, err = rig("servo", "notch", *words)
    assert left == 2
    assert said in " ".join((out + err).split())
