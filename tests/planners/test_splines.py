"""Motions through several points, against the figures of the sources, scipy and properties."""

from __future__ import annotations

import math
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BarycentricInterpolator, CubicSpline, make_interp_spline
from scipy.optimize import brute

from planners.errors import Infeasible, NotConverged, PlanError
from planners.splines import SPLINES
from planners.splines.allocation import ALLOCATIONS, allocate
from planners.splines.analysis import analyse
from planners.splines.b_spline import b_spline
from planners.splines.blends import parabolic_blends
from planners.splines.chain import Spline, Straight, chain, dwell
from planners.splines.cubic import clamped, natural, periodic
from planners.splines.extremes import extremes
from planners.splines.four_three_four import four_three_four
from planners.splines.limits import AxisLimits
from planners.splines.minimum_time import SHAPES, minimum_time
from planners.splines.n_point import conditioning, n_point
from planners.splines.points import End
from planners.splines.shape_search import ShapeSearch
from planners.trajectories.cells import Polynomials
from planners.trajectories.motion import Motion
from planners.trajectories.trajectory import Trajectory

DATA = tomllib.loads((Path(__file__).parents[1] / "data" / "splines.toml").read_text())
CASE = DATA["case"]
LIMITS = AxisLimits(speed_m_s=CASE["speed_m_s"], acceleration_m_s2=CASE["acceleration_m_s2"])
RESTING = ("cubic", "four_three_four", "b_spline_4", "b_spline_5")
# highest continuous derivative, against rest at both ends and inside
CONTINUOUS = {"cubic": 1, "four_three_four": 2, "b_spline_4": 2, "b_spline_5": 2}
SMOOTH = {"cubic": 2, "four_three_four": 2, "b_spline_4": 3, "b_spline_5": 4}

gaps = st.lists(st.floats(0.2, 3.0), min_size=2, max_size=7)
heights = st.floats(-3.0, 3.0)


@st.composite
def paths(draw):
    h = draw(gaps)
    q = draw(st.lists(heights, min_size=len(h) + 1, max_size=len(h) + 1))
    return np.concatenate([[0.0], np.cumsum(h)]), np.array(q)


def steps(move, order):
    """Compute the steps of a derivative at the joints."""
    ends = [[float(p.at(np.array(t), order)) for t in (0.0, p.duration_s)] for p in move.pieces]
    return np.array([b[0] - a[1] for a, b in pairwise(ends)])


@pytest.mark.parametrize("row", range(len(DATA["conditioning"]["points"])))
def test_powers_of_time_amplify_rounding_as_printed_and_centred_chebyshev_polynomials_do_not(row):
    table = DATA["conditioning"]
    n, tolerance = table["points"][row], table["tolerance"][row]
    found = conditioning(n)
    assert found.powers == pytest.approx(table["printed"][row], rel=tolerance)
    assert found.powers == pytest.approx(
        table["right"][row], rel=1e-10 if n <= 6 else 1e-9 if n == 10 else 5e-2
    )
    assert found.chebyshev < found.centred < found.powers


@pytest.mark.parametrize("n", [2, 3, 7, 15, 20])
def test_the_n_point_polynomial_is_the_barycentric_one(n):
    t = 100.0 + np.linspace(0.0, 3.0, n)
    t[1:-1] += np.random.default_rng(n).uniform(-0.2, 0.2, n - 2) * 3.0 / n
    q = np.sin(t) + t / 50.0
    move, other = n_point(t, q), BarycentricInterpolator(t - 101.5, q)
    x = np.linspace(0.0, 3.0, 301)
    np.testing.assert_allclose(move.at(x), other(x - 1.5), atol=1e-9 * np.abs(other(x - 1.5)).max())
    np.testing.assert_allclose(move.at(t - 100.0), q, rtol=1e-11)


def test_twenty_points_of_a_low_degree_give_that_polynomial_back_with_its_derivatives():
    t = np.linspace(50.0, 54.0, 20)
    p = np.polynomial.Polynomial([0.3, -1.0, 0.5, 0.2])
    move = n_point(t, p(t - 50.0))
    for order in range(4):
        x = np.linspace(0.0, 4.0, 77)
        np.testing.assert_allclose(
            move.at(x, order), (p.deriv(order) if order else p)(x), atol=1e-7
        )
    assert move.peak(1).value == pytest.approx(abs(p.deriv()(4.0)), rel=1e-9)


def test_the_seven_point_cubic_is_the_one_of_the_source_and_its_printed_digits_are_cut_off():
    d = DATA["cubic"]
    move = clamped(d["t_s"], d["q_m"], *d["end_speeds_m_s"])
    speeds = move.at(d["t_s"][1:-1], 1)
    np.testing.assert_allclose(speeds, d["speeds_right"], atol=6e-9)
    rows = np.array([piece.coefficients for piece in move.pieces])
    np.testing.assert_allclose(rows, d["coefficients_right"], atol=6e-6)
    cut = np.abs(rows) - np.abs(d["coefficients_printed"])
    # digits are cut off, 3.43033 to 3.4; only 0.33901 is rounded up
    assert np.all((cut > -1e-3) & (cut < 0.0305))
    np.testing.assert_allclose(move.at(d["t_s"], 2)[:-1], d["accelerations_right"][:-1], atol=6e-9)
    assert tuple(move.peak(1)) == pytest.approx(d["speed_peak"], rel=1e-5)
    assert tuple(move.peak(2)) == pytest.approx(d["acceleration_peak"], rel=1e-6)
    assert tuple(move.extent()) == pytest.approx(d["extent_m"], abs=1e-6)


