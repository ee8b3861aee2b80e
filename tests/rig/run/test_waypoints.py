"""Experiments through waypoints: the file, the motion, and the run."""

from __future__ import annotations

import numpy as np
import pytest

from comms.messages import RobotState
from planners.errors import PlanError
from rig.analysis.run_log import RunLog
from rig.errors import ConfigError, Refused
from rig.run import config, experiment
from rig.run.job import plan_move, prepare
from rig.run.runs import LOG
from rig.run.runtime import bench
from rig.run.waypoints import read_waypoints

PLAIN = "x_m,y_m,z_m\n0,0,0\n0.06,0.02,0.03\n0.12,0,0\n0.17,-0.02,0.02\n"
BRIEF = ["experiment.quiet_s=0.6", "experiment.watch_s=2.5", "move.time_s=4"]


@pytest.fixture
def through(tmp_path):
    """Experiment through the points of a text."""

    def make(text, *changes):
        file = tmp_path / "points.csv"
        file.write_text(text)
        return config.read_experiment("move", [*BRIEF, f"move.waypoints={file}", *changes])

    return make


@pytest.mark.parametrize("spline", ["b_spline_5", "b_spline_4", "cubic", "four_three_four"])
@pytest.mark.parametrize("allocation", ["root", "proportional", "equal"])
def test_every_axis_passes_the_points_at_common_times_and_rests_at_the_ends(
    through, spline, allocation
):
    plan = plan_move(through(PLAIN, f"move.spline={spline}", f"move.allocation={allocation}"))
    points = np.loadtxt(PLAIN.splitlines()[1:], delimiter=",")
    distances = np.linalg.norm(np.diff(points, axis=0), axis=1)
    shares = distances ** {"root": 0.5, "proportional": 1.0, "equal": 0.0}[allocation]
    times = np.append(0.0, 4.0 * np.cumsum(shares) / shares.sum())
    np.testing.assert_allclose(plan.motion.at(times), points, atol=1e-12)
    np.testing.assert_allclose(plan.motion.at([0.0, 4.0], 1), 0.0, atol=1e-9)
    assert plan.planner == spline
    assert plan.metrics.peak_swing_rad > 0.01


def test_times_of_the_file_are_kept_and_begin_when_the_move_does(through):
    plan = plan_move(through("t_s,x_m\n10,0\n11,0.05\n13,0.1\n"))
    assert plan.problem.time_s == 3.0
    assert plan.motion.at([0.0, 1.0, 3.0])[:, 0] == pytest.approx([0.0, 0.05, 0.1], abs=1e-12)
    assert not plan.motion.at([0.5, 2.0])[:, 1:].any()


def test_a_relative_path_starts_at_the_experiment_file(tmp_path, monkeypatch):
    (tmp_path / "points.csv").write_text(PLAIN)
    (tmp_path / "mine.toml").write_text(
        '[experiment]\nname = "mine"\n[move]\nwaypoints = "points.csv"\ntime_s = 4\n'
    )
    monkeypatch.chdir("/")
    assert plan_move(config.read_experiment(str(tmp_path / "mine.toml"), [])).problem.time_s == 4.0


def test_the_robot_runs_through_the_points_in_three_axes(through, tmp_path):
    chosen = through(PLAIN)
    ran = experiment.run(chosen, "virtual", tmp_path / "runs", lambda *_: None, lambda *_: None)
    assert ran.outcome.exit_code == 0
    actual = np.array(
        [
            state.actual_m
            for state in RunLog.open(ran.folder / LOG).log.read("/robot_state", RobotState)
        ]
    )
    points = np.loadtxt(PLAIN.splitlines()[1:], delimiter=",")
    for point in points:
        assert (
            np.linalg.norm(actual - point, axis=1).min() < 2e-3
        )  # the interpolator cuts corners of 30 ms
    np.testing.assert_allclose(actual[-1], points[-1], atol=1e-4)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x_m\n0\n", "1 points; must be >= 2 below a header line t_s,x_m,y_m,z_m"),
        ("x_m,w_m\n0,0\n1,1\n", "column 'w_m'.*must be of t_s, x_m, y_m, z_m"),
        ("y_m\n0\n1\n", "columns y_m; must hold x_m"),
        ("x_m,x_m\n0,0\n1,1\n", "columns x_m, x_m; must hold x_m, and each at most once"),
        ("x_m,y_m\n0,0\n1\n", "line 3: 1 entries; must be 2"),
        ("x_m\n0\nfar\n", "line 3, x_m: 'far'; must be a finite number"),
        ("# by hand\n\nx_m\n0\nnan\n", "line 5, x_m: 'nan'; must be a finite number"),
    ],
)
def test_a_file_that_is_no_list_of_points_is_refused_by_line_and_column(tmp_path, text, expected):
    file = tmp_path / "points.csv"
    file.write_text(text)
    with pytest.raises(ConfigError, match=expected):
        read_waypoints(file)


