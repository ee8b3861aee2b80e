"""Motion laws against the published figures, scipy, ruckig and the bounds of any move."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import BPoly

from planners.errors import Infeasible, PlanError
from planners.laws import LAWS
from planners.laws.birkhoff import Condition, hermite_birkhoff
from planners.laws.catalogue import catalogue, coefficients, minimum_time_s
from planners.laws.double_s import double_s, double_s_by_ramp, double_s_within
from planners.laws.elliptic import elliptic
from planners.laws.fourier import FREUDENSTEIN_1_3_5, fourier
from planners.laws.harmonic import harmonic
from planners.laws.polynomial import MAX_END_DERIVATIVES, between, quintic, rest_to_rest
from planners.laws.rect_cascade import RectCascade, fifteen_segments
from planners.laws.trapezoidal import (
    trapezoidal,
    trapezoidal_by_acceleration,
    trapezoidal_by_ramp,
    trapezoidal_by_speed,
    trapezoidal_within,
    triangular,
)

DATA = tomllib.loads((Path(__file__).parents[1] / "data" / "laws.toml").read_text())
COLUMNS = ("cv", "ca", "cv_rms", "ca_rms")
TABLE = {row["law"]: row for row in DATA["coefficients"]}
every_law = pytest.mark.parametrize("name", LAWS)
every_row = pytest.mark.parametrize("row", TABLE.values(), ids=TABLE)
sizes = st.floats(0.05, 20.0)
shares = st.floats(0.02, 0.5)


def clash_of(rows):
    return [Condition(*row) for row in rows]


@every_row
def test_coefficients_are_the_corrected_ones(row):
    mine = coefficients(row["law"])
    np.testing.assert_allclose([getattr(mine, c) for c in COLUMNS], row["right"], rtol=1e-12)
    assert mine.continuity == row["continuity"]
    assert mine.cj == pytest.approx(row.get("cj", math.inf), rel=1e-10)


@every_row
def test_published_coefficients_stand_except_where_an_erratum_says_why(row):
    mine = coefficients(row["law"])
    wrong = [
        c
        for c, printed in zip(COLUMNS, row["published"], strict=True)
        if abs(getattr(mine, c) - printed) > 5.00001e-5
    ]
    assert wrong == row["wrong"]
    assert bool(row["reason"]) == bool(wrong)


@every_law
def test_peaks_and_rms_are_those_of_quadrature_and_dense_sampling(name):
    law, row = LAWS[name](1.0), coefficients(name)
    t = np.linspace(0.0, 1.0, 20001)
    for order, peak, rms in ((1, row.cv, row.cv_rms), (2, row.ca, row.ca_rms)):
        assert square_integral(law, order) == pytest.approx(rms**2, rel=1e-11)
        sampled = np.abs(law.at(t, order)).max()
        assert peak * (1 - 1e-3) <= sampled <= peak * (1 + 1e-12)


def square_integral(law, order):
    """Compute the integral of the square by adaptive quadrature, piece by piece."""
    return sum(
        quad(
            lambda t: float(piece.at(np.array(t), order)) ** 2,  # noqa: B023
            0.0,
            piece.duration_s,
            epsabs=1e-13,
            epsrel=1e-12,
        )[0]
        for piece in law.pieces
    )


@every_law
def test_no_law_beats_the_bounds_of_a_move_from_rest_to_rest(name):
    row = coefficients(name)
    assert row.cv > 1.0
    assert row.ca >= 4.0 * (1 - 1e-12)
    assert row.ca_rms >= 2.0 * math.sqrt(3.0) * (1 - 1e-12)


@every_law
@given(duration_s=st.floats(1e-3, 1e3))
@settings(max_examples=10)
def test_a_law_goes_from_0_to_1_at_rest_and_mirrors_itself(name, duration_s):
    law = LAWS[name](duration_s)
    assert law.duration_s == pytest.approx(duration_s, rel=1e-14)
    assert law.continuous(1)
    x = np.linspace(0.0, 1.0, 41)
    q = law.at(x * law.duration_s)
    np.testing.assert_allclose([q[0], q[-1]], [0.0, 1.0], atol=1e-13)
    np.testing.assert_allclose(q + q[::-1], 1.0, atol=1e-12)
    np.testing.assert_allclose(q, LAWS[name](1.0).at(x), atol=1e-12)
    assert np.all(np.diff(q) > 0.0)


@every_law
@pytest.mark.parametrize("distance_m", [-2.5, 0.0, 0.3])
def test_a_move_of_any_size_and_sign_is_a_scaled_law(name, distance_m):
    move = LAWS[name](2.0).scaled(distance_m).shifted(7.0)
    np.testing.assert_allclose(move.at([0.0, 2.0]), [7.0, 7.0 + distance_m], rtol=1e-14)
    assert move.peak(1).value == pytest.approx(coefficients(name).cv * abs(distance_m) / 2.0)
    assert move.rms(2) == pytest.approx(coefficients(name).ca_rms * abs(distance_m) / 4.0)


@every_law
@pytest.mark.parametrize("duration_s", [0.0, -1.0, math.nan, math.inf, 1e-300, 1e100])
def test_a_law_refuses_a_duration_out_of_bounds(name, duration_s):
    with pytest.raises(PlanError, match=r"duration_s = .* must be 1e-09 to 1e\+09"):
        LAWS[name](duration_s)


def test_the_catalogue_has_a_row_for_every_law_in_order():
    assert [row.name for row in catalogue()] == list(LAWS)
    assert coefficients("fifteen_segments").continuity == "C3"
    assert coefficients("double_s").continuity == "C2"
    with pytest.raises(PlanError, match="did you mean 'quintic'"):
        coefficients("quintik")


@pytest.mark.parametrize("name", ["cubic", "quintic", "harmonic", "cycloidal"])
def test_minimum_times_are_the_published_ones(name):
    d = DATA["kinematic_scaling"]
    by_speed = minimum_time_s(name, d["distance"], speed_m_s=d["speed"])
    by_acceleration = minimum_time_s(name, -d["distance"], acceleration_m_s2=d["acceleration"])
    both = minimum_time_s(
        name, d["distance"], speed_m_s=d["speed"], acceleration_m_s2=d["acceleration"]
    )
    np.testing.assert_allclose([by_speed, by_acceleration, both], d[name], atol=5e-4)


def test_minimum_times_beyond_the_source():
    d = DATA["kinematic_scaling"]
    limits = {"speed_m_s": d["speed"], "acceleration_m_s2": d["acceleration"]}
    assert minimum_time_s("septic", d["distance"], **limits) == pytest.approx(
        d["septic_minimum"], abs=1e-7
    )
    assert minimum_time_s("triangular", d["distance"], **limits) == pytest.approx(
        d["triangular_minimum"], abs=1e-7
    )
    fastest = trapezoidal_within(d["distance"], d["speed"], d["acceleration"])
    assert fastest.duration_s == pytest.approx(d["trapezoidal_within_limits"], abs=1e-7)
    assert minimum_time_s("septic", 0.0, **limits) == 0.0


@every_law
def test_at_the_minimum_time_one_limit_is_met_and_none_exceeded(name):
    limits = {"speed_m_s": 0.7, "acceleration_m_s2": 1.1} | (
        {"jerk_m_s3": 9.0} if coefficients(name).continuity > "C1" else {}
    )
    move = LAWS[name](minimum_time_s(name, -0.4, **limits)).scaled(-0.4)
    shares = [move.peak(k).value / limit for k, limit in enumerate(limits.values(), start=1)]
    assert max(shares) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({}, "at least one must be finite"),
        ({"speed_m_s": 0.0}, "speed_m_s = 0.0; must be 1e-09 to"),
        ({"acceleration_m_s2": math.nan}, "acceleration_m_s2 = nan"),
        ({"jerk_m_s3": 5.0}, "harmonic of class C1; it must be C2"),
    ],
)
def test_minimum_time_refuses_limits_that_do_not_bound_it(limits, words):
    with pytest.raises(PlanError, match=words):
        minimum_time_s("harmonic", 1.0, **limits)


def test_the_harmonic_general_section_is_twice_too_large():
    law, d = harmonic(1.0), DATA["harmonic"]
    peaks = [law.peak(k).value for k in (1, 2, 3)]
    np.testing.assert_allclose(peaks, d["right"], rtol=1e-14)
    np.testing.assert_allclose(d["published"], 2.0 * np.array(peaks), rtol=1e-14)


def test_the_quintic_acceleration_peaks_where_the_correction_says():
    d = DATA["quintic_peak"]
    t_s = quintic(1.0).peak(2).t_s
    assert min(t_s, 1.0 - t_s) == pytest.approx(d["right"], abs=1e-12)
    assert abs(d["right"] - d["published"]) > 5e-5


def test_the_printed_basis_of_the_quintic_misses_the_start():
    d = DATA["quintic_basis"]
    move = between(d["state_0"], d["state_1"], d["duration_s"])
    for order in range(3):
        ends = [d["state_0"][order], d["state_1"][order]]
        np.testing.assert_allclose(move.at([0.0, d["duration_s"]], order), ends, atol=1e-14)
    # in powers of (t - t1): at t0 it is p(-T)
    printed = np.polynomial.Polynomial(move.pieces[0].coefficients)
    assert abs(printed(-d["duration_s"]) - d["state_0"][0]) > 1.0


@pytest.mark.parametrize("k", [0, 1])
def test_cubic_examples_of_the_source(k):
    d = DATA["cubic_examples"]
    v0, v1 = d["ends"][k]
    move = between([0.0, v0], [10.0, v1], 8.0)
    np.testing.assert_allclose(move.pieces[0].coefficients, d["coefficients"][k], atol=1e-14)
    np.testing.assert_allclose(move.extent(0), d["extents"][k], atol=1e-6)


states = st.lists(st.floats(-5, 5), min_size=1, max_size=4)


@given(start=states, end=states, duration_s=st.floats(0.1, 10))
def test_a_polynomial_between_any_states_is_scipy_s(start, end, duration_s):
    move = between(start, end, duration_s)
    t = np.linspace(0.0, duration_s, 21)
    truth = BPoly.from_derivatives([0.0, duration_s], [start, end])
    scale = max(1.0, np.abs(truth(t)).max())
    np.testing.assert_allclose(move.at(t), truth(t), atol=1e-11 * scale)
    assert len(move.pieces[0].coefficients) == len(start) + len(end)


@pytest.mark.parametrize("n", range(1, MAX_END_DERIVATIVES + 1))
def test_rest_to_rest_is_the_polynomial_between_two_states_of_rest_and_as_smooth_as_stated(n):
    law, other = rest_to_rest(n, 1.3), between([0.0] * (n + 1), [1.0] + [0.0] * n, 1.3)
    t = np.linspace(0.0, 1.3, 31)
    np.testing.assert_allclose(law.at(t), other.at(t), atol=1e-10)
    assert law.continuous(n)
    assert not law.continuous(n + 1)
    # mean square of x^n (1-x)^n: the beta function
    norm = math.factorial(2 * n + 1) / math.factorial(n) ** 2
    assert law.rms(1) * 1.3 == pytest.approx(
        norm * math.factorial(2 * n) / math.sqrt(math.factorial(4 * n + 1)), rel=1e-11
    )


@pytest.mark.parametrize("n", [0, MAX_END_DERIVATIVES + 1])
def test_rest_to_rest_refuses_a_degree_that_rounding_dominates(n):
    with pytest.raises(PlanError, match=f"n = {n} .* must be 1 to {MAX_END_DERIVATIVES}"):
        rest_to_rest(n, 1.0)


@pytest.mark.parametrize("state", [[], [math.nan], [0.0, math.inf]])
def test_between_refuses_an_empty_or_infinite_state(state):
    with pytest.raises(
        PlanError,
        match=r"end = .* must hold 1 to 8 numbers|end\[\d\] = .* must be -1e\+12 to 1e\+12",
    ):
        between([0.0], state, 1.0)


@given(
    times=st.lists(st.floats(-3, 9), min_size=2, max_size=3, unique=True),
    values=st.lists(st.floats(-5, 5), min_size=6, max_size=6),
)
def test_conditions_at_the_ends_and_inside_are_met(times, values):
    assume(np.diff(np.sort(times)).min() > 0.2)
    conditions = [Condition(t, k, values[2 * i + k]) for i, t in enumerate(times) for k in range(2)]
    move = hermite_birkhoff(conditions)
    for c in conditions:
        scale = max(1.0, move.peak(c.order).value)
        assert float(move.at(c.t_s - min(times), c.order)) == pytest.approx(
            c.value, abs=1e-9 * scale
        )
    assert move.duration_s == pytest.approx(max(times) - min(times))


def test_conditions_may_leave_gaps():
    move = hermite_birkhoff(
        clash_of([(1.0, 0, 2.0), (1.0, 2, 0.0), (3.0, 3, 1.0), (4.0, 0, -1.0), (4.0, 1, 0.5)])
    )
    np.testing.assert_allclose(
        [move.at(0.0), move.at(0.0, 2), move.at(2.0, 3), move.at(3.0), move.at(3.0, 1)],
        [2, 0, 1, -1, 0.5],
        atol=1e-12,
    )


def test_conditions_at_two_ends_are_the_two_point_polynomial():
    t0 = 1e4  # far from the origin of time
    ends = clash_of(
        [
            (t0, 0, 1.0),
            (t0, 1, -0.5),
            (t0, 2, 0.3),
            (t0 + 2, 0, 4.0),
            (t0 + 2, 1, 0.7),
            (t0 + 2, 2, -0.2),
        ]
    )
    t = np.linspace(0.0, 2.0, 21)
    expected = between([1.0, -0.5, 0.3], [4.0, 0.7, -0.2], 2.0).at(t)
    np.testing.assert_allclose(hermite_birkhoff(ends).at(t), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (
            [(-1, 0, 0), (1, 0, 1), (0, 1, 0)],
            r"q\^\(0\)\(-1 s\), q\^\(0\)\(1 s\), q\^\(1\)\(0 s\) clash",
        ),
        (
            [(0, 0, 0), (0, 0, 1), (1, 0, 1)],
            r"q\^\(0\)\(0 s\) is given 2 times; must be given once",
        ),
        ([(0, 0, 0), (1, 3, 0)], r"q\^\(3\)\(1 s\) among 2; its order must be 0 to 1"),
        ([(0, 1, 0), (1, 1, 0)], "0 conditions on derivatives 0 to 0 of 2; must be >= 1"),
        ([(0, 0, 0), (0, 1, 0)], "conditions at 1 times; must be >= 2"),
        ([], "number of conditions = 0; must be 2 to 32"),
        ([(0, 0, 0), (math.nan, 0, 0)], "= nan; must be -1e"),
    ],
)
def test_conditions_without_a_unique_answer_are_refused_by_name(rows, words):
    with pytest.raises(PlanError, match=words):
        hermite_birkhoff(clash_of(rows))


def test_too_many_conditions_for_plain_powers_are_refused_not_answered_wrongly():
    many = clash_of([(t, 0, (-1.0) ** k) for k, t in enumerate(np.linspace(0.0, 1.0, 40))])
    with pytest.raises(PlanError, match="number of conditions = 40; must be 2 to 32"):
        hermite_birkhoff(many)


def test_the_published_factor_of_freudenstein_leaves_an_end_speed():
    d = DATA["freudenstein_factor"]
    assert FREUDENSTEIN_1_3_5[1] == pytest.approx(d["right"], rel=1e-15)
    rounded = {1: d["published"], 3: d["published"] / 18, 5: d["published"] / 250}
    assert 1.0 - sum(rounded.values()) == pytest.approx(d["end_speed"], rel=1e-3)
    with pytest.raises(PlanError, match=r"sum to 1\.0000085\d*; must sum to 1"):
        fourier(1.0, rounded)


@given(st.lists(st.floats(-1, 1), min_size=1, max_size=5))
def test_any_fourier_law_has_the_mean_squares_of_parseval(free):
    shares = dict(enumerate([1.0 - sum(free), *free], start=1))
    law = fourier(1.0, shares)
    assert law.rms(1) ** 2 == pytest.approx(1.0 + sum(c * c for c in shares.values()) / 2)
    assert law.rms(2) ** 2 == pytest.approx(
        sum((2 * math.pi * n * c) ** 2 for n, c in shares.items()) / 2
    )


@pytest.mark.parametrize("k", range(4))
def test_the_elliptic_law_is_the_tabulated_one(k):
    d = DATA["elliptic"]
    law = elliptic(1.0, axis_ratio=d["axis_ratio"][k])
    mine = [law.peak(1).value, law.peak(2).value, law.rms(1), law.rms(2)]
    np.testing.assert_allclose(mine, [d[c][k] for c in COLUMNS], atol=1e-6)
    n = d["axis_ratio"][k]
    assert law.peak(1).value == pytest.approx(n * math.pi / 2, rel=1e-13)
    assert float(law.at(0.0, 2)) == pytest.approx(math.pi**2 / (2 * n * n), rel=1e-13)


@pytest.mark.parametrize("order", range(1, 9))
def test_each_derivative_of_the_elliptic_law_is_the_slope_of_the_one_before(order):
    law, h = elliptic(1.0, axis_ratio=1.5), 1e-3
    t = np.linspace(0.05, 0.95, 19)
    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    slope = (
        sum(
            w * (law.at(t + k * h, order - 1) - law.at(t - k * h, order - 1))
            for k, w in weights.items()
        )
        / h
    )
    np.testing.assert_allclose(law.at(t, order), slope, atol=1e-7 * np.abs(slope).max())


def test_an_ellipse_with_equal_axes_is_the_harmonic_law():
    t = np.linspace(0.0, 2.0, 21)
    for order in range(6):
        np.testing.assert_allclose(
            elliptic(2.0, axis_ratio=1.0).at(t, order), harmonic(2.0).at(t, order), atol=1e-11
        )
    with pytest.raises(PlanError, match=r"axis_ratio = 0\.9; must be 1 to 12"):
        elliptic(1.0, axis_ratio=0.9)


def test_the_modified_laws_are_their_definition():
    x = np.linspace(0.0, 1.0, 161)[1:-1]
    ca = 8 * math.pi / (2 + math.pi)
    half = np.minimum(x, 1 - x)
    flat = np.where(
        half < 1 / 8,
        np.sin(4 * math.pi * half),
        np.where(half > 3 / 8, np.cos(4 * math.pi * (half - 3 / 8)), 1.0),
    )
    np.testing.assert_allclose(
        LAWS["modified_trapezoidal"](1.0).at(x, 2),
        ca * flat * np.where(x <= 0.5, 1, -1),
        atol=1e-12,
    )
    ca = 4 * math.pi**2 / (4 + math.pi)
    ends = np.where(
        (x < 1 / 8) | (x > 7 / 8), np.sin(4 * math.pi * x), np.cos(4 * math.pi / 3 * (x - 1 / 8))
    )
    np.testing.assert_allclose(LAWS["modified_sine"](1.0).at(x, 2), ca * ends, atol=1e-12)


@pytest.mark.parametrize("k", range(4))
def test_trapezoids_of_the_sources_short_moves_included(k):
    d = DATA["trapezoid"]
    q0, q1, v, a, duration, ramp, peak = d["rows"][k]
    move = trapezoidal_within(q1 - q0, v, a)
    assert (move.duration_s, move.times_s[1], move.peaks[0]) == pytest.approx(
        (duration, ramp, peak), rel=1e-12
    )
    path = move.trajectory().shifted(q0)
    np.testing.assert_allclose(path.at([0.0, duration]), [q0, q1], atol=1e-13)
    assert path.peak(2).value == pytest.approx(a)
    short = abs(q1 - q0) < v * v / a
    assert (abs(d["published_t"][k] - duration) > 0.1) == short
    assert abs(q1 - q0) / v + v / a == pytest.approx(d["published_t"][k])


def test_every_specification_of_a_trapezoid_makes_the_same_move():
    d = DATA["trapezoid_by_acceleration"]
    h, duration, a = -d["distance"], d["duration"], d["acceleration"]
    move = trapezoidal_by_acceleration(h, duration, a)
    assert (move.times_s[1], move.peaks[0]) == pytest.approx((d["ramp"], d["speed"]), rel=1e-10)
    again = [
        trapezoidal_by_ramp(h, duration, move.times_s[1]),
        trapezoidal_by_speed(h, duration, move.peaks[0]),
        trapezoidal_within(h, move.peaks[0], a),
    ]
    for other in again:
        assert other.times_s == pytest.approx(move.times_s, rel=1e-10)
    t = np.linspace(0.0, duration, 31)
    unit = trapezoidal(duration, alpha=move.times_s[1] / duration).scaled(h)
    np.testing.assert_allclose(unit.at(t), move.trajectory().at(t), atol=1e-12)


def test_at_the_least_acceleration_the_trapezoid_is_a_triangle():
    least = 4.0 * 2.0 / 3.0**2
    assert trapezoidal_by_acceleration(2.0, 3.0, least).times_s == pytest.approx(
        (1.5, 1.5), rel=1e-7
    )
    assert triangular(1.0).peak(2).value == pytest.approx(4.0)
    with pytest.raises(Infeasible, match=r"must be finite and >= 0\.888888889") as caught:
        trapezoidal_by_acceleration(2.0, 3.0, 0.999 * least)
    assert (
        trapezoidal_by_acceleration(2.0, caught.value.minimum_time_s, 0.999 * least).duration_s
        > 3.0
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: trapezoidal_by_ramp(1.0, 1.0, 0.6),
            r"ramp_s = 0\.6 in 1\.0 s; must be > 0 and <= 0\.5",
        ),
        (lambda: trapezoidal_by_ramp(1.0, 1.0, 0.0), r"ramp_s = 0\.0"),
        (lambda: trapezoidal_by_speed(1.0, 1.0, 2.1), "must be > 1 and <= 2"),
        (lambda: trapezoidal_by_speed(1.0, 1.0, 1.0), "must be > 1 and <= 2"),
        (lambda: trapezoidal(1.0, alpha=0.51), r"alpha = 0\.51"),
        (lambda: trapezoidal_within(1.0, -1.0, 1.0), r"speed_m_s = -1\.0; must be 1e-09 to"),
        (lambda: trapezoidal_within(1.0, 1.0, math.inf), "acceleration_m_s2 = inf"),
        (lambda: trapezoidal_within(math.nan, 1.0, 1.0), "distance_m = nan"),
        (lambda: RectCascade(1.0, (0.0, 0.0)), "times_s of sum 0"),
        (lambda: RectCascade(1.0, (1.0, -0.1)), r"times_s\[1\] = -0\.1"),
        (lambda: RectCascade.within(1.0, [1.0] * 5), "5 limits of a law; must be <= 4"),
        (lambda: RectCascade.within(1.0, ()), "at least one must be finite"),
        (lambda: RectCascade.within(1.0, (math.inf, math.inf)), "at least one must be finite"),
        (lambda: double_s(1.0, beta=0.6), r"beta = 0\.6"),
        (
            lambda: double_s_by_ramp(1.0, 1.0, 0.4, 0.3),
            r"jerk_s = 0\.3 in 0\.4 s; must be > 0 and <= 0\.2",
        ),
        (lambda: fifteen_segments(1.0, gamma=0.0), r"gamma = 0\.0"),
        (lambda: double_s_within(1.0, 1.0, 1.0, math.inf), "jerk_m_s3 = inf of a double S"),
    ],
)
def test_specifications_without_a_move_are_refused_with_value_and_bound(make, words):
    with pytest.raises(PlanError, match=words):
        make()


@pytest.mark.parametrize(
    "move",
    [
        trapezoidal_within(0.0, 1.0, 2.0),
        RectCascade.within(-0.0, (1.0, 2.0, 3.0, 4.0)),
        double_s_within(0.0, 1.0, 2.0, 3.0),
    ],
)
def test_a_move_of_no_length_takes_no_time_and_stands_still(move):
    assert move.duration_s == 0.0
    path = move.trajectory().shifted(3.0)
    assert path.duration_s == 1e-9
    assert path.extent(0) == (3.0, 3.0)
    assert path.peak(1).value == 0.0


@pytest.mark.parametrize(
    "move",
    [
        trapezoidal_by_ramp(0.0, 2.0, 0.5),
        trapezoidal_by_acceleration(0.0, 2.0, 1.0),
        trapezoidal_by_speed(0.0, 2.0, 1.0),
    ],
)
def test_a_move_of_no_length_in_a_given_time_stands_still_for_it(move):
    assert move.duration_s == 2.0
    assert move.trajectory().peak(0).value == 0.0


def test_all_limits_of_the_fifteen_segment_example_are_reached():
    distance, *limits = DATA["fifteen_segments"]["limits"]
    move = RectCascade.within(distance, limits)
    assert move.duration_s == pytest.approx(DATA["fifteen_segments"]["duration"], rel=1e-14)
    path = move.trajectory()
    assert len(path.pieces) == 15
    assert [path.peak(k).value for k in (1, 2, 3, 4)] == pytest.approx(limits, rel=1e-12)
    assert path.continuous(3)


@given(st.floats(-20, 20), st.lists(sizes, min_size=1, max_size=4))
def test_a_cascade_keeps_its_limits_and_wastes_no_time(distance, limits):
    assume(abs(distance) > 1e-3)
    move = RectCascade.within(distance, limits)
    path = move.trajectory()
    assert float(path.at(path.duration_s)) == pytest.approx(distance, rel=1e-9)
    for k, limit in enumerate(limits):
        assert path.peak(k + 1).value <= limit * (1 + 1e-9)
        reached = move.peaks[k] == pytest.approx(limit, rel=1e-9)
        tight = move.times_s[k] == pytest.approx(sum(move.times_s[k + 1 :]), rel=1e-9)
        assert move.times_s[k] >= sum(move.times_s[k + 1 :]) * (1 - 1e-9)
        assert reached or tight


def test_a_day_at_constant_speed_does_not_magnify_the_rounding_of_its_ramps():
    move = RectCascade.within(1000.0, (0.01, 10.0, 1e4, 1e8))
    path = move.trajectory()
    assert path.duration_s == pytest.approx(1e5)
    assert float(path.at(path.duration_s)) == pytest.approx(1000.0, rel=1e-14)
    assert path.extent(1) == pytest.approx((0.0, 0.01), abs=1e-9)


@given(
    st.floats(0.1, 5.0),
    st.lists(st.floats(0.01, 2.0), min_size=1, max_size=4),
    st.floats(0.0, 60.0),
)
def test_the_transform_of_a_cascade_is_a_product_of_sincs(distance, times, w):
    path = RectCascade(distance, tuple(times)).trajectory()
    x, weights = np.polynomial.legendre.leggauss(96)
    halves = np.diff(path.breaks_s)[:, None] / 2.0
    t = path.breaks_s[:-1, None] + halves * (1.0 + x)
    found = np.sum(halves * weights * path.at(t, 1) * np.exp(-1j * w * t))
    expected = distance * np.prod([np.sinc(w * t / (2 * math.pi)) for t in times])
    assert abs(found) == pytest.approx(abs(expected), abs=1e-10 * distance)


def test_a_limit_of_infinity_is_no_limit():
    assert (
        RectCascade.within(2.0, (1.0, 2.0, math.inf)).times_s
        == RectCascade.within(2.0, (1.0, 2.0)).times_s
    )
    free = RectCascade.within(2.0, (math.inf, math.inf, 3.0))
    # case 2b: h = 2 j Tj^3
    assert free.duration_s == pytest.approx(4.0 * math.cbrt(2.0 / (2.0 * 3.0)))
    assert RectCascade.within(8.0, (math.inf, math.inf, math.inf, 1.0)).times_s == pytest.approx(
        (4.0, 2.0, 1.0, 1.0)
    )


@pytest.mark.parametrize("case", ["1a", "1b", "2a", "2b"])
def test_the_four_cases_of_the_double_s(case):
    h, v, a, j, jerk_s, ramp_s, cruise_s, duration_s, peak_a, peak_v = DATA["double_s"][case]
    move = double_s_within(-h, v, a, j)
    found = (
        move.up.jerk_s,
        move.up.duration_s,
        move.cruise_s,
        move.duration_s,
        move.peak_acceleration_m_s2,
        move.peak_speed_m_s,
    )
    assert found == pytest.approx((jerk_s, ramp_s, cruise_s, duration_s, peak_a, peak_v), rel=1e-9)
    assert move.trajectory().continuous(2)
    t = np.linspace(0.0, duration_s, 41)
    shares = double_s(
        duration_s, alpha=min(0.5, ramp_s / duration_s), beta=min(0.5, jerk_s / ramp_s)
    ).scaled(-h)
    np.testing.assert_allclose(move.trajectory().at(t), shares.at(t), atol=1e-8)


@pytest.mark.parametrize("case", ["1a", "2a"])
def test_the_printed_sign_of_the_deceleration_makes_the_position_jump(case):
    _, _, _, _, jerk_s, ramp_s, _, _, peak_a, _ = DATA["double_s"][case]
    inner = ramp_s - jerk_s
    jump = 2.0 * peak_a / 6.0 * (3.0 * inner**2 - 3.0 * jerk_s * inner + jerk_s**2)
    assert jump == pytest.approx(DATA["double_s_deceleration"][f"step_{case}"], abs=1e-3)


@given(st.floats(-30, 30), sizes, sizes, sizes)
def test_seven_segments_and_three_rects_are_the_same_move(h, v, a, j):
    assume(abs(h) > 1e-3)
    segments, rects = double_s_within(h, v, a, j), RectCascade.within(h, (v, a, j))
    assert segments.duration_s == pytest.approx(rects.duration_s, rel=1e-12)
    t = np.linspace(0.0, rects.duration_s, 23)
    np.testing.assert_allclose(
        segments.trajectory().at(t), rects.trajectory().at(t), atol=1e-10 * max(1.0, abs(h))
    )


@pytest.mark.parametrize("tie", [(10.0, 3.0, 3.0, 3.0), (4.0, 2.0, 1.0, 0.5), (2.0, 5.0, 1.0, 1.0)])
def test_both_branches_of_the_double_s_agree_where_they_meet(tie):
    durations = [
        double_s_within(tie[0] * (1 + e), *tie[1:]).duration_s for e in (-1e-10, 0.0, 1e-10)
    ]
    durations += [
        double_s_within(tie[0], tie[1], tie[2], tie[3] * (1 + e)).duration_s
        for e in (-1e-10, 1e-10)
    ]
    assert np.ptp(durations) < 1e-8


@given(
    h=st.floats(-10, 10),
    v=sizes,
    a=sizes,
    j=sizes,
    ends=st.tuples(st.floats(0, 1), st.floats(0, 1)),
)
def test_a_double_s_meets_its_end_speeds_within_its_limits(h, v, a, j, ends):
    assume(abs(h) > 1e-3)
    start, end = (math.copysign(share * v, h) for share in ends)
    try:
        move = double_s_within(h, v, a, j, start_speed_m_s=start, end_speed_m_s=end)
    except Infeasible:
        return
    path = move.trajectory()
    np.testing.assert_allclose(path.at([0.0, path.duration_s], 1), [start, end], atol=1e-9 * v)
    assert float(path.at(path.duration_s)) == pytest.approx(h, rel=1e-9)
    for order, limit in enumerate((v, a, j), start=1):
        assert path.peak(order).value <= limit * (1 + 1e-9)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"start_speed_m_s": -0.1}, r"start_speed_m_s = -0\.1 points against the move"),
        ({"end_speed_m_s": 1.1}, r"end_speed_m_s = 1\.1 with a limit of 1\.0 m/s"),
        ({"start_speed_m_s": math.nan}, "start_speed_m_s = nan"),
        (
            {"start_speed_m_s": 1.0},
            r"distance_m = 0\.1 for a change of speed from 1\.0 to 0\.0 m/s; "
            r"its absolute value must be >= 0\.75",
        ),
    ],
)
def test_a_double_s_outside_its_cases_is_refused_by_name(options, words):
    with pytest.raises(PlanError, match=words):
        double_s_within(0.1, 1.0, 1.0, 2.0, **options)


def test_a_double_s_is_refused_a_shorter_way_than_its_speeds_need_and_takes_just_that():
    just = double_s_within(-0.75, 1.0, 1.0, 2.0, start_speed_m_s=-1.0)
    assert just.duration_s == pytest.approx(1.5)
    assert just.peak_speed_m_s == 1.0


def test_double_s_agrees_with_ruckig():
    ruckig = pytest.importorskip("ruckig")
    rng = np.random.default_rng(5)
    seen = set()
    for _ in range(400):
        h = 10 ** rng.uniform(-2, 1.5) * rng.choice([-1, 1])
        limits = 10 ** rng.uniform([-1, -1, -1], [1, 1.5, 2])
        ends = np.sign(h) * limits[0] * rng.random(2) * rng.integers(0, 2, 2)
        try:
            move = double_s_within(h, *limits, start_speed_m_s=ends[0], end_speed_m_s=ends[1])
        except Infeasible:
            continue
        theirs = ruckig_answer(ruckig, h, limits, ends)
        assert move.duration_s == pytest.approx(theirs.duration, rel=1e-9)
        t = np.linspace(0.0, theirs.duration, 7)
        positions = [theirs.at_time(x)[0][0] for x in t.tolist()]
        np.testing.assert_allclose(move.trajectory().at(t), positions, atol=1e-9 * max(1.0, abs(h)))
        held = all(ramp.duration_s > 2.0 * ramp.jerk_s for ramp in (move.up, move.down))
        seen.add((bool(move.cruise_s), held, bool(ends[0]), bool(ends[1])))
    assert len(seen) == 16  # every case with every pattern of end speeds


def ruckig_answer(ruckig, h, limits, ends):
    problem, answer = ruckig.InputParameter(1), ruckig.Trajectory(1)
    problem.current_position, problem.target_position = [0.0], [h]
    problem.current_velocity, problem.target_velocity = [ends[0]], [ends[1]]
    problem.current_acceleration, problem.target_acceleration = [0.0], [0.0]
    problem.max_velocity, problem.max_acceleration, problem.max_jerk = ([limit] for limit in limits)
    ruckig.Ruckig(1).calculate(problem, answer)
    return answer


@pytest.mark.parametrize(
    "make",
    [
        lambda: quintic(1e100),
        lambda: between((0.0, 1.0), (1.0, 0.0), 1e200),
        lambda: between((0.0,) * 40, (1.0,), 1e-9),
        lambda: trapezoidal_by_acceleration(1.0, 1e-200, 1.0),
        lambda: RectCascade(1.0, (1e-300, 1e-300)),
        lambda: RectCascade.within(1e-300, (1.0, 1.0, 1.0, 1.0)),
        lambda: RectCascade.within(1e9, (1e-9,)),
        lambda: double_s_within(1e-300, 1.0, 1.0, 1.0),
        lambda: double_s_within(1.0, 1.0, 1e200, 1.0),
        lambda: double_s_within(0.0, 1.0, 1.0, 1.0, start_speed_m_s=0.5, end_speed_m_s=0.5),
        lambda: hermite_birkhoff([Condition(0.0, 0, 0.0), Condition(1e-320, 0, 1.0)]),
        lambda: hermite_birkhoff([Condition(0.0, 0, 0.0), Condition(1e200, 0, 1.0)]),
        lambda: minimum_time_s("cubic", 1.0, speed_m_s=1e-300),
        lambda: double_s(1.0, beta=1e-300),
    ],
)
def test_numbers_out_of_bounds_are_refused_by_name(make):
    with pytest.raises(PlanError, match=r" = .*; must "):
        make()


@every_law
@pytest.mark.parametrize("duration_s", [1e-9, 1e9])
def test_a_law_keeps_its_form_at_the_shortest_and_the_longest_time(name, duration_s):
    law, row = LAWS[name](duration_s), coefficients(name)
    assert law.peak(1).value * duration_s == pytest.approx(row.cv)
    assert law.peak(2).value * duration_s**2 == pytest.approx(row.ca)


@pytest.mark.parametrize("h", [1e-30, 1e-17, 1e9])
@pytest.mark.parametrize("size", [1.0, 1e12])
def test_moves_under_limits_end_in_place_at_the_bounds_of_distance_and_limit(h, size):
    for move in (RectCascade.within(h, (size,) * 4), double_s_within(h, size, size, size)):
        assert move.trajectory().at(math.inf) == pytest.approx(h, rel=1e-9)


def test_the_longest_ellipse_can_be_analysed_and_a_longer_one_is_refused():
    assert elliptic(1.0, 12.0).peak(1).value == pytest.approx(6.0 * math.pi)
    assert math.isfinite(elliptic(1.0, 12.0).rms(3))
    with pytest.raises(PlanError, match=r"axis_ratio = 12\.1; must be 1 to 12"):
        elliptic(1.0, 12.1)