def test_the_printed_misprint_of_the_third_speed_is_not_a_rounding():
    d = DATA["cubic"]
    wrong = np.abs(np.array(d["speeds_printed"]) - d["speeds_right"])
    assert int(np.argmax(wrong)) == 2
    assert wrong[2] > 0.05 > 5 * np.delete(wrong, 2).max()


def test_the_printed_cubic_misses_its_points():
    d = DATA["cubic"]
    h = np.diff(d["t_s"])
    ends = [
        np.polynomial.polynomial.polyval(x, c)
        for x, c in zip(h, d["coefficients_printed"], strict=True)
    ]
    assert np.abs(np.array(ends) - d["q_m"][1:]).max() == pytest.approx(
        d["miss_of_printed_m"], abs=0.005
    )


@settings(max_examples=40, deadline=None)
@given(path=paths(), speeds=st.tuples(heights, heights))
def test_cubic_splines_are_those_of_scipy(path, speeds):
    t, q = path
    x = np.linspace(0.0, t[-1] * (1 - 1e-9), 60)
    loop = np.append(q[:-1], q[0])
    pairs = (
        (clamped(t + 7.0, q, *speeds), CubicSpline(t, q, bc_type=((1, speeds[0]), (1, speeds[1])))),
        (natural(t + 7.0, q), CubicSpline(t, q, bc_type="natural")),
        (periodic(t + 7.0, loop), CubicSpline(t, loop, bc_type="periodic")),
    )
    for ours, theirs in pairs:
        for order in range(3):
            np.testing.assert_allclose(ours.at(x, order), theirs(x, order), atol=1e-9)


def test_a_natural_or_clamped_cubic_through_two_points_is_the_line_or_the_rest_to_rest_cubic():
    assert natural([0.0, 2.0], [1.0, 4.0]).at(0.5, 1) == pytest.approx(1.5)
    assert clamped([0.0, 2.0], [1.0, 4.0]).peak(1).value == pytest.approx(1.5 * 3.0 / 2.0)


@settings(max_examples=40, deadline=None)
@given(path=paths(), start=st.builds(End, heights, heights), end=st.builds(End, heights, heights))
def test_splines_meet_points_and_end_conditions_without_steps(path, start, end):
    t, q = path
    moves = {
        "four_three_four": four_three_four(t, q, start, end),
        "b_spline_4": b_spline(t, q, 4, start, end),
        "b_spline_5": b_spline(t, q, 5, start, end),
    }
    for law, move in moves.items():
        scale = max(move.peak(order).value * 3.0**order for order in range(5)) + 1.0
        np.testing.assert_allclose(move.at(t), q, atol=1e-9 * scale)
        for order, (a, b) in enumerate(zip(start, end, strict=True), start=1):
            assert move.at([0.0, move.duration_s], order) == pytest.approx([a, b], abs=1e-9 * scale)
        for order in range(SMOOTH[law] + 1):
            assert np.abs(steps(move, order)).max(initial=0.0) < 1e-9 * scale


def test_a_four_three_four_spline_solves_the_full_system_of_its_conditions():
    t, q, start, end = (
        np.array([0.0, 0.7, 1.9, 2.4, 4.0]),
        [1.0, -0.5, 2.0, 0.3, 0.9],
        End(0.4, -1.0),
        End(-0.3, 0.8),
    )
    degrees, h = [4, 3, 3, 4], np.diff(t)
    first = np.concatenate([[0], np.cumsum(np.array(degrees) + 1)])
    rows, right = [], []

    def condition(value, *terms):
        row = np.zeros(first[-1])
        for sign, k, order, x in terms:
            for j in range(order, degrees[k] + 1):
                row[first[k] + j] += sign * math.perm(j, order) * x ** (j - order)
        rows.append(row)
        right.append(value)

    for k in range(4):
        condition(q[k], (1, k, 0, 0.0))
        condition(q[k + 1], (1, k, 0, h[k]))
    for order in (1, 2):
        condition(start[order - 1], (1, 0, order, 0.0))
        condition(end[order - 1], (1, 3, order, h[3]))
        for k in range(3):
            condition(0.0, (1, k, order, h[k]), (-1, k + 1, order, 0.0))
    assert len(rows) == 4 * 5 - 2 == first[-1]
    x = np.linalg.solve(np.array(rows), right)
    for k, piece in enumerate(four_three_four(t, q, start, end).pieces):
        np.testing.assert_allclose(
            piece.coefficients[: degrees[k] + 1], x[first[k] : first[k + 1]], atol=1e-12
        )


