"""Loads of several links in the study of source 004: modes, shapers, and what a camera sees."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from planners.models.chain import ChainModel, parse_links
from rig.analysis.analyze import RunAnalysis
from rig.run import config, experiment
from rig.run.load_model import planner_model
from rig.run.runs import LOG
from rig.studies.source_004.free_modes import natural_frequencies_hz
from rig.studies.source_004.measured_modes import fit_modes, largest_link_swing
from rig.studies.source_004.spec import choose
from rig.studies.source_004.study import Source004Study, study
from rig.ui.source004_page import document
from rig.ui.source004_rows import finding_rows, heading, run_rows

G_M_S2 = 9.81
SEGMENT_M = 0.392
TWO_MASSES_HZ = [  # two equal masses on two equal segments, in closed form
    math.sqrt((2.0 - math.sqrt(2.0)) * G_M_S2 / SEGMENT_M) / (2.0 * math.pi),
    math.sqrt((2.0 + math.sqrt(2.0)) * G_M_S2 / SEGMENT_M) / (2.0 * math.pi),
]
PRINTED_HZ = [0.6748, 2.6420]  # source 004, section 4.3
EQUIVALENT_MASS_KG = 19.5223
BAR_M, BAR_KG, JOINT_N_M_RAD = 0.5, 3.375, 10.0
AXIS = "source004_ch4_2s5_axis"


def two_bars() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass and stiffness matrix, and coupling, of the two bars: source 004, (4.1.6)."""
    half, inertia = BAR_KG * BAR_M / 2.0, BAR_KG * BAR_M**2
    mass = inertia * np.array([[4.0 / 3.0, 0.5], [0.5, 1.0 / 3.0]])
    spring = JOINT_N_M_RAD * np.array([[1.0, -1.0], [-1.0, 1.0]])
    coupling = np.array([3.0 * half, half])
    return mass, spring + G_M_S2 * np.diag(coupling), coupling


