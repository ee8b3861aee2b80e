"""Trade-off of the controllers: front, knobs, peak sensitivity, command."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from planners.errors import PlanError
from rig.errors import ConfigError
from rig.run.joint.controllers import CONTROLLERS
from rig.studies.servo.compare import build_drives, compare
from rig.studies.servo.pareto import KNOBS, TradeOffPoint, front, sweep
from rig.studies.servo.spec import read_spec

SPEC = read_spec(None)
SHORT = (
    "--set", "move=[{load_angle_deg=30.0, time_s=0.5, motor_acceleration_rad_s2=900.0}]",
    "--set", "watch_s=0.3",
)  # fmt: skip
pairs = st.tuples(st.integers(1, 9), st.integers(1, 9))


def points(figures):
    return [TradeOffPoint("pid", k, float(m), float(r)) for k, (m, r) in enumerate(figures)]


# the front


@given(st.lists(pairs, max_size=12))
def test_no_point_of_the_front_is_dominated_and_every_other_one_is(figures):
    given_points = points(figures)
    best = front(given_points)
    for point in given_points:
        m, r = point.peak_sensitivity, point.residual
        better = [p for p in given_points if p.peak_sensitivity <= m and p.residual <= r]
        dominated = any((p.peak_sensitivity, p.residual) != (m, r) for p in better)
        assert (point in best) == (not dominated)


@given(st.lists(pairs, min_size=1, max_size=12))
def test_the_residual_never_rises_along_the_front(figures):
    best = front(points(figures))
    assert best
    assert [p.peak_sensitivity for p in best] == sorted(p.peak_sensitivity for p in best)
    residuals = [p.residual for p in best]
    assert residuals == sorted(residuals, reverse=True)


def test_a_refused_point_is_on_no_front():
    refused = TradeOffPoint("pid", 1.0, refusal="unstable on the joint model")
    (good,) = points([(5, 5)])
    assert front([refused, good]) == [good]
    assert front([refused]) == []


# the knobs


def test_every_controller_has_a_knob_that_changes_the_specification():
    assert list(KNOBS) == list(CONTROLLERS)
    for knob in KNOBS.values():
        assert knob.low < knob.high
        assert knob.apply(SPEC, knob.low) != knob.apply(SPEC, knob.high)


@pytest.mark.parametrize("name", [name for name in KNOBS if name != "assigned"])
def test_a_knob_is_a_key_of_the_file_and_its_shipped_value_lies_in_the_range(name):
    knob = KNOBS[name]
    section, key = knob.name.split(".")
    assert knob.low < getattr(getattr(SPEC, section), key) < knob.high
    changed = getattr(getattr(knob.apply(SPEC, knob.low), section), key)
    assert changed == knob.low


def test_the_scale_of_the_eigenvalues_leaves_their_damping_and_the_observer():
    changed = KNOBS["assigned"].apply(SPEC, 2.0).assigned
    assert np.array(changed.poles_1_s) == pytest.approx(2.0 * np.array(SPEC.assigned.poles_1_s))
    assert changed.estimator_poles_1_s == SPEC.assigned.estimator_poles_1_s


def test_values_of_a_knob_are_spaced_geometrically_and_have_four_digits():
    values = KNOBS["lqg"].values(5)
    assert values == [0.01, 0.1, 1.0, 10.0, 100.0]
    assert KNOBS["pid"].values(3)[1] == 1.414


# the figures


def sensitivity_on_a_grid(spec, name):
    """Compute max |1 / (1 + L)| on a grid of frequencies up to the Nyquist frequency.

    With the joint held for a sample by a matrix exponential.
    """
    period_s = spec.drive.period_s
    drive = build_drives(spec, [name])[name]
    whole = np.zeros((5, 5))
    whole[:4, :4], whole[:4, 4] = spec.joint.state_matrix, spec.joint.input_matrix[:, 0]
    step = expm(whole * period_s)
    a, b = step[:4, :4], step[:4, 4]
    controller = drive.loop
    column = controller.find_input("motor_angle")
    largest = 0.0
    for omega in np.geomspace(0.1, np.pi / period_s, 4000):
        z = np.exp(1j * omega * period_s)
        plant = np.linalg.solve(z * np.eye(4) - a, b)[0]
        states = z * np.eye(controller.nstates) - controller.A
        inner = controller.C @ np.linalg.solve(states, controller.B[:, column])
        loop = -plant * (inner[0] + controller.D[0, column])
        largest = max(largest, abs(1.0 / (1.0 + loop)))
    return largest


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_point_has_the_sensitivity_of_the_sampled_loop_and_the_residual_of_the_comparison(name):
    found = list(sweep(SPEC, ["listed"], [name], 3))
    point = found[1]
    spec = KNOBS[name].apply(SPEC, point.value)
    assert point.peak_sensitivity == pytest.approx(sensitivity_on_a_grid(spec, name), rel=1e-3)
    runs = compare(spec, ["listed"], build_drives(spec, [name]))
    assert point.residual == max(run.outcome.residual for run in runs)


def test_the_residual_is_the_largest_of_the_plant_variants():
    alone = {
        variant: next(iter(sweep(SPEC, [variant], ["pid"], 2)))
        for variant in ("listed", "friction")
    }
    both = next(iter(sweep(SPEC, ["listed", "friction"], ["pid"], 2)))
    assert both.residual == max(point.residual for point in alone.values())
    assert both.peak_sensitivity == alone["listed"].peak_sensitivity


def test_a_loop_that_is_unstable_or_a_design_that_is_not_possible_is_named_without_figures():
    *_, last = sweep(SPEC, ["listed"], ["pid"], 2)
    assert last == TradeOffPoint("pid", 10.0, refusal="unstable on the joint model")
    damped = read_spec(None, ["model.elastic_damping_n_m_s_rad=0.5"])
    first = next(iter(sweep(damped, ["listed"], ["pid_notch"], 2)))
    assert first.refusal.startswith("not possible: pid_notch on a loop that does not oscillate")
    assert first.residual is None


def test_a_load_that_does_not_arrive_is_named_without_figures():
    weak = read_spec(None, ["drive.torque_limit_n_m=0.3", "bench.coulomb_torque_n_m=0.2"])
    first = next(iter(sweep(weak, ["listed"], ["lqg"], 2)))
    assert first.refusal == "did not arrive: 40° in 0.5 s, plant variant listed"


@pytest.mark.parametrize(
    ("variants", "names", "count", "error", "said"),
    [
        (["listed"], ["lqr"], 3, PlanError, "did you mean 'lqg'"),
        (["fited"], ["lqg"], 3, ConfigError, "did you mean 'fitted'"),
        (["listed"] * 50, list(KNOBS), 200, ConfigError, "must be <= 2e"),
    ],
)
def test_an_impossible_sweep_is_refused_before_its_first_point(variants, names, count, error, said):
    with pytest.raises(error, match=said):
        sweep(SPEC, variants, names, count)


# the command


def test_the_command_shows_every_controller_within_eighty_columns(rig, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, said, told = rig("servo", "compare", "--pareto", "--points", "2", *SHORT)
    assert code == 0
    assert max(map(len, (said + told).splitlines())) <= 80
    for name, knob in KNOBS.items():
        assert f"\n{name} " in said
        assert knob.name in said
    assert "dropped" not in said
    assert "pid at pid.speed_crossover = 10: unstable on the joint model" in said
    assert "points of the trade-off: 16" in told
    assert " yes" in said


def test_the_document_has_every_point_and_the_picture_is_written(rig, tmp_path):
    picture = tmp_path / "p.png"
    words = ("--pareto", "--points", "2", "--controllers", "pid,pid_ff", "--json", *SHORT)
    code, said, _ = rig("servo", "compare", *words, "--plot", picture)
    document = json.loads(said)
    assert code == 0
    assert document["truths"] == ["listed"]
    assert [row["controller"] for row in document["points"]] == ["pid"] * 2 + ["pid_ff"] * 2
    assert [row["on_front"] for row in document["points"]] == [False, False, True, False]
    assert document["points"][1]["residual"] is None
    assert document["knobs"]["pid"]["high"] == KNOBS["pid"].high
    assert picture.stat().st_size > 10_000


def test_a_picture_has_the_stable_points_alone_and_log_axes_for_wide_ranges():
    from rig.ui.plots.servo_pareto import draw_trade_off

    rated = [TradeOffPoint("pid", 1.0, 1.2, 0.1), TradeOffPoint("lqg", 1.0, 1.5, 0.001)]
    unstable = TradeOffPoint("pid", 2.0, refusal="unstable on the joint model")
    (panel,) = draw_trade_off([*rated, unstable], rated).axes
    curves = {line.get_label(): line for line in panel.get_lines()}
    assert curves["pid"].get_xydata().tolist() == [[1.2, 10.0]]
    assert curves["front"].get_xydata().tolist() == [[1.2, 10.0], [1.5, pytest.approx(0.1)]]
    assert (panel.get_xscale(), panel.get_yscale()) == ("linear", "log")


def test_without_any_stable_point_the_data_are_not_good(rig):
    words = ("--pareto", "--points", "2", "--controllers", "pid", *SHORT)
    code, said, _ = rig("servo", "compare", *words, "--set", "bench.torque_limit_n_m=0.1")
    assert code == 6
    assert "pid at pid.speed_crossover = 0.2: did not arrive" in said


def test_points_without_pareto_are_refused(rig):
    code, said, told = rig("servo", "compare", "--points", "3")
    assert (code, said) == (2, "")
    assert "--points 3 without --pareto; must go with it: add --pareto" in told