def test_the_quintic_b_spline_is_the_one_scipy_makes_with_its_own_knots():
    t, q = [0.0, 0.5, 1.7, 2.0, 3.1], [0.0, 1.0, -1.0, 0.4, 0.0]
    ours, theirs = (
        b_spline(t, q, 5, End(0.1, 0.2), End(0.3, -0.4)),
        make_interp_spline(t, q, k=5, bc_type=([(1, 0.1), (2, 0.2)], [(1, 0.3), (2, -0.4)])),
    )
    x = np.linspace(0.0, 3.0999, 200)
    for order in range(5):
        np.testing.assert_allclose(ours.at(x, order), theirs(x, order), rtol=1e-9, atol=1e-8)


@pytest.mark.parametrize("law", RESTING)
def test_a_spline_of_the_table_starts_and_ends_at_rest(law):
    move = SPLINES[law]([3.0, 4.0, 6.0, 7.5], CASE["points"])
    assert move.duration_s == 4.5
    assert move.continuous(CONTINUOUS[law])
    assert not move.continuous(CONTINUOUS[law] + 1)


@pytest.mark.parametrize("law", RESTING)
def test_mirrored_points_give_the_mirrored_motion(law):
    t, q = np.array([0.0, 1.0, 2.5, 3.0, 5.0]), np.array([0.0, 2.0, 1.0, -1.0, 0.5])
    there, back = SPLINES[law](t, q), SPLINES[law](5.0 - t[::-1], q[::-1])
    x = np.linspace(0.01, 4.99, 99)
    np.testing.assert_allclose(back.at(x, 1), -there.at(5.0 - x, 1), atol=1e-12)


@pytest.mark.parametrize("law", SPLINES)
def test_points_on_one_parabola_or_line_need_no_bend(law):
    t = np.array([0.0, 1.0, 2.5, 3.0])
    if law in ("natural", "n_point"):
        assert SPLINES[law](t, 2.0 * t).at(1.7) == pytest.approx(3.4)
    else:
        assert SPLINES[law](t, np.full(4, 0.7)).extent() == pytest.approx((0.7, 0.7), abs=1e-15)


@pytest.mark.parametrize("law", ["cubic", "four_three_four", "b_spline_4"])
def test_the_case_study_has_the_peaks_of_the_reference(law):
    for k, power in enumerate(ALLOCATIONS[name] for name in ("equal", "proportional", "root")):
        times = np.concatenate([[0.0], np.cumsum(allocate(CASE["points"], 11.0, power))])
        move = SPLINES[law](times, CASE["points"])
        assert [move.peak(order).value for order in (1, 2)] == pytest.approx(
            [row[k] for row in CASE["peaks"][law]], abs=6e-4
        )


def test_the_b_spline_accelerates_less_than_the_four_three_four_spline_against_the_source():
    assert np.all(np.array(CASE["peaks"]["b_spline_4"][1]) < CASE["peaks"]["four_three_four"][1])
    rng, lower = np.random.default_rng(5), 0
    for _ in range(60):
        t, q = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, 6))]), rng.uniform(size=7)
        lower += b_spline(t, q, 4).peak(2).value < four_three_four(t, q).peak(2).value
    assert lower >= 45


def test_a_blend_misses_its_point_by_the_stated_error():
    d = DATA["blend"]
    made = parabolic_blends(d["t_s"], d["q_m"], d["acceleration_m_s2"], rest_ends=False)
    assert made.half_blends_s[1] == d["half_blend_s"]
    assert made.errors_m[1] == d["error_m"]
    assert made.trajectory.at(2.0) == pytest.approx(10.0 + d["error_m"], abs=1e-14)
    assert made.trajectory.at([0.5, 4.5], 1) == pytest.approx(d["speeds_m_s"])
    assert np.abs(steps(made.trajectory, 1)).max() < 1e-14
    assert made.trajectory.at(5.0) == pytest.approx(4.0, abs=1e-14)


def test_the_printed_parabola_does_not_meet_its_lines_and_the_corrected_one_does():
    d = DATA["blend"]
    (v1, v2), tau, a = d["speeds_m_s"], d["half_blend_s"], -d["acceleration_m_s2"]
    made = parabolic_blends(d["t_s"], d["q_m"], -a, rest_ends=False).trajectory

    def misses(slope):
        def parabola(t):
            constant = -a * tau**2 / 2 - (v1 + v2) / 2 * (2 - tau) + v1 * (2 - tau)
            return a / 2 * (t - 2) ** 2 + slope * t + constant

        return [parabola(t) - float(made.at(t)) for t in (2 - tau, 2 + tau)]

    assert misses((v1 + v2) / 2) == pytest.approx([0.0, 0.0], abs=1e-13)
    assert min(map(abs, misses((v1 + v2) / a))) > 2.0


def test_blends_may_begin_and_end_at_rest():
    d = DATA["blend"]
    made = parabolic_blends(d["t_s"], d["q_m"], d["rest"]["acceleration_m_s2"])
    assert made.half_blends_s[[0, -1]] == pytest.approx(d["rest"]["ramps_s"], abs=6e-8)
    assert made.speeds_m_s == pytest.approx(d["rest"]["speeds_m_s"], abs=6e-8)
    assert made.trajectory.at([0.0, 5.0]) == pytest.approx([0.0, 4.0], abs=1e-13)
    assert made.trajectory.continuous(1)