def modes(mass: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Natural frequencies [rad/s], slowest first, and mode shapes in columns."""
    squares, shapes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    order = np.argsort(squares)
    return np.sqrt(squares[order]), shapes[:, order]


def test_modes_are_found_in_a_damped_swing_of_any_mixture() -> None:
    t_s = np.arange(0.0, 5.0, 0.01)
    angles = np.zeros((t_s.size, 2))
    rates = np.zeros((t_s.size, 2))
    for hz, share, ratio in zip(TWO_MASSES_HZ, (1.0, 1e-3), (2**0.5, -(2**0.5)), strict=True):
        mu = 2.0 * math.pi * hz * complex(-0.01, math.sqrt(1.0 - 1e-4))
        q = share * np.exp(mu * t_s)
        angles += np.outer(q.real, [1.0, ratio])
        rates += np.outer((mu * q).real, [1.0, ratio])
    assert natural_frequencies_hz(t_s, angles, rates) == pytest.approx(TWO_MASSES_HZ, rel=1e-8)


def test_too_few_samples_have_no_modes() -> None:
    nothing = np.zeros((5, 2))
    assert natural_frequencies_hz(np.arange(5.0), nothing, nothing) == ()


@pytest.fixture(scope="module")
def figure_4_19() -> Source004Study:
    """Free decay of two masses."""
    return study(choose(["4.19"]), lambda done: None)


def test_the_two_masses_swing_at_the_published_frequencies(figure_4_19: Source004Study) -> None:
    (row,) = figure_4_19.figures
    assert [result.agreement for result in row.results] == ["yes", "yes"]
    (run,) = figure_4_19.runs.values()
    for name, hz in zip(("frequency_1", "frequency_2"), TWO_MASSES_HZ, strict=True):
        assert run.values[name]["true"].value == pytest.approx(hz, rel=3e-4)


def test_the_camera_measures_both_modes_on_the_first_link(figure_4_19: Source004Study) -> None:
    (row,) = figure_4_19.figures
    (run,) = figure_4_19.runs.values()
    assert {check.basis for result in row.results for check in result.checks} == {
        "true",
        "measured",
    }
    for name, hz in zip(("frequency_1", "frequency_2"), TWO_MASSES_HZ, strict=True):
        measured = run.values[name]["measured"]
        assert measured.value == pytest.approx(hz, rel=3e-4)
        assert 0.0 < measured.sigma < 1e-4
    residual = run.values["residual_swing"]
    assert residual["measured"].value == pytest.approx(residual["true"].value, rel=2e-3)
    for shown in finding_rows(row, figure_4_19.runs):
        assert shown[2].endswith("Hz, true")
    ((_, true, measured_text, _),) = run_rows(tuple(figure_4_19.runs), figure_4_19.runs)
    assert measured_text.startswith(true[:4])


def test_a_quantity_that_the_camera_does_not_see_is_marked(figure_4_19: Source004Study) -> None:
    (run,) = figure_4_19.runs.values()
    assert "measured" not in run.values["peak_swing"]
    values = {}
    for name, bases in run.values.items():
        values[name] = {basis: value for basis, value in bases.items() if basis != "measured"}
    unseen = msgspec.structs.replace(run, values=values)
    (row,) = figure_4_19.figures
    runs = dict.fromkeys(figure_4_19.runs, unseen)
    for shown in finding_rows(row, runs):
        assert shown[2].endswith("Hz, true; camera: not yet")
    ((_, _, measured, _),) = run_rows(tuple(runs), runs)
    assert measured == "camera: not yet"
    page = document(msgspec.structs.replace(figure_4_19, runs=runs))
    assert page.count("camera: not yet") == 3


def test_two_modes_are_measured_in_the_swing_of_one_link_within_their_sigma() -> None:
    rng = np.random.default_rng(7)
    t_s = np.arange(0.0, 4.0, 0.02)
    true = ((0.6, 5e-3, 0.001, 0.4), (2.4, 1e-3, 0.003, -1.0))
    swing = 1e-4 + 5e-6 * rng.normal(size=t_s.size)
    for hz, amplitude, zeta, phase in true:
        omega = 2.0 * math.pi * hz
        damped = omega * math.sqrt(1.0 - zeta**2)
        swing += amplitude * np.exp(-zeta * omega * t_s) * np.cos(damped * t_s + phase)
    modes = fit_modes(t_s, swing, [0.62, 2.3])
    for mode, (hz, amplitude, _, _) in zip(modes, true, strict=True):
        assert mode.frequency_hz == pytest.approx(hz, abs=4.0 * mode.sigma_frequency_hz)
        assert mode.amplitude_rad == pytest.approx(amplitude, abs=4.0 * mode.sigma_amplitude_rad)
        assert mode.sigma_frequency_hz < 2e-3 * hz
    shapes = np.array([[1.0, 0.5], [1.4, -1.0]])
    swing_rad, sigma_rad = largest_link_swing(modes, shapes)
    assert swing_rad == pytest.approx(1.4 * 5e-3 + 2.0 * 1e-3, abs=4.0 * sigma_rad)


def test_a_mode_that_is_lost_in_the_noise_has_no_frequency() -> None:
    rng = np.random.default_rng(7)
    t_s = np.arange(0.0, 4.0, 0.02)
    swing = 1e-3 * np.cos(2.0 * math.pi * 0.6 * t_s) + 5e-6 * rng.normal(size=t_s.size)
    first, second = fit_modes(t_s, swing, [0.6, 2.4])
    assert first.frequency_hz == pytest.approx(0.6, abs=1e-3)
    assert second.frequency_hz is None
    assert fit_modes(t_s[:30], swing[:30], [0.6, 2.4]) == ()


def test_a_table_of_the_source_is_headed_as_one() -> None:
    (figure,) = choose(["tab. 4.3"])
    assert heading(figure).startswith("Table 4.3: two bars")
    assert set(figure.experiments) == {f"{AXIS}{end}" for end in ("", "_zv", "_tuned", "_free")}


def test_the_printed_frequencies_are_those_of_a_platform_that_rolls_freely() -> None:
    mass, stiffness, coupling = two_bars()
    total_kg = EQUIVALENT_MASS_KG + 2.0 * BAR_KG
    free, _ = modes(mass - np.outer(coupling, coupling) / total_kg, stiffness)
    driven, _ = modes(mass, stiffness)
    np.testing.assert_allclose(free / (2.0 * math.pi), PRINTED_HZ, rtol=1.5e-3)
    assert driven[0] < 0.91 * free[0]


@pytest.mark.parametrize(
    ("name", "half_periods_s", "rel"),
    [
        ("free", [0.5 / hz for hz in PRINTED_HZ], 1e-6),
        ("tuned", [0.820, 0.1887], 1e-6),
        ("zv", [0.822425, 0.192744], 1e-5),
    ],
)
def test_the_shapers_have_the_delays_that_the_files_state(
    name: str, half_periods_s: list[float], rel: float
) -> None:
    model = planner_model(config.read_experiment(f"{AXIS}_{name}", []))
    found = [math.pi / mu.imag for mu in model.oscillatory_eigenvalues_1_s]
    assert found == pytest.approx(half_periods_s, rel=rel)


def predicted_residual_rad(half_periods_s: list[float]) -> float:
    """Largest angle of a bar after the move, the sum over the modes, in closed form.

    ZV shapers with two delays, convolved with the harmonic law, 0.2 m in 2.5 s: each shaper
    multiplies the swing of a mode of w by |cos(w delay / 2)|.
    """
    law_s = 2.5 - sum(half_periods_s)
    law_rad_s = math.pi / law_s
    peak_m_s2 = 0.2 / 2.0 * law_rad_s**2
    mass, stiffness, coupling = two_bars()
    rates_rad_s, shapes = modes(mass, stiffness)
    inputs = np.linalg.solve(shapes, np.linalg.solve(mass, coupling))
    swing = np.zeros(2)
    for w, shape, gain in zip(rates_rad_s, shapes.T, inputs, strict=True):
        unshaped = 2.0 * peak_m_s2 * math.cos(w * law_s / 2.0) / (law_rad_s**2 - w**2)
        shaped = unshaped * math.prod(math.cos(w * delay_s / 2.0) for delay_s in half_periods_s)
        swing += np.abs(shape * gain * shaped)
    return float(swing.max())


@pytest.mark.parametrize(
    ("name", "half_periods_s"),
    [("free", [0.5 / hz for hz in PRINTED_HZ]), ("tuned", [0.820, 0.1887])],
)
def test_mistuned_shapers_leave_what_the_theory_predicts(
    tmp_path: Path, name: str, half_periods_s: list[float]
) -> None:
    chosen = config.read_experiment(f"{AXIS}_{name}", ["bench.robot.kind=cartesian"])
    ran = experiment.run(chosen, "virtual", tmp_path, _quiet, _quiet)
    truth = RunAnalysis(ran.folder / LOG).summary.truth
    assert truth is not None
    expected = predicted_residual_rad(half_periods_s)
    assert truth.residual_swing_rad == pytest.approx(expected, rel=0.02)


def test_shapers_for_the_driven_modes_leave_nothing_on_a_linear_lag(tmp_path: Path) -> None:
    """The bound is that of the note of table 4.3."""
    chosen = config.read_experiment(f"{AXIS}_zv", ["bench.robot.kind=cartesian"])
    ran = experiment.run(chosen, "virtual", tmp_path, _quiet, _quiet)
    truth = RunAnalysis(ran.folder / LOG).summary.truth
    assert truth is not None
    assert truth.residual_swing_rad is not None
    assert truth.residual_swing_rad < 0.01e-3
    (figure,) = choose(["tab. 4.3"])
    assert "less than 0.01 mrad" in figure.findings[-1].note.replace("\n", " ")


def test_the_three_bars_are_those_of_the_assumption() -> None:
    chosen = config.read_experiment("source004_ch5_2s_acceleration", [])
    model = planner_model(chosen)
    assert isinstance(model, ChainModel)
    assert model.links == parse_links(",".join(["0.3:2.025:bar"] * 3))
    assert model.stiffness_n_m_rad == (10.0, 10.0)
    assert model.tip_mass_kg == 1.0


def _quiet(*_: object) -> None:
    return None