@pytest.mark.parametrize(
    ("text", "changes", "expected"),
    [
        (
            "x_m\n0.1\n0.2\n0.3\n",
            [],
            r"the first is at \[0.1, 0.0, 0.0\] m; must be at \[0.0, 0, 0\]",
        ),
        ("t_s,x_m\n0,0\n2,0.1\n1,0.2\n", [], "line 4, t_s: 1 after 2; must increase"),
        ("x_m\n0\n0\n0.1\n", [], "points 0 and 1 are both at .* must be > 0"),
        (PLAIN, ["move.spline=b_spline"], "spline = 'b_spline'; did you mean"),
    ],
)
def test_points_that_make_no_motion_are_refused_by_name(through, text, changes, expected):
    with pytest.raises((ConfigError, PlanError), match=expected):
        plan_move(through(text, *changes))


def test_a_motion_that_leaves_the_workspace_is_refused_before_it_starts(through):
    chosen = through("x_m\n0\n0.4\n0.1\n")
    with pytest.raises(Refused, match=r"the plan leaves the \[safety\] envelope"):
        prepare(chosen, plan_move(chosen), bench.plant(chosen))


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"waypoints '.*nowhere.csv' cannot be read"):
        plan_move(config.read_experiment("move", [f"move.waypoints={tmp_path / 'nowhere.csv'}"]))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x_m,y_m\n0,0\n0.05,0.3\n0.1,0\n", r"y = 0\.\d+ m; must be within \+-0\.25 m"),
        ("x_m,z_m\n0,0\n0.05,-0.2\n0.1,0\n", r"z = -0\.\d+ m; must be within \+-0\.1 m"),
    ],
)
def test_depth_and_height_have_bounds_of_their_own(through, text, expected):
    chosen = through(text)
    with pytest.raises(Refused, match=expected):
        prepare(chosen, plan_move(chosen), bench.plant(chosen))


def test_limits_are_those_of_the_motion_in_space(through):
    aside = through("x_m,y_m\n0,0\n0,0.1\n0,0.2\n", "move.time_s=0.6")
    plan = plan_move(aside)
    assert plan.metrics.peak_speed_m_s == pytest.approx(plan.motion.y.peak(1).value)
    assert plan.metrics.peak_swing_rad == 0.0
    tight = through("x_m,y_m\n0,0\n0,0.1\n0,0.2\n", "move.time_s=0.6", "limits.acceleration_m_s2=2")
    with pytest.raises(Refused, match=r"the plan exceeds \[limits\]: peak acceleration"):
        prepare(tight, plan_move(tight), bench.plant(tight))


def test_the_record_says_how_far_the_points_go(through):
    chosen = through("x_m,y_m\n0,0\n0.1,0.1\n0,0.2\n", "camera.rate_hz=0")
    assert prepare(chosen, plan_move(chosen), bench.plant(chosen)).plan.distance_m == 0.0


def test_a_planner_beside_waypoints_is_refused(rig, tmp_path):
    (tmp_path / "points.csv").write_text(PLAIN)
    code, _, why = rig(
        "run",
        "move",
        "--virtual",
        "--planner",
        "zvd",
        "--set",
        f"move.waypoints={tmp_path / 'points.csv'}",
    )
    assert code == 2
    assert "--planner zvd with [move] waypoints; must be without: [move] spline plans a move" in why