@settings(max_examples=40, deadline=None)
@given(path=paths(), rest=st.booleans())
def test_blends_use_one_acceleration_and_state_every_error(path, rest):
    t, q = path
    slope = np.abs(np.diff(q) / np.diff(t)).max() + 0.1
    a = 8.0 * slope / np.diff(t).min()
    made = parabolic_blends(t, q, a, rest_ends=rest)
    np.testing.assert_allclose(made.trajectory.at(t), q + made.errors_m, atol=1e-10 * slope * t[-1])
    assert made.trajectory.duration_s == pytest.approx(t[-1], rel=1e-12)
    bent = np.array([abs(float(piece.at(np.array(0.0), 2))) for piece in made.trajectory.pieces])
    assert np.all((bent < 1e-6 * a) | (np.abs(bent - a) < 1e-5 * a))
    assert not rest or made.trajectory.continuous(1)


def test_allocations_share_the_total_by_powers_of_the_distance():
    shares = {name: allocate([0, 1, -3], 3.0, power) for name, power in ALLOCATIONS.items()}
    assert shares["equal"] == pytest.approx([1.5, 1.5])
    assert shares["proportional"] == pytest.approx([0.6, 2.4])
    assert shares["root"] == pytest.approx([1.0, 2.0])
    assert allocate([[0, 0], [3, 4], [3, 3]], 6.0, 1.0) == pytest.approx([5.0, 1.0])


def test_the_root_allocation_gives_the_least_acceleration_and_equal_times_the_largest_speed():
    rng = np.random.default_rng(11)
    least, largest = 0, 0
    for _ in range(40):
        q = rng.uniform(size=8)
        moves = {
            name: four_three_four([0.0, *np.cumsum(allocate(q, 7.0, p))], q)
            for name, p in ALLOCATIONS.items()
        }
        least += min(moves, key=lambda name: moves[name].peak(2).value) == "root"
        largest += min(moves, key=lambda name: moves[name].peak(1).value) != "equal"
    assert least >= 28
    assert largest == 40


def example30(rounded):
    """Build the worked example of source 003; rounded: durations to 0.01 s, ties down."""
    d = DATA["example30"]
    segments, first = [], 0
    for k, (kind, count, total) in enumerate(
        zip(d["kinds"], d["counts"], d["totals_s"], strict=True)
    ):
        q = d["points"][first : first + count]
        first += count - 1
        if kind == "straight":
            segments.append(Straight(*q, total))
            continue
        h = np.array(kind) if isinstance(kind, list) else allocate(q, total, ALLOCATIONS[kind])
        h = np.ceil(100.0 * h - 0.5 - 1e-9) / 100.0 if rounded else h
        segments.append(Spline(q, h, End(*d.get(f"end_of_segment_{k}", (0.0, 0.0)))))
    return segments


def test_the_thirty_point_example_has_every_printed_digit_with_its_rounded_durations():
    d = DATA["example30"]
    segments = example30(rounded=True)
    h = [
        x for s in segments for x in ([s.duration_s] if isinstance(s, Straight) else s.durations_s)
    ]
    np.testing.assert_allclose(h, d["durations_rounded_s"], atol=1e-12)
    move = chain(segments)
    limits = AxisLimits(
        position_min_m=min(d["points"]) - d["margin_m"],
        position_max_m=max(d["points"]) + d["margin_m"],
    )
    found = analyse(move, limits=limits)
    assert found.duration_s == pytest.approx(30.0, abs=1e-12)
    peaks = found.speed_m_s, found.acceleration_m_s2
    assert [round(p.peak, 4) for p in peaks] == d["printed"]
    assert [p.peak for p in peaks] == pytest.approx(d["right_rounded"], rel=1e-13)
    assert [p.interval for p in peaks] == d["intervals"]
    assert found.speed_m_s.low == -found.speed_m_s.peak
    assert [p.rms for p in (found.position_m, *peaks)] == pytest.approx(d["rms_rounded"], abs=6e-8)
    assert (found.position_m.low, found.position_m.high) == pytest.approx(
        d["extent_rounded_m"], abs=6e-7
    )
    assert len(found.warnings) == 1
    assert "position_m reaches 3.25796; must be <= 3" in found.warnings[0]


def test_the_thirty_point_example_without_rounding_keeps_its_totals_and_has_no_steps():
    d = DATA["example30"]
    move = chain(example30(rounded=False))
    assert [round(move.peak(order).value, 4) for order in (1, 2)] == d["right"]
    assert move.duration_s == pytest.approx(30.0, abs=1e-12)
    for order in range(3):
        assert np.abs(steps(move, order)).max() < 1e-12
    assert move.at([0.0, move.duration_s], 1) == pytest.approx(d["ends_m_s"], abs=5e-4)
    assert not move.continuous(1)  # it begins and ends at speed


def test_each_segment_of_the_example_has_its_own_peaks():
    d = DATA["example30"]
    move, first = chain(example30(rounded=True)), 0
    for count, (speed, acceleration) in zip(d["counts"], d["segment_peaks"], strict=True):
        part = Trajectory(tuple(move.pieces[first : first + count - 1]))
        first += count - 1
        for order, peak in ((1, speed), (2, acceleration)):
            low, high = part.extent(order)
            assert (low if -low > high else high) == pytest.approx(peak, abs=6e-5)


