"""Trajectories against closed forms, dense sampling and quadrature of scipy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from planners.errors import PlanError
from planners.laws.harmonic import harmonic
from planners.trajectories.cells import exponential_integral
from planners.trajectories.motion import Motion
from planners.trajectories.pieces import ExpPolynomial, ModalTerm, Smooth, add, polynomial
from planners.trajectories.trajectory import Trajectory

QUINTIC = polynomial(1.0, (0.0, 0.0, 0.0, 10.0, -15.0, 6.0))
DAMPED = ExpPolynomial(
    1.7,
    (0.3, -0.2, 0.05),
    (ModalTerm(-0.4 + 9.0j, (0.2 - 0.1j, 0.05j)), ModalTerm(1.3 + 0j, (0.02 + 0j,))),
)
rates = st.builds(complex, st.floats(-3, 3), st.floats(0, 40))
numbers = st.floats(-2, 2)
pieces = st.builds(
    ExpPolynomial,
    st.floats(0.1, 3.0),
    st.tuples(numbers, numbers, numbers, numbers),
    st.lists(
        st.builds(lambda r, a, b: ModalTerm(r, (complex(a, b),)), rates, numbers, numbers),
        max_size=3,
    ).map(tuple),
)


def wave(t, order):
    return 3.0**order * np.sin(3.0 * t + order * math.pi / 2)


def bump(t, order):
    value = np.exp(-(((t - 0.5) / 0.02) ** 2))
    return value if order == 0 else -2 * (t - 0.5) / 4e-4 * value


@pytest.mark.parametrize("piece", [QUINTIC, DAMPED, Smooth(1.7, wave, 6)])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_each_derivative_is_the_slope_of_the_one_before(piece, order):
    t, h = np.linspace(0.1, piece.duration_s - 0.1, 40), 1e-5
    slope = (piece.at(t + h, order - 1) - piece.at(t - h, order - 1)) / (2 * h)
    np.testing.assert_allclose(piece.at(t, order), slope, atol=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("piece", [QUINTIC, DAMPED, Smooth(1.7, wave, 6)])
def test_a_window_is_the_same_function_on_its_own_clock(piece):
    part = piece.window(0.3, 0.6)
    t = np.linspace(0.0, 0.6, 31)
    for order in range(3):
        np.testing.assert_allclose(
            part.at(t, order), piece.at(t + 0.3, order), rtol=1e-12, atol=1e-12
        )


@pytest.mark.parametrize("a", [QUINTIC, DAMPED.window(0.0, 1.0), Smooth(1.0, wave, 6)])
@pytest.mark.parametrize("b", [QUINTIC, DAMPED.window(0.0, 1.0), Smooth(1.0, wave, 4)])
def test_kinds_add_and_scale_pointwise(a, b):
    t = np.linspace(0.0, 1.0, 17)
    np.testing.assert_allclose(
        add(a, b.scaled(-2.0)).at(t, 2), a.at(t, 2) - 2.0 * b.at(t, 2), rtol=1e-12, atol=1e-9
    )


def test_integral_undoes_derivative():
    start = float(DAMPED.at(np.zeros(())))
    t = np.linspace(0.0, DAMPED.duration_s, 23)
    np.testing.assert_allclose(DAMPED.derivative().integral(start).at(t), DAMPED.at(t), atol=1e-13)


def test_a_trajectory_stands_still_before_and_after():
    move = Trajectory((polynomial(2.0, (1.0, 0.5)),))
    np.testing.assert_array_equal(move.at([-1.0, 0.0, 1.0, 2.0, 9.0]), [1.0, 1.0, 1.5, 2.0, 2.0])
    np.testing.assert_array_equal(move.at([-1.0, 0.0, 1.0, 2.0, 9.0], 1), [0.0, 0.5, 0.5, 0.5, 0.0])


@pytest.mark.parametrize("shape", [(), (1,), (7,), (2, 3), (0,)])
def test_the_result_has_the_shape_of_the_times(shape):
    assert harmonic(1.0).at(np.full(shape, 0.4)).shape == shape
    assert Motion.along("x", harmonic(1.0)).at(np.full(shape, 0.4)).shape == (*shape, 3)


def test_times_may_come_in_any_order():
    move = harmonic(1.0).then(Trajectory.hold(1.0, 0.5)).then(harmonic(0.7).shifted(1.0))
    t = np.random.default_rng(3).uniform(-0.5, 3.0, (50, 4))
    one_by_one = [[float(move.at(x, 1)) for x in row] for row in t]
    np.testing.assert_allclose(move.at(t, 1), one_by_one, atol=1e-15)


def test_a_joint_belongs_to_the_piece_that_begins_there():
    zigzag = Trajectory((polynomial(1.0, (0.0, 1.0)), polynomial(1.0, (1.0, -1.0))))
    assert [float(zigzag.at(t, 1)) for t in (0.5, 1.0, 2.0)] == [1.0, -1.0, -1.0]


def test_the_quintic_has_its_textbook_peaks():
    move = Trajectory((QUINTIC,))
    assert move.peak(1).value == pytest.approx(15 / 8, rel=1e-14)
    assert move.peak(2).value == pytest.approx(10 / math.sqrt(3), rel=1e-14)
    assert move.extent(3) == pytest.approx((-30.0, 60.0), rel=1e-13)
    assert move.rms(1) == pytest.approx(math.sqrt(10 / 7), rel=1e-13)


def test_the_harmonic_law_has_its_textbook_peaks():
    move = harmonic(0.8)
    assert move.peak(1).value == pytest.approx(math.pi / 2 / 0.8, rel=1e-14)
    assert move.peak(1).t_s == pytest.approx(0.4, abs=1e-12)
    assert move.peak(2).value == pytest.approx(math.pi**2 / 2 / 0.64, rel=1e-14)
    assert move.rms(2) == pytest.approx(math.pi**2 / (2 * math.sqrt(2)) / 0.64, rel=1e-13)


def test_a_high_degree_hides_no_extreme():
    chebyshev = np.polynomial.Chebyshev.basis(20).convert(kind=np.polynomial.Polynomial)
    move = Trajectory((polynomial(1.0, chebyshev.coef),))  # ten times to -1 and to 1 on 0..1
    assert move.extent() == pytest.approx((-1.0, 1.0), abs=1e-9)
    assert move.rms() == pytest.approx(math.sqrt(0.5 - 0.5 / (4 * 20**2 - 1)), rel=1e-9)


def test_instants_of_peaks_are_polished():
    decay, w = 0.3, 50.0
    wave = ModalTerm(complex(-decay, w), (-1j,))  # exp(-0.3 t) sin(50 t)
    move = Trajectory((ExpPolynomial(5.0, (0.0,), (wave,)),))
    first = math.atan2(w, decay) / w
    assert move.peak().t_s == pytest.approx(first, abs=1e-12)
    assert move.peak().value == pytest.approx(
        math.exp(-decay * first) * math.sin(w * first), rel=1e-14
    )


def test_a_narrow_bump_of_a_smooth_piece_is_found():
    move = Trajectory((Smooth(1.3, bump, 1),))
    assert move.peak().value == pytest.approx(1.0, rel=1e-12)
    assert move.peak().t_s == pytest.approx(0.5, abs=1e-9)
    assert move.peak(1).value == pytest.approx(math.sqrt(2 / math.e) / 0.02, rel=1e-10)
    assert move.rms() == pytest.approx(math.sqrt(0.02 * math.sqrt(math.pi / 2) / 1.3), rel=1e-10)


def test_a_stiff_lag_is_resolved():
    tau = 1 / (20 * math.pi)  # T / tau = 126
    move = Trajectory(
        (
            ExpPolynomial(
                2.0,
                (0.0,),
                (
                    ModalTerm(complex(-1 / tau), (1.0 + 0j,)),
                    ModalTerm(complex(1 / tau), (1e-55 + 0j,)),
                ),
            ),
        )
    )
    assert move.rms() == pytest.approx(
        math.sqrt((tau / 2 + 1e-110 * tau / 2 * math.exp(4 / tau) + 4e-55) / 2.0), rel=1e-9
    )
    assert move.peak() == pytest.approx((1.0, 0.0), abs=1e-12)


def size_of_terms(piece, order):
    """Size of the terms of a derivative, which may cancel: their sum has its rounding."""
    if not isinstance(piece, ExpPolynomial):
        return 0.0
    size = sum(abs(c) * piece.duration_s**k for k, c in enumerate(piece.coefficients))
    for mode in piece.modes:
        growth = math.exp(max(0.0, mode.rate_1_s.real) * piece.duration_s)
        terms = sum(abs(c) * piece.duration_s**k for k, c in enumerate(mode.coefficients))
        size += terms * growth * max(1.0, abs(mode.rate_1_s)) ** order
    return size


@settings(max_examples=60, deadline=None)
@given(piece=pieces, order=st.integers(0, 3))
def test_extremes_bound_every_sample_and_are_met(piece, order):
    move = Trajectory((piece,))
    t = np.linspace(0.0, piece.duration_s, 4001)
    v, (low, high), peak = move.at(t, order), move.extent(order), move.peak(order)
    rounding = 1e-12 * peak.value + 1e-15 * size_of_terms(piece, order)
    assert low - rounding <= v.min()
    assert v.max() <= high + rounding
    assert peak.value == max(-low, high)
    assert abs(float(move.at(min(peak.t_s, move.duration_s), order))) == pytest.approx(
        peak.value, rel=1e-12, abs=rounding
    )


@settings(max_examples=25, deadline=None)
@given(piece=pieces)
def test_mean_squares_agree_with_adaptive_quadrature(piece):
    square, _ = quad(
        lambda t: float(piece.at(np.asarray(t), 1)) ** 2,
        0.0,
        piece.duration_s,
        epsrel=1e-11,
        limit=400,
    )
    assert Trajectory((piece,)).rms(1) == pytest.approx(
        math.sqrt(square / piece.duration_s), rel=1e-9, abs=1e-12
    )


@pytest.mark.parametrize("piece", [DAMPED, Smooth(1.7, wave, 6)])
def test_the_exponential_integral_agrees_with_adaptive_quadrature(piece):
    rate = complex(-0.7, 31.0)

    def part(of):
        return quad(
            lambda t: of(piece.at(np.asarray(t), 1) * np.exp(rate * (1.7 - t))),
            0,
            1.7,
            epsabs=1e-12,
            limit=400,
        )[0]

    truth = complex(part(lambda z: z.real), part(lambda z: z.imag))
    assert abs(exponential_integral(piece, 1, np.array([rate]))[0] - truth) < 1e-11


def test_continuity_counts_joints_and_ends():
    assert harmonic(1.0).continuous(1)
    assert not harmonic(1.0).continuous(2)
    assert Trajectory((QUINTIC,)).continuous(2)
    assert not Trajectory((QUINTIC,)).continuous(3)
    assert Trajectory((QUINTIC.window(0.0, 0.3), QUINTIC.window(0.3, 0.7))).continuous(2)
    assert not Trajectory((QUINTIC.window(0.0, 0.3), QUINTIC.window(0.31, 0.69))).continuous(0)
    ramp = Trajectory((polynomial(1.0, (0.0, 1.0)),))  # steps in speed; its acceleration is 0
    assert not ramp.continuous(2)
    assert Trajectory.hold(0.2, 1.0).continuous(3)


def test_parts_run_one_after_the_other():
    there = harmonic(1.0)
    both = there.then(there.scaled(-1.0).shifted(1.0))
    assert both.duration_s == 2.0
    np.testing.assert_allclose(both.at([0.5, 1.0, 1.5, 2.0]), [0.5, 1.0, 0.5, 0.0], atol=1e-15)


def test_a_step_between_parts_is_refused_with_both_positions():
    with pytest.raises(PlanError, match=r"steps from 1\.0 m to 0\.0 m"):
        harmonic(1.0).then(harmonic(1.0))


@pytest.mark.parametrize("duration", [0.0, -1.0, math.inf, math.nan])
def test_a_piece_without_a_finite_duration_is_refused(duration):
    with pytest.raises(PlanError, match="duration_s"):
        Trajectory.hold(0.0, duration)
    with pytest.raises(PlanError, match="duration_s"):
        harmonic(duration)


def test_other_bad_input_is_refused_by_name():
    with pytest.raises(PlanError, match="0 pieces"):
        Trajectory(())
    with pytest.raises(PlanError, match="nan"):
        harmonic(1.0).at([0.0, math.nan])
    with pytest.raises(PlanError, match="order 7 of a smooth piece; must be <= 6"):
        Trajectory((Smooth(1.0, wave, 6),)).at(0.5, 7)
    with pytest.raises(PlanError, match="split the piece"):
        Trajectory((Smooth(1.0, lambda t, order: np.abs(t - 0.3), 0),)).peak()


def test_a_motion_holds_its_other_axes_and_waits_for_the_slowest():
    first = Motion.along("y", harmonic(1.0), others_m=(0.1, 0.0, -0.8))
    np.testing.assert_allclose(
        first.at([0.0, 0.5, 3.0]), [[0.1, 0.0, -0.8], [0.1, 0.5, -0.8], [0.1, 1.0, -0.8]]
    )
    np.testing.assert_allclose(first.at(0.5, 1), [0.0, math.pi / 2, 0.0], atol=1e-15)
    uneven = Motion(harmonic(1.0), harmonic(2.0), Trajectory.hold(0.0, 0.5))
    back = Motion(
        *(axis.scaled(-1.0).shifted(float(axis.at(9.0))) for axis in (uneven.x, uneven.y, uneven.z))
    )
    both = uneven.then(back)
    assert both.duration_s == 4.0
    np.testing.assert_allclose(both.at([1.5, 2.5, 4.0])[:, 0], [1.0, 0.5, 0.0], atol=1e-15)
    with pytest.raises(PlanError, match="axis = 'w'"):
        Motion.along("w", harmonic(1.0))
