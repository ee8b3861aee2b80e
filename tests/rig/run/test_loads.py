"""Runs in virtual time with loads of several links, and with moves along y and z."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from comms.messages import Truth
from rig.analysis.analyze import RunAnalysis
from rig.analysis.true_load import true_motion
from rig.errors import ConfigError, Refused
from rig.run import config, experiment
from rig.run.runs import LOG
from sim_rig.load import Load
from sim_rig.params import BenchParams, PendulumParams
from sim_rig.spatial_chain import LoadEvent

BRIEF = ["camera.rate_hz=0", "experiment.quiet_s=0.2", "experiment.watch_s=1.5"]
SAME = [*BRIEF, "bench.pendulum.length_m=1"]
TWO_MASSES = """
[experiment]
name = "two_masses"
quiet_s = 0.2
watch_s = 3.0
[move]
distance_m = 0.2
time_s = 2.5
[model]
links = ["0.392:0.35:point", "0.392:0.35:point"]
[camera]
rate_hz = 0
[[bench.links]]
length_m = 0.392
mass_kg = 0.35
[[bench.links]]
length_m = 0.392
mass_kg = 0.35
"""


def run(folder: Path, name: str, changes: list[str]) -> tuple[experiment.FinishedRun, RunAnalysis]:
    chosen = config.read_experiment(name, changes)
    ran = experiment.run(chosen, "virtual", folder, _quiet, _quiet)
    return ran, RunAnalysis(ran.folder / LOG)


def _quiet(*_: object) -> None:
    return None


@pytest.fixture
def two_masses(tmp_path: Path) -> str:
    file = tmp_path / "two_masses.toml"
    file.write_text(TWO_MASSES)
    return str(file)


def test_two_masses_come_to_rest_by_a_plan_for_both_modes(tmp_path: Path, two_masses: str) -> None:
    _, analysis = run(tmp_path / "runs", two_masses, [])
    s = analysis.summary
    assert (s.exit_code, s.verdict) == (0, "good")
    assert s.truth is not None
    assert s.truth.residual_swing_rad is not None
    assert s.truth.residual_swing_rad < 0.1e-3
    assert s.truth.peak_swing_rad == pytest.approx(s.planned.peak_swing_rad, rel=0.01)
    assert s.truth.natural_frequency_hz == pytest.approx(0.6095, abs=2e-4), "source 004: 0.61 Hz"
    assert s.truth.cable_length_m is None
    assert len(analysis.run.log.read("/truth", Truth)[0].links) == 2


@pytest.mark.parametrize("robot", ["cartesian", "ball_screw"])
def test_a_plan_for_one_mode_leaves_the_other(tmp_path: Path, two_masses: str, robot: str) -> None:
    """A cable of 0.669 m has the first frequency of the two masses."""
    kind = [f"bench.robot.kind={robot}"]
    _, right = run(tmp_path / "a", two_masses, kind)
    one = tmp_path / "one.toml"
    one.write_text(
        TWO_MASSES.replace("links = [", "links = [ # ", 1).replace(
            'links = [ # "0.392:0.35:point", "0.392:0.35:point"]',
            'links = ["0.334:0.35:point", "0.334:0.35:point"]',
        )
    )
    _, wrong = run(tmp_path / "b", str(one), kind)
    residuals = [
        one.summary.truth.residual_swing_rad for one in (right, wrong) if one.summary.truth
    ]
    assert residuals[0] is not None
    assert residuals[1] is not None
    assert residuals[0] < 0.1e-3
    assert residuals[1] > 1e-3


def test_a_move_along_y_leaves_what_one_along_x_does(tmp_path: Path) -> None:
    found = []
    for axis in ("x", "y"):
        _, analysis = run(tmp_path / axis, "move", [*SAME, f"move.axis={axis}"])
        assert analysis.summary.verdict == "good", analysis.summary.reasons
        assert analysis.summary.truth is not None
        assert analysis.summary.latency_ms.command == pytest.approx(57.9, abs=0.5)
        found.append(analysis.summary.truth)
    assert found[1].residual_swing_rad == pytest.approx(found[0].residual_swing_rad, abs=2e-7)
    assert found[1].peak_swing_rad == pytest.approx(found[0].peak_swing_rad, abs=1e-6)


def test_a_vertical_move_does_not_make_the_load_swing(tmp_path: Path) -> None:
    changes = ["move.axis=z", "move.distance_m=0.05", "experiment.planner=law"]
    _, analysis = run(tmp_path, "move", [*SAME, *changes])
    assert analysis.summary.verdict == "good", analysis.summary.reasons
    motion = true_motion(analysis.run)
    assert motion.tilt_rad.max() < 1e-12
    assert analysis.run.log.read("/truth", Truth)[-1].position_m[2] == pytest.approx(0.05, abs=1e-6)
    assert analysis.summary.planned.peak_swing_rad == 0.0


def test_a_push_by_hand_starts_a_swing_in_space(tmp_path: Path) -> None:
    push = "bench.pushes=[{at_s=1.0, duration_s=0.1, force_n=[0.7, 0.7, 0.0]}]"
    _, analysis = run(tmp_path, "free_decay", [*BRIEF, "experiment.watch_s=4", push])
    motion = true_motion(analysis.run)
    after = motion.t_s > 1.2
    assert abs(motion.angles_rad[after][:, 0, 1]).max() == pytest.approx(0.033, rel=0.1)


def test_a_cable_that_goes_slack_ends_the_run_and_says_so(tmp_path: Path) -> None:
    push = "bench.pushes=[{at_s=1.0, duration_s=0.3, force_n=[0.0, 0.0, 20.0]}]"
    ran, analysis = run(tmp_path, "free_decay", [*BRIEF, push])
    assert ran.outcome.exit_code == 5
    assert "bench: cable 1 of the load went slack at 1.6" in ran.outcome.reasons[0]
    assert analysis.summary.verdict == "bad"


def test_a_bar_that_swings_up_to_the_robot_ends_the_run(tmp_path: Path) -> None:
    """A bar of 0.1 m under a fast move of 0.2 m."""
    fast = ["move.time_s=0.35", "experiment.planner=law", "limits.acceleration_m_s2=40"]
    wide = ["limits.speed_m_s=9", "experiment.watch_s=3", "model.length_m=0.1"]
    bar = ["bench.pendulum={}", 'bench.links=[{length_m=0.1, mass_kg=0.7, kind="bar"}]']
    ran, _ = run(tmp_path, "move", [*BRIEF, *fast, *wide, *bar])
    assert ran.outcome.exit_code == 5
    assert "the load swung up to the robot" in ran.outcome.reasons[0]


def test_a_cable_in_its_plane_that_swings_up_to_the_robot_is_named() -> None:
    load = Load(BenchParams(pendulum=PendulumParams(length_m=0.1, initial_swing_rad=1.5)))
    still = [0.0] * 201
    with pytest.raises(LoadEvent, match="the load swung up to the robot"):
        load.advance(1e-3, [0.1 * k for k in range(201)], still, still)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (["move.axis=y"], "camera 1 follows the pivot along x alone"),
        ([*BRIEF, "move.axis=z"], "must be 'law'"),
        ([*BRIEF, "bench.links=[{length_m=0.5, mass_kg=1}]"], "beside [bench.pendulum]"),
        ([*BRIEF, "bench.load.gravity_m_s2=9.8"], "without [[bench.links]]"),
        ([*BRIEF, 'model.links=["0.5:1:point", "0.5:1:point"]'], "has 2 links"),
        ([*BRIEF, "bench.pushes=[{at_s=1, force_n=[1, 0, 0], link=2}]"], "must be <= 1"),
        ([*BRIEF, "bench.pushes=[{at_s=1, force_n=[0, 0, 0]}]"], "must have a component"),
    ],
)
def test_what_cannot_be_run_is_named_before_anything_moves(
    tmp_path: Path, changes: list[str], text: str
) -> None:
    with pytest.raises((ConfigError, Refused)) as caught:
        run(tmp_path, "move", changes)
    assert text in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_load_too_stiff_for_the_simulation_is_named(tmp_path: Path) -> None:
    stiff = TWO_MASSES.replace("mass_kg = 0.35\n[[", 'mass_kg = 0.001\nkind = "bar"\n[[').replace(
        "mass_kg = 0.35\n", 'mass_kg = 0.001\nkind = "bar"\njoint_stiffness_n_m_rad = 1e4\n'
    )
    file = tmp_path / "stiff.toml"
    file.write_text(stiff)
    with pytest.raises(ConfigError, match="lower joint_stiffness_n_m_rad"):
        run(tmp_path / "runs", str(file), [])


def test_a_cable_shortened_during_a_run_swings_at_its_new_length(tmp_path: Path) -> None:
    change = "bench.length_changes=[{at_s=0.5, duration_s=1.0, change_m=-0.18}]"
    _, analysis = run(tmp_path, "free_decay", [*BRIEF, "experiment.watch_s=8", change])
    motion = true_motion(analysis.run)
    late = motion.t_s > (analysis.run.t_start_s or 0.0) + 1.6
    angle = motion.angles_rad[late][:, 0, 0]
    signs = np.flatnonzero(np.diff(np.sign(angle)))
    crossings = motion.t_s[late][signs]
    half_s = float(np.mean(np.diff(crossings)))
    assert half_s == pytest.approx(np.pi * np.sqrt((0.9624 - 0.18) / 9.81), rel=5e-3)
    assert analysis.summary.truth is not None
    assert analysis.summary.truth.cable_length_m == pytest.approx(0.7824)


def test_the_camera_sees_a_cable_that_vibrates_and_its_average_lowers_it(tmp_path: Path) -> None:
    """The single frames scatter more than the average of three; the fit stays."""
    changes = ["experiment.quiet_s=0.6", "experiment.watch_s=4", "bench.pendulum.length_m=1"]
    found = []
    for name, cable in (("plain", []), ("nylon", ["bench.cable={damping_ratio=0.002}"])):
        _, analysis = run(tmp_path / name, "move", [*changes, *cable])
        assert analysis.summary.verdict == "good", analysis.summary.reasons
        found.append(analysis.summary.swing_error.during_move_rad or 0.0)
    assert found[1] > found[0]