@pytest.mark.parametrize("law", ["four_three_four", "b_spline_4", "b_spline_5"])
def test_a_spline_fits_between_a_dwell_and_a_constant_speed(law):
    move = chain(
        [dwell(0.2, 1.0), Spline([0.2, 0.3, 0.7], [0.5, 0.8], law=law), Straight(0.7, 1.0, 0.6)]
    )
    assert move.at([0.5, 2.5], 1) == pytest.approx([0.0, 0.5])
    for order in range(3):
        assert np.abs(steps(move, order)).max() < 1e-12


def test_two_straight_segments_of_one_speed_may_follow_each_other():
    assert chain([Straight(0.0, 1.0, 0.1), Straight(1.0, 4.0, 0.3)]).peak(1).value == pytest.approx(
        10.0
    )


def test_a_peak_at_a_step_belongs_to_the_side_that_has_it():
    late = Trajectory(
        Polynomials(np.array([1.0, 1.0]), np.array([[0.0, 1.0, 0.0], [1.0, 1.0, 2.0]]))
    )
    early = Trajectory(
        Polynomials(np.array([1.0, 1.0]), np.array([[0.0, 1.0, 2.0], [3.0, 5.0, 0.0]]))
    )
    assert analyse(late).acceleration_m_s2[2:5] == (4.0, 1.0, 1)
    assert analyse(early).speed_m_s[2:5] == (5.0, 1.0, 0)
    assert analyse(late).speed_m_s[2:5] == (5.0, 2.0, 1)


def test_exceeded_limits_are_reported_with_value_place_and_bound():
    times = np.concatenate([[0.0], np.cumsum(allocate(CASE["points"], 11.0, 0.5))])
    move = b_spline(times, CASE["points"], 4)
    found = analyse(
        move,
        times,
        AxisLimits(speed_m_s=3.0, acceleration_m_s2=5.0, jerk_m_s3=2.0, position_max_m=20.0),
    )
    assert [w.split(" ")[0] for w in found.warnings] == ["|speed_m_s|", "|jerk_m_s3|"]
    place = f"at {found.speed_m_s.peak_t_s:.6g} s in interval 1"
    assert f"reaches {found.speed_m_s.peak:.6g} {place}; must be <= 3" in found.warnings[0]
    assert analyse(move, times, AxisLimits(speed_m_s=found.speed_m_s.peak)).warnings == ()


@settings(max_examples=30, deadline=None)
@given(path=paths(), law=st.sampled_from(RESTING))
def test_analysed_peaks_bound_every_sample_and_are_met_in_their_interval(path, law):
    t, q = path
    move = SPLINES[law](t, q)
    found = analyse(move, t)
    x = np.linspace(0.0, move.duration_s, 2001)
    for order, one in enumerate(found[1:5]):
        v = move.at(x, order)[:-1]
        slack = 1e-9 * (one.peak + 1e-3)
        assert one.low - slack <= v.min()
        assert v.max() <= one.high + slack
        assert t[one.interval] - 1e-6 <= one.peak_t_s <= t[one.interval + 1] + 1e-6
        assert one.rms <= one.peak + slack


@settings(max_examples=60, deadline=None)
@given(
    c=st.lists(st.floats(-5, 5), min_size=6, max_size=6),
    h=st.floats(0.05, 4.0),
    order=st.integers(0, 4),
)
def test_extremes_of_many_are_those_of_the_trajectory(c, h, order):
    low, high = extremes(np.full((2, 1), h), np.array([[c], [[-x for x in c]]]), order)
    truth = Trajectory(Polynomials(np.array([h]), np.array([c]))).extent(order)
    scale = 1e-10 * (max(map(abs, truth)) + 1e-9)
    assert (low[0, 0], high[0, 0]) == pytest.approx(tuple(truth), abs=scale)
    assert (-high[1, 0], -low[1, 0]) == pytest.approx(tuple(truth), abs=scale)


@pytest.mark.parametrize("start", ALLOCATIONS)
@pytest.mark.parametrize("law", RESTING)
def test_every_start_alone_reaches_the_global_minimum(law, start):
    known = CASE["minimum"][law]
    found = minimum_time(law, CASE["points"], LIMITS, starts=(start,), samples=0)
    assert found.times_s[-1] == pytest.approx(known["right"], abs=1e-8)
    assert np.diff(found.times_s) == pytest.approx(known["durations_s"], abs=6e-6)
    assert max(found.reached.values()) == pytest.approx(1.0, abs=1e-12)
    printed = np.array(known.get("printed", [known["right"]]))
    assert np.all(printed > found.times_s[-1] - 5e-5)  # nothing printed is quicker
    assert found.times_s[-1] > CASE["bang_bang_s"]


def test_the_cubic_minimum_is_six_and_the_root_of_twenty_one():
    assert minimum_time("cubic", CASE["points"], LIMITS).times_s[-1] == pytest.approx(
        6.0 + math.sqrt(21.0), abs=1e-11
    )


