"""A run is concluded in one sentence; a cause is named only where it explains the measurement."""

from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rig.analysis.analyze import RunAnalysis
from rig.analysis.conclusion import conclude, predicted_residual_rad
from rig.run import experiment
from rig.run.config import read_experiment
from rig.run.runs import LOG

OLD_LOG = Path(__file__).parents[2] / "data" / "logs" / "e295f92_move_virtual.mcap"
BRIEF = ["experiment.quiet_s=0.6", "experiment.watch_s=6"]


@pytest.fixture(scope="module")
def analysed(tmp_path_factory):
    """Analyse a short virtual run of an experiment with these changes."""
    folder = tmp_path_factory.mktemp("runs")

    def analyse(name, *changes, command=""):
        chosen = read_experiment(name, [*BRIEF, *changes])
        nothing = lambda *_: None  # noqa: E731
        ran = experiment.run(chosen, "virtual", folder, nothing, nothing, command=command)
        return RunAnalysis(ran.folder / LOG)

    return analyse


def concluded(analysis):
    """Conclusion of an analysed run."""
    return conclude(analysis.run, analysis.summary)


def test_a_shorter_cable_is_named_as_the_cause_with_the_setting_and_the_command(analysed):
    found = concluded(analysed("move", command="rig run move --virtual"))
    assert found.sentence == (
        "The load keeps 2.7 mrad instead of 0.4 mrad because its cable is 20 mm shorter than the "
        "model's."
    )
    assert found.setting.toml == "[model] length_m = 0.980"
    assert found.command == "rig run move --virtual --set model.length_m=0.980"


def test_a_run_with_the_right_model_keeps_what_was_planned(analysed):
    found = concluded(analysed("move", "model.length_m=0.98"))
    assert found.sentence.startswith("The load keeps 0.")
    assert "as planned" in found.sentence
    assert (found.setting, found.command) == (None, "")


def test_lost_references_are_not_blamed_on_the_cable(analysed):
    found = concluded(analysed("dropouts", "experiment.seed=1"))
    assert "references were lost on their way, and its cable is 20 mm shorter" in found.sentence
    assert "because" not in found.sentence


def test_a_cause_that_does_not_explain_the_swing_is_not_named():
    analysis = RunAnalysis(OLD_LOG)
    measured = msgspec.structs.replace(analysis.summary.measured, residual_swing_rad=0.009)
    summary = msgspec.structs.replace(analysis.summary, measured=measured)
    found = conclude(analysis.run, summary)  # 20 mm of cable leave 2.6 mrad, not 9
    assert found.sentence.endswith("; the cause is not identifiable from this run.")
    assert found.setting.toml == "[model] length_m = 0.980"


def test_a_load_that_swung_before_the_move_is_said_to_have(analysed):
    found = concluded(
        analysed("move", "model.length_m=0.98", "bench.pendulum.initial_swing_rad=0.006")
    )
    assert "it swung 6.0 mrad before the move" in found.sentence
    assert found.setting is None


def test_a_free_decay_names_its_frequency_and_the_error_of_the_length(analysed):
    found = concluded(analysed("free_decay", "experiment.watch_s=10"))
    assert found.sentence == (
        "The load swings at 0.5081 Hz; its cable is 38 mm shorter than the model's."
    )


def test_a_run_without_a_camera_says_so_and_tells_the_truth(analysed):
    found = concluded(analysed("move", "camera.rate_hz=0"))
    assert found.sentence == (
        "The run had no camera; the swing was not measured. In truth the load keeps 2.66 mrad, "
        "0.37 mrad planned."
    )


def test_a_bad_run_is_concluded_by_its_reason():
    analysis = RunAnalysis(OLD_LOG)
    bad = msgspec.structs.replace(analysis.summary, verdict="bad", reasons=["the log is cut"])
    sentence = conclude(analysis.run, bad).sentence
    assert sentence == "The run gave no valid result: the log is cut."


def test_a_log_without_a_recorded_command_is_repeated_by_its_experiment():
    found = concluded(RunAnalysis(OLD_LOG))
    assert found.command == "rig run move --set model.length_m=0.980"


@pytest.mark.parametrize("length_m", [0.7, 0.98, 1.3])
def test_the_predicted_residual_is_that_of_the_linear_pendulum(length_m):
    run = RunAnalysis(OLD_LOG).run
    x_m = np.array([position[0] for position in run.plan.positions_m])
    t_s = 0.01 * np.arange(x_m.size)
    speed = np.gradient(x_m, t_s)
    omega2 = 9.81 / length_m

    def rates(t, state):
        # with p = theta' + v / L the acceleration of the platform drops out
        v = np.interp(t, t_s, speed)
        return [state[1] - v / length_m, -omega2 * state[0]]

    end = solve_ivp(rates, (0, t_s[-1]), [0.0, 0.0], max_step=0.01, rtol=1e-8).y[:, -1]
    amplitude = np.hypot(end[0], end[1] / np.sqrt(omega2))
    assert predicted_residual_rad(run, length_m) == pytest.approx(amplitude, rel=0.02, abs=5e-5)