@pytest.mark.parametrize("law", ["cubic", "four_three_four"])
def test_no_shape_of_a_grid_is_quicker(law):
    search = ShapeSearch(
        SHAPES[law], np.array(CASE["points"], dtype=float)[:, None], {1: 3.0, 2: 2.0}
    )
    a, b = np.meshgrid(np.geomspace(0.02, 50.0, 90), np.geomspace(0.02, 50.0, 90))
    totals = search.scaled(np.stack([np.ones_like(a), a, b], axis=-1)).sum(axis=-1)
    best = minimum_time(law, CASE["points"], LIMITS).times_s[-1]
    assert best < totals.min() < 1.05 * best


def test_an_independent_search_on_a_jerk_limit_finds_no_quicker_one():
    limits = AxisLimits(acceleration_m_s2=2.0, jerk_m_s3=3.0)
    found = minimum_time("four_three_four", [0.0, 1.0, 3.0], limits)

    def total(x):
        move = four_three_four([0.0, 1.0, 1.0 + math.exp(x[0])], [0.0, 1.0, 3.0])
        return move.duration_s * max(
            (move.peak(2).value / 2.0) ** (1 / 2), (move.peak(3).value / 3.0) ** (1 / 3)
        )

    lowest = brute(total, ((-1.5, 1.5),), Ns=60, full_output=True)[1]
    assert found.times_s[-1] <= lowest  # a simplex ends within 1e-4 of a kink
    assert found.times_s[-1] == pytest.approx(lowest, rel=1e-4)
    assert found.reached["jerk_m_s3"] == pytest.approx(1.0)


@pytest.mark.parametrize("law", RESTING)
def test_slowing_down_alone_gives_the_times_of_the_reference(law):
    search = ShapeSearch(
        SHAPES[law], np.array(CASE["points"], dtype=float)[:, None], {1: 3.0, 2: 2.0}
    )
    h = np.array(
        [
            allocate(CASE["points"], 1.0, ALLOCATIONS[name])
            for name in ("equal", "proportional", "root")
        ]
    )
    np.testing.assert_allclose(search.scaled(h).sum(axis=-1), CASE["scaled"][law], atol=6e-5)


@settings(max_examples=12, deadline=None)
@given(q=st.lists(st.integers(-4, 4), min_size=3, max_size=6), law=st.sampled_from(RESTING[:2]))
def test_the_minimum_keeps_the_limits_and_beats_every_allocation(q, law):
    assume(0 not in np.diff(q))
    found = minimum_time(law, q, LIMITS, samples=16)
    move = SPLINES[law](found.times_s, q)
    assert move.peak(1).value <= 3.0 * (1 + 1e-9)
    assert move.peak(2).value <= 2.0 * (1 + 1e-9)
    for power in ALLOCATIONS.values():
        shape = SPLINES[law](np.concatenate([[0.0], np.cumsum(allocate(q, 1.0, power))]), q)
        assert found.times_s[-1] <= max(
            shape.peak(1).value / 3.0, math.sqrt(shape.peak(2).value / 2.0)
        ) * (1 + 1e-9)


def test_a_point_may_be_passed_twice_with_a_turn_in_between_but_without_a_dwell():
    found = minimum_time("cubic", [5, -1, -3, -3, 2], LIMITS)
    assert SPLINES["cubic"](found.times_s, [5, -1, -3, -3, 2]).extent().low < -3.01
    with pytest.raises(
        Infeasible, match=r"points 0 and 1 are both at \[5\.\] m, and the time between them shrinks"
    ):
        minimum_time("cubic", [5, 5, -3, -5], LIMITS)


def test_three_axes_share_one_time_and_all_keep_the_limits():
    q = np.array([[0.0, 0.0, -0.8], [0.2, 0.1, -0.7], [0.3, -0.2, -0.8], [0.0, 0.0, -0.8]])
    limits = AxisLimits(speed_m_s=0.5, acceleration_m_s2=2.0, jerk_m_s3=40.0)
    found = minimum_time("b_spline_5", q, limits, samples=32)
    motion = Motion(*(b_spline(found.times_s, column) for column in q.T))
    peaks = np.array(
        [[axis.peak(order).value for order in (1, 2, 3)] for axis in (motion.x, motion.y, motion.z)]
    )
    assert (peaks / [0.5, 2.0, 40.0]).max() == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(motion.at(found.times_s), q, atol=1e-12)


def test_ten_thousand_points_are_one_table_and_every_one_is_met():
    rng = np.random.default_rng(2)
    t, q = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, 9999))]), rng.normal(size=10000)
    for law in ("cubic", "four_three_four"):
        move = SPLINES[law](t, q)
        assert isinstance(move.pieces, Polynomials)
        np.testing.assert_allclose(move.at(t[:-1] - t[0]), q[:-1], atol=1e-9)
        assert len(move.pieces) == 9999
        assert move.pieces[1:3][0] == move.pieces[1]


def test_a_long_table_is_swept_as_scipy_evaluates_it_in_any_order_of_times():
    rng = np.random.default_rng(4)
    t, q = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, 1299))]), rng.normal(size=1300)
    move, truth = clamped(t, q), CubicSpline(t, q, bc_type="clamped")
    ascending = np.sort(rng.uniform(0.0, t[-1], 7000))
    gap = ascending[(ascending < 400.0) | (ascending > 1100.0)]  # no sample in many pieces
    for x in (ascending, gap, rng.permutation(ascending).reshape(70, 100), np.array(3.3)):
        for order in range(4):
            np.testing.assert_allclose(move.at(x, order), truth(x, order), atol=1e-10)
    np.testing.assert_array_equal(move.at([-1.0, t[-1] + 1.0]), move.at([0.0, move.duration_s]))


def test_a_table_of_pieces_is_the_same_trajectory_as_the_pieces_themselves():
    move = four_three_four(np.arange(12.0), np.sin(np.arange(12.0)))
    one_by_one = Trajectory(tuple(move.pieces))
    t = np.linspace(-1.0, 12.0, 500)
    for order in range(4):
        np.testing.assert_array_equal(move.at(t, order), one_by_one.at(t, order))
        assert move.peak(order) == one_by_one.peak(order)
    both = move.then(Trajectory.hold(float(move.at(11.0)), 1.0)).scaled(2.0).shifted(1.0)
    np.testing.assert_allclose(both.at(t), 2.0 * move.at(t) + 1.0, atol=1e-12)


def test_a_table_with_an_empty_piece_or_without_pieces_is_refused():
    with pytest.raises(PlanError, match=r"duration_s = 0\.0 of piece 1; must be finite and > 0"):
        Trajectory(Polynomials(np.array([1.0, 0.0]), np.zeros((2, 3))))
    with pytest.raises(PlanError, match="0 pieces"):
        Trajectory(Polynomials(np.zeros(0), np.zeros((0, 3))))


def test_the_splines_are_imported_without_scipy():
    code = (
        "import sys, planners.splines.minimum_time, planners.splines.chain; "
        "sys.exit('scipy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("law", SPLINES)
@pytest.mark.parametrize(
    ("t", "q", "message"),
    [
        ([0, 1, 1, 2], [0, 1, 2, 0], r"times_s\[2\] = 1 repeats after 1; must increase"),
        ([0, 2, 1, 3], [0, 1, 2, 0], r"times_s\[2\] = 1 decreases after 2; must increase"),
        (
            [0, 1, 1 + 1e-12, 2],
            [0, 1, 2, 0],
            r"the interval after times_s\[1\] lasts 1e-12 s of 2 s; must be >= 1e-09 of it",
        ),
        ([0, 1, 2], [0, 1], r"shape \(3,\), points_m \(2,\)"),
        ([0, 1, math.nan], [0, 1, 0], "times_s = nan; must be -1e"),
        ([0, 1e200, 2e200], [0, 1, 0], r"times_s = 1e\+200; must be"),
        ([0, 1e-320, 2e-320], [0, 1, 0], "duration_s = .* must be 1e-09 to"),
        ([0, 1, 2], [0, 1e300, 0], r"points_m = 1e\+300; must be"),
        ([0, 1, 2], [0, math.inf, 0], "points_m = inf; must be -1e"),
        ([0], [0], "1 points; must be >= "),
        ([], [], "0 points; must be >= "),
    ],
)
def test_bad_points_are_refused_by_every_law(law, t, q, message):
    with pytest.raises(PlanError, match=message):
        SPLINES[law](t, q)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: four_three_four([0, 1], [0, 1]), "4-3-4 spline: 2 points; must be >= 3"),
        (
            lambda: four_three_four([0, 1, 2], [0, 1, 2], End(math.nan)),
            "a number of ends = nan; must be",
        ),
        (lambda: b_spline([0, 1, 2], [0, 1, 2], 3), "degree = 3 of a B-spline; must be 4 or 5"),
        (
            lambda: periodic([0, 1, 2], [0, 1, 2]),
            "the last point is 2 m, the first 0 m; must be equal",
        ),
        (lambda: conditioning(1), "points = 1 of a polynomial; must be >= 2"),
        (
            lambda: parabolic_blends([0, 1, 2], [0, 1, 0], 0.0),
            "acceleration_m_s2 = 0.0; must be 1e-09 to",
        ),
        (
            lambda: parabolic_blends([0, 1, 2], [0, 1, 0], 1.9),
            ">= 2: give the first interval more time",
        ),
        (lambda: parabolic_blends([0, 1, 2], [0, 1, 0], 2.5), "blends at points 0 and 1 take"),
        (
            lambda: allocate([0, 1, 1], 3.0, 0.5),
            "points 1 and 2 are both at 1.0 m, so their interval lasts 0 s",
        ),
        (lambda: allocate([0, 1], 0.0, 0.5), "total_s = 0.0"),
        (lambda: allocate([0, 1], 1.0, -1.0), "power = -1.0"),
        (lambda: allocate([0, 1, 3], 1.0, 200.0), "power = 200.0; must be 0 to 4"),
        (
            lambda: allocate([0, 1e-3, 3], 1.0, 4.0),
            "the interval between points 0 and 1 gets .* of the time; must be >= 1e-09",
        ),
        (lambda: allocate([0, 1e300], 1.0, 1.0), r"largest point = 1e\+300; must be"),
        (lambda: AxisLimits(speed_m_s=1e300), r"speed_m_s = 1e\+300; must be 1e-09 to 1e\+12"),
        (lambda: AxisLimits(jerk_m_s3=1e-300), "jerk_m_s3 = 1e-300; must be 1e-09 to 1e"),
        (
            lambda: minimum_time("cubic", [0, 1e200, 2e200], LIMITS),
            r"largest point = 2e\+200; must be",
        ),
        (
            lambda: minimum_time("cubic", [0, 1e-200, 2e-200], LIMITS),
            "distance from the first point = 2e-200; must be 1e-12 to",
        ),
        (lambda: allocate([0], 1.0, 0.0), r"shape \(1,\)"),
        (lambda: AxisLimits(speed_m_s=0.0), "speed_m_s = 0.0; must be 1e-09 to"),
        (
            lambda: AxisLimits(position_min_m=1.0, position_max_m=0.0),
            "position_min_m = 1.0, position_max_m = 0.0",
        ),
        (lambda: analyse(natural([0, 1], [0, 1]), [1.0, 2.0]), "increasing from 0"),
        (lambda: chain([]), "0 segments"),
        (lambda: dwell(0.0, 0.0), "duration_s = 0.0; must be 1e-09 to"),
        (
            lambda: chain([dwell(0.0, 1.0), Straight(0.0, 1.0, 2.0)]),
            "speed steps from 0 m/s in segment 0 to 0.5 m/s in segment 1",
        ),
        (
            lambda: chain([dwell(0.0, 1.0), dwell(0.5, 1.0)]),
            "segment 0 ends at 0.0 m, segment 1 begins at 0.5 m; must meet",
        ),
        (
            lambda: chain([Spline([0, 1, 2], [1.0])]),
            "segment 0 has 3 points and 1 durations; must be 2",
        ),
        (
            lambda: chain([Spline([0, 1, 2], [1.0, 0.0])]),
            r"durations_s\[1\] in segment 0 = 0.0; must be",
        ),
        (lambda: chain([Spline([0, 1, 2], [1.0, 1.0], law="cubik")]), "law of segment 0 = 'cubik'"),
        (
            lambda: minimum_time("cubik", [0, 1, 2], LIMITS),
            "law of a minimum time = 'cubik'; did you mean 'cubic'",
        ),
        (
            lambda: minimum_time("cubic", [0, 1, 2], LIMITS, starts=("rot",)),
            "start of a minimum time = 'rot'; did you mean 'root'",
        ),
        (
            lambda: minimum_time("cubic", [0, 1, 2], LIMITS, starts=(), samples=0),
            "samples = 0 without starts",
        ),
        (
            lambda: minimum_time("cubic", [0, 1], LIMITS),
            r"shape \(2, 1\) for a minimum time; must be >= 3",
        ),
        (lambda: minimum_time("cubic", [1, 1, 1], LIMITS), "all 3 points are at"),
        (
            lambda: minimum_time("cubic", [0, 1, 2], AxisLimits()),
            "no limit of speed, acceleration or jerk",
        ),
        (
            lambda: minimum_time("cubic", [0, 1, 2], AxisLimits(jerk_m_s3=9.0)),
            "jerk_m_s3 = 9.0 for a cubic spline at rest",
        ),
    ],
)
def test_bad_input_is_refused_with_value_and_bound(call, message):
    with pytest.raises(PlanError, match=message):
        call()


def test_limits_that_cannot_be_met_are_infeasible():
    with pytest.raises(Infeasible):
        minimum_time("cubic", [0, 1, 2], AxisLimits(jerk_m_s3=9.0))
    with pytest.raises(Infeasible):
        parabolic_blends([0, 1, 2], [0, 1, 0], 1.9)


@pytest.mark.parametrize("n", [50, 70])
def test_a_polynomial_that_misses_its_points_is_refused(n):
    q = np.random.default_rng(0).uniform(-1.0, 1.0, n)
    with pytest.raises(
        NotConverged, match=f"through {n} points has an error of .* must be <= .* use a spline"
    ):
        n_point(np.arange(float(n)), q)


@pytest.mark.parametrize("law", SPLINES)
@pytest.mark.parametrize(("time", "size"), [(1e-9, 1e9), (1e9, 1e9), (1e-9, 1e-12), (1e9, 1e-12)])
def test_a_spline_keeps_its_shape_at_the_shortest_and_longest_times_and_distances(law, time, size):
    t, q = np.linspace(0.0, 1.0, 5), np.array([0.0, 1.0, -0.5, 0.7, 0.0])
    unit, move = SPLINES[law](t, q), SPLINES[law](time * t, size * q)
    for order in (0, 1, 2):
        assert move.peak(order).value == pytest.approx(
            unit.peak(order).value * size / time**order, rel=1e-6
        )


@pytest.mark.parametrize("law", SHAPES)
@pytest.mark.parametrize(
    ("distance", "bound"), [(1e-12, 1e12), (1e-12, 1e-9), (1e9, 1e12), (1e9, 1e-9)]
)
def test_the_minimum_time_grows_with_the_root_of_distance_over_acceleration_up_to_the_bounds(
    law, distance, bound
):
    limits, points = AxisLimits(acceleration_m_s2=bound), [0.0, distance, distance / 2.0]
    unit_limits = AxisLimits(acceleration_m_s2=1.0)
    unit = minimum_time(law, [0.0, 1.0, 0.5], unit_limits, samples=4).times_s[-1]
    found = minimum_time(law, points, limits, samples=4).times_s[-1]
    assert found == pytest.approx(unit * math.sqrt(distance / bound), rel=1e-6)
