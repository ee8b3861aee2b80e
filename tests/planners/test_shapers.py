"""Shapers against their defining conditions and published numbers; residual swing of moves."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import linprog

from planners.errors import Infeasible, PlanError
from planners.laws import LAWS
from planners.models.chain import ChainModel, Link
from planners.models.pendulum import PendulumModel
from planners.problem import Problem
from planners.shapers import (
    SHAPERS,
    Shaper,
    convolve,
    insensitivity,
    joint,
    residual,
    transform,
    zero_vibration,
    zv,
    zvd,
)
from planners.shapers.formulas import MAX_DAMPING_RATIO
from planners.shapers.plan_shaped import SHAPED, plan_shaped, shape

TURN = 2 * math.pi
METRE = PendulumModel(length_m=1.0)
BAR = Link(0.5, 3.375)
DOUBLE = ChainModel(links=(BAR, BAR), stiffness_n_m_rad=(10.0,))  # source 004, section 4.1

ZERO_FAMILY = {"zv": 0, "zvd": 1, "zvdd": 2, "zvddd": 3}  # derivatives that are 0
HUMPS = {"ei": 1, "ei_two_hump": 2, "ei_three_hump": 3}
EXACT_AT_THE_MODE = sorted(set(SHAPERS) - {"ei", "ei_three_hump"})

# source 001: impulses at zeta = 0.05, w = 1
IMPULSES = {
    "zv": ([0.53923824, 0.46076176], [0.0, 3.145527]),
    "zvd": ([0.29077788, 0.49692072, 0.2123014], [0.0, 3.145527, 6.291054]),
    "zvdd": (
        [0.15679855, 0.40193798, 0.3434431, 0.097820367],
        [0.0, 3.145527, 6.291054, 9.4365811],
    ),
}
# Source 001: residual vibration [%] of shapers for (w, zeta), at the same instant and by Singer &
# Seering, on modes with OFF times (w, zeta).
OFF = [(1.1, 1.2), (1.1, 0.8), (0.9, 1.2), (0.9, 0.8)]
ROBUSTNESS = [
    (
        "zv",
        0.01,
        [15.973649, 15.863507, 15.912783, 15.823142],
        [15.324753, 15.43093, 15.381906, 15.469231],
    ),
    (
        "zvd",
        0.01,
        [2.5515748, 2.5165086, 2.5321667, 2.5037183],
        [2.3484805, 2.381136, 2.3660303, 2.3929711],
    ),
    (
        "zvdd",
        0.01,
        [0.40757961, 0.39920653, 0.40293821, 0.3961669],
        [0.35989883, 0.36743143, 0.36394055, 0.37017423],
    ),
    (
        "zv",
        0.05,
        [17.420708, 16.825093, 17.07479, 16.600583],
        [14.154814, 14.650408, 14.407439, 14.823279],
    ),
    (
        "zvd",
        0.05,
        [3.0348105, 2.8308374, 2.9154845, 2.7557936],
        [2.0035877, 2.1463446, 2.0757429, 2.197296],
    ),
    (
        "zvdd",
        0.05,
        [0.52868547, 0.47629103, 0.49781286, 0.4574778],
        [0.28360412, 0.31444824, 0.29906139, 0.32571131],
    ),
    (
        "zv",
        0.1,
        [19.559693, 18.232198, 18.744946, 17.718696],
        [12.893091, 13.809217, 13.328743, 14.115679],
    ),
    (
        "zvd",
        0.1,
        [3.825816, 3.3241306, 3.51373, 3.139522],
        [1.6623181, 1.9069447, 1.776554, 1.992524],
    ),
    (
        "zvdd",
        0.1,
        [0.74831789, 0.60606208, 0.65864678, 0.55628238],
        [0.21432419, 0.26333413, 0.23679233, 0.28125829],
    ),
]
# Measured undamped behaviour: duration in periods; V [%]; I5 and I10, sampled every 0.0025 to 0.005
# and so up to 0.005 too wide; worst V [%] within 10 % and 20 %. The published ei family was a fit
# in damping, 0.1 % off its conditions: not so here.
MEASURED = [
    ("zv", 0.5, 0.0, 0.065, 0.130, 15.6, 30.9),
    ("um_zv", 1 / 3, 0.0, 0.056, 0.113, 18.7, 38.2),
    ("mzv", 0.75, 0.0, 0.106, 0.219, 10.8, 23.3),
    ("zvd", 1.0, 0.0, 0.290, 0.414, 2.4, 9.5),
    ("ei", 1.0, 5.0, 0.399, 0.495, 5.0, 5.0),
    ("zvdd", 1.5, 0.0, 0.484, 0.619, 0.4, 3.0),
]
# Source 004, figures of section 3.3 recomputed: residual swing [mrad] on a cable of this length of
# a plan for 1 m, exact delays.
LENGTHS_M = [0.70, 0.80, 0.90, 0.95, 1.05, 1.10, 1.20, 1.30]
SENSITIVITY = [
    ("zv", 2.0, [61.0, 34.1, 14.5, 6.68, 5.75, 10.7, 18.7, 24.6]),
    ("zv", 1.5, [79.4, 42.9, 17.7, 8.08, 6.82, 12.6, 21.7, 28.2]),
    ("zvd", 2.5, [24.0, 7.91, 1.50, 0.329, 0.257, 0.920, 2.96, 5.42]),
]


def mode(frequency_rad_s=1.0, damping_ratio=0.0):
    return frequency_rad_s * complex(-damping_ratio, math.sqrt(1 - damping_ratio**2))


def problem_of(distance_m=0.2, time_s=2.0, model=METRE, **more):
    return Problem(distance_m=distance_m, time_s=time_s, model=model, **more)


def swing(trajectory, rate):
    """Compute the residual of a mode, |int exp(rate (T - t)) a(t) dt|, by Gauss quadrature."""
    x, w = np.polynomial.legendre.leggauss(60)
    total = 0j
    for begin, piece in zip(trajectory.breaks_s, trajectory.pieces, strict=False):
        t = piece.duration_s * (x + 1) / 2
        total += (
            piece.duration_s
            / 2
            * (w * piece.at(t, 2))
            @ np.exp(rate * (trajectory.duration_s - begin - t))
        )
    return abs(total)


modes = st.builds(mode, st.floats(0.2, 20.0), st.one_of(st.just(0.0), st.floats(1e-5, 0.9)))


@pytest.mark.parametrize("name", sorted(IMPULSES))
def test_a_shaper_has_the_published_impulses(name):
    amplitudes, times = IMPULSES[name]
    shaper = SHAPERS[name](mode(1.0, 0.05))
    np.testing.assert_allclose(shaper.amplitudes, amplitudes, atol=6e-9)
    np.testing.assert_allclose(shaper.times_s, times, atol=6e-8)


@pytest.mark.parametrize("name", sorted(ZERO_FAMILY))
@given(rate=modes)
def test_a_zero_vibration_shaper_has_zero_residual_and_zero_derivatives(name, rate):
    shaper, n = SHAPERS[name](rate), ZERO_FAMILY[name]
    assert shaper.amplitudes.sum() == pytest.approx(1.0, abs=1e-14)
    assert residual(shaper, rate) < 1e-14
    near, nearer = residual(shaper, rate * np.array([1.002, 1.001]))
    assert math.log2(near / nearer) == pytest.approx(
        n + 1, abs=0.05
    )  # V grows with this power of the detuning


@given(rate=modes)
def test_mzv_has_zero_residual_at_any_damping(rate):
    shaper = SHAPERS["mzv"](rate)
    assert shaper.amplitudes.sum() == pytest.approx(1.0, abs=1e-14)
    assert (shaper.amplitudes > 0).all()
    np.testing.assert_allclose(shaper.times_s * rate.imag / TURN, [0, 0.375, 0.75], rtol=1e-14)
    assert residual(shaper, rate) < 1e-14


def test_mzv_without_damping_has_root_two_in_the_middle():
    np.testing.assert_allclose(
        SHAPERS["mzv"](1j).amplitudes,
        np.array([1, math.sqrt(2), 1]) / (2 + math.sqrt(2)),
        rtol=1e-14,
    )


@settings(max_examples=40)
@given(frequency=st.floats(0.2, 20.0), zeta=st.floats(0.0, MAX_DAMPING_RATIO["um_zv"]))
def test_um_zv_has_zero_residual_with_impulses_of_one(frequency, zeta):
    rate = mode(frequency, zeta)
    shaper = SHAPERS["um_zv"](rate)
    np.testing.assert_array_equal(shaper.amplitudes, [1, -1, 1])
    assert (np.diff(shaper.times_s) > 0).all()
    assert shaper.times_s[-1] < math.pi / rate.imag  # shorter than zv
    assert residual(shaper, rate) < 1e-12


def test_um_zv_without_damping_comes_at_sixths_of_the_period():
    np.testing.assert_allclose(SHAPERS["um_zv"](1j).times_s / TURN, [0, 1 / 6, 1 / 3], rtol=1e-14)


@pytest.mark.parametrize("name", sorted(HUMPS))
@settings(max_examples=25)
@given(data=st.data())
def test_an_extra_insensitive_shaper_has_its_humps_at_five_percent_between_zeros(name, data):
    rate, humps = (
        mode(data.draw(st.floats(0.2, 20.0)), data.draw(st.floats(0.0, MAX_DAMPING_RATIO[name]))),
        HUMPS[name],
    )
    shaper = SHAPERS[name](rate)
    assert len(shaper.times_s) == humps + 2
    assert shaper.amplitudes.sum() == pytest.approx(1.0, abs=1e-12)
    assert (shaper.amplitudes > 0).all()
    assert (np.diff(shaper.times_s) > 0).all()
    assert residual(shaper, rate) == pytest.approx(0.05 * (humps % 2), abs=1e-12)
    ratios = np.arange(0.3, 2.5, 5e-4)
    v = residual(shaper, ratios * rate)
    inside, left, right = v[1:-1], v[:-2], v[2:]
    zeros = np.flatnonzero((inside < left) & (inside < right) & (inside < 3e-3))[: humps + 1]
    tops = np.flatnonzero((inside > left) & (inside > right))
    tops = tops[(tops > zeros[0]) & (tops < zeros[-1])]
    assert len(zeros) == humps + 1
    np.testing.assert_allclose(inside[tops], [0.05] * humps, atol=2e-6)


@pytest.mark.parametrize(("name", "periods", "nominal", "i5", "i10", "ten", "twenty"), MEASURED)
def test_undamped_shapers_are_as_robust_as_measured(name, periods, nominal, i5, i10, ten, twenty):
    shaper, off = SHAPERS[name](1j), np.linspace(-1, 1, 2001)
    assert shaper.times_s[-1] / TURN == pytest.approx(periods, rel=1e-12)
    assert 100 * residual(shaper, 1j) == pytest.approx(nominal, abs=1e-9)
    for tolerance, width in ((0.05, i5), (0.1, i10)):
        assert width - 0.005 <= insensitivity(SHAPERS[name], 1j, tolerance) <= width + 0.001
    for reach, worst in ((0.1, ten), (0.2, twenty)):
        assert 100 * residual(shaper, 1j * (1 + reach * off)).max() == pytest.approx(
            worst, abs=0.06
        )


@pytest.mark.parametrize(
    ("name", "exact"), [("zv", 0.063688533), ("zvd", 0.28713259), ("zvdd", 0.48038153)]
)
def test_the_width_of_the_five_percent_band_is_the_published_one(name, exact):
    assert insensitivity(SHAPERS[name], 1j) == pytest.approx(exact, abs=6e-9)


@pytest.mark.parametrize(
    ("name", "width"), [("ei", 0.399), ("ei_two_hump", 0.73), ("ei_three_hump", 0.96)]
)
def test_the_humped_shapers_are_as_wide_as_commonly_quoted(name, width):
    assert insensitivity(SHAPERS[name], 1j) == pytest.approx(width, abs=0.006)


@pytest.mark.parametrize("name", sorted(ZERO_FAMILY))
@settings(max_examples=15)
@given(frequency=st.floats(0.2, 20.0), tolerance=st.floats(1e-3, 0.9))
def test_without_damping_the_band_has_a_closed_form(name, frequency, tolerance):
    edge = (
        2 / math.pi * math.acos(tolerance ** (1 / (ZERO_FAMILY[name] + 1)))
    )  # V = |cos(pi f / 2)|^(n + 1)
    assert insensitivity(SHAPERS[name], mode(frequency), tolerance) == pytest.approx(
        2 * (1 - edge), abs=1e-8
    )


@pytest.mark.parametrize("name", sorted(SHAPERS))
def test_a_damped_band_ends_where_the_residual_meets_the_tolerance(name):
    rate, shaper = mode(3.0, 0.06), SHAPERS[name](mode(3.0, 0.06))
    width = insensitivity(SHAPERS[name], rate, 0.07)
    ratios = np.linspace(1 - width, 1 + width, 200001)
    inside = ratios[residual(shaper, ratios * rate) <= 0.07]
    assert inside[-1] - inside[0] == pytest.approx(width, abs=3e-5)


def test_a_band_may_be_empty_or_unbounded():
    assert insensitivity(SHAPERS["ei"], 1j, 0.04) == 0.0
    assert (
        insensitivity(zv, mode(1.0, 0.99), 0.3) == math.inf
    )  # the second impulse alone leaves less


@pytest.mark.parametrize(("name", "zeta", "same_time", "singer_seering"), ROBUSTNESS)
def test_wrong_frequency_and_damping_leave_the_published_share(
    name, zeta, same_time, singer_seering
):
    shaper = SHAPERS[name](mode(1.0, zeta))
    rates = np.array([mode(w, zeta * factor) for w, factor in OFF])
    np.testing.assert_allclose(100 * np.abs(transform(shaper, rates)), same_time, rtol=1e-7)
    np.testing.assert_allclose(100 * residual(shaper, rates), singer_seering, rtol=1e-7)


@pytest.mark.parametrize(("name", "left"), [("zv", [1.726, 1.671]), ("zvd", [0.030, 0.028])])
def test_shapers_are_insensitive_to_an_error_of_damping_alone(name, left):
    shaper = SHAPERS[name](mode(1.0, 0.05))
    np.testing.assert_allclose(
        100 * np.abs(transform(shaper, [mode(1, 0.06), mode(1, 0.04)])), left, atol=6e-4
    )


@given(rate=modes, off=st.floats(0.5, 1.5))
def test_the_residual_is_that_of_an_oscillator_after_the_impulses(rate, off):
    shaper, real = zvd(rate), rate * off
    a = np.array([[0.0, 1.0], [-(abs(real) ** 2), 2 * real.real]])
    state, now = np.zeros(2), 0.0
    for amplitude, t in zip(*shaper, strict=True):
        state = expm(a * (t - now)) @ state + [0.0, amplitude]
        now = t
    kept = math.hypot(real.imag * state[0], state[1] - real.real * state[0])
    assert residual(shaper, real) == pytest.approx(kept, abs=1e-11)


def test_rates_keep_their_shape():
    assert residual(zv(1j), [[1j, 2j, 3j], [1j, 1j, 1j]]).shape == (2, 3)
    assert transform(zv(1j), 2j).shape == ()


@given(a=modes, b=modes)
def test_a_cascade_multiplies_the_transforms_and_adds_the_lengths(a, b):
    both, probe = convolve(zv(a), zvd(b)), 1j * np.linspace(0.1, 5.0, 7)
    np.testing.assert_allclose(
        transform(both, probe), transform(zv(a), probe) * transform(zvd(b), probe), atol=1e-10
    )
    assert both.times_s[-1] == pytest.approx(zv(a).times_s[-1] + zvd(b).times_s[-1], rel=1e-14)
    assert (np.diff(both.times_s) > 0).all()


def test_coinciding_impulses_are_one():
    twice = convolve(zv(mode(0.7, 0.1)), zv(mode(0.7, 0.1)))
    for ours, exact in zip(twice, zvd(mode(0.7, 0.1)), strict=True):
        np.testing.assert_allclose(ours, exact, rtol=1e-14)


def test_the_double_pendulum_takes_the_published_time():
    rates = DOUBLE.oscillatory_eigenvalues_1_s
    assert [math.pi / rate.imag for rate in rates] == pytest.approx([0.822425, 0.192744], abs=6e-7)
    assert convolve(*map(zv, rates)).times_s[-1] == pytest.approx(1.01517, abs=6e-6)
    assert convolve(*map(zvd, rates)).times_s[-1] == pytest.approx(2.03034, abs=6e-6)


@settings(max_examples=12)
@given(
    ratios=st.lists(
        st.one_of(st.floats(1.0, 12.0), st.floats(1e-9, 1e-3).map(lambda x: 1 + x)),
        min_size=1,
        max_size=2,
    ),
    zeta=st.one_of(st.just(0.0), st.floats(1e-4, 0.3)),
    derivatives=st.integers(0, 1),
)
def test_a_joint_shaper_is_positive_exact_and_never_longer_than_the_cascade(
    ratios, zeta, derivatives
):
    rates = [mode(0.7, zeta), *(mode(0.7 * ratio, zeta) for ratio in ratios)]
    shaper = joint(rates, derivatives)
    assert shaper.amplitudes.sum() == pytest.approx(1.0, abs=1e-11)
    assert (shaper.amplitudes > 0).all()
    assert shaper.times_s[0] == 0.0
    assert (np.diff(shaper.times_s) > 0).all()
    assert residual(shaper, rates).max() < 1e-8
    cascade = convolve(*(zero_vibration(rate, derivatives) for rate in rates))
    assert shaper.times_s[-1] <= cascade.times_s[-1] * (1 + 1e-12)


@pytest.mark.parametrize("derivatives", [0, 1])
@pytest.mark.parametrize("ratio", [1.3, 1.5, 2.0, 2.5, 2.9, 3.0])
def test_two_undamped_modes_jointly_take_as_many_mean_half_periods_as_there_are_zeros(
    ratio, derivatives
):
    # Three symmetric impulses at 0, T/2, T: cos(w1 T/2) = cos(w2 T/2), so T = 4 pi / (w1 + w2), as
    # long as it is > T1 / 2.
    shaper = joint([1j, 1j * ratio], derivatives)
    assert shaper.times_s[-1] == pytest.approx(
        (derivatives + 1) * 4 * math.pi / (1 + ratio), rel=1e-9
    )
    assert residual(shaper, [1j, 1j * ratio]).max() < 1e-12


@pytest.mark.parametrize("derivatives", [0, 1])
@pytest.mark.parametrize("zeta", [0.0, 0.05])
@pytest.mark.parametrize("ratios", [(1, 2.5), (1, 4.267), (1, 7.3), (1, 2.4, 4.0)])
def test_no_positive_shaper_is_two_percent_shorter(ratios, zeta, derivatives):
    rates = np.array([mode(ratio, zeta) for ratio in ratios])
    shaper = joint(rates.tolist(), derivatives)
    for k in range(derivatives + 1):  # the conditions themselves, as sums
        lags = shaper.times_s[-1] - shaper.times_s
        assert np.abs(np.exp(np.outer(rates, lags)) @ (shaper.amplitudes * lags**k)).max() < 1e-10
    lags = 0.98 * shaper.times_s[-1] * np.linspace(1, 0, 801)
    rows = np.vstack([np.exp(np.outer(rates, lags)) * lags**k for k in range(derivatives + 1)])
    rows = np.vstack([rows.real, rows.imag])
    least = linprog(  # the largest violation, made small
        np.append(np.zeros(lags.size), 1.0),
        A_ub=np.hstack([np.vstack([rows, -rows]), -np.ones((2 * len(rows), 1))]),
        b_ub=np.zeros(2 * len(rows)),
        A_eq=np.append(np.ones(lags.size), 0.0)[None],
        b_eq=[1.0],
    )
    assert least.fun > 3e-6


def test_the_joint_shaper_of_one_mode_is_its_zv():
    for rates in ([mode(2.0, 0.1)], [mode(2.0, 0.1)] * 3):
        for ours, exact in zip(joint(rates), zv(mode(2.0, 0.1)), strict=True):
            np.testing.assert_array_equal(ours, exact)
    np.testing.assert_array_equal(joint([1j], 2).amplitudes, [0.125, 0.375, 0.375, 0.125])


@pytest.mark.parametrize("model", [METRE, PendulumModel(length_m=0.4, damping_ratio=0.05), DOUBLE])
@pytest.mark.parametrize("name", SHAPED)
def test_a_shaped_move_ends_in_time_with_the_residual_of_its_shaper(name, model):
    time_s = 3.2 * max(
        convolve(*(SHAPERS["zvd"](rate) for rate in model.oscillatory_eigenvalues_1_s)).times_s
    )
    moved = plan_shaped(name, problem_of(0.3, time_s, model, start_m=-0.1))
    assert moved.duration_s == pytest.approx(time_s, rel=1e-12)
    assert moved.at([0.0, time_s]) == pytest.approx([-0.1, 0.2], abs=1e-12)
    share = 0.05 if HUMPS.get(name, 0) % 2 else 0.0
    for rate in model.oscillatory_eigenvalues_1_s:
        assert swing(moved, rate) <= share * 2 * moved.peak(1).value + 1e-11


@pytest.mark.parametrize("name", ["zv", "zvd", "zv_joint", "zvd_joint"])
def test_a_shaped_move_leaves_a_damped_double_pendulum_at_rest(name):
    model = ChainModel(
        links=(BAR, BAR),
        stiffness_n_m_rad=(10.0,),
        joint_damping_n_m_s_rad=(0.3,),
        damping_ratio=0.02,
    )
    moved = plan_shaped(name, problem_of(0.2, 2.5, model))
    a, b = model.equations.swing()
    state = np.zeros(4)
    for begin, piece in zip(moved.breaks_s, moved.pieces, strict=False):

        def rates(t, x, piece=piece):
            return a @ x + b * float(piece.at(np.asarray(t), 2))

        state = solve_ivp(rates, (0, piece.duration_s), state, "DOP853", rtol=1e-11, atol=1e-13).y[
            :, -1
        ]
        assert begin < 2.5
    assert abs(state).max() < 1e-9


@pytest.mark.parametrize(("name", "time_s", "left_mrad"), SENSITIVITY)
def test_a_cable_of_another_length_keeps_the_published_swing(name, time_s, left_mrad):
    moved = plan_shaped(name, problem_of(0.2, time_s))
    ours = [
        1e3 * swing(moved, 1j * math.sqrt(9.81 / length)) / math.sqrt(9.81 * length)
        for length in LENGTHS_M
    ]
    np.testing.assert_allclose(
        ours, left_mrad, rtol=5e-3, atol=2e-3
    )  # theirs is off by 0.0014 at 1 m, where it is 0


@pytest.mark.parametrize("name", sorted(SHAPERS))
@pytest.mark.parametrize("time_s", [0.3, 4.0])  # copies of the law apart, and overlapping
def test_shaping_is_the_sum_of_delayed_copies(name, time_s):
    law, shaper = LAWS["harmonic"](time_s), SHAPERS[name](mode(2.0, 0.03))
    t = np.linspace(-0.1, time_s + shaper.times_s[-1] + 0.1, 301)
    copies = sum(a * law.at(t - delay) for a, delay in zip(*shaper, strict=True))
    np.testing.assert_allclose(shape(law, shaper).at(t), copies, atol=1e-12)


@pytest.mark.parametrize("name", SHAPED)
@settings(max_examples=5)
@given(a=st.floats(-1.0, 1.0), b=st.floats(-1.0, 1.0))
def test_distances_add_up(name, a, b):
    t = np.linspace(0.0, 5.0, 33)
    moves = [plan_shaped(name, problem_of(distance, 5.0)).at(t) for distance in (a, b, a + b)]
    np.testing.assert_allclose(moves[0] + moves[1], moves[2], atol=1e-11)


@pytest.mark.parametrize("name", SHAPED)
def test_too_short_a_time_is_refused_with_the_shortest_one(name):
    with pytest.raises(
        Infeasible, match=rf"time_s = 0\.3; must be > .*, the length of shaper {name}: lengthen"
    ) as caught:
        plan_shaped(name, problem_of(time_s=0.3))
    least = caught.value.minimum_time_s
    assert least is not None
    with pytest.raises(Infeasible):
        plan_shaped(name, problem_of(time_s=least))
    assert plan_shaped(name, problem_of(time_s=1.001 * least)).at(1.001 * least) == pytest.approx(
        0.2, abs=1e-9
    )


def test_the_half_period_of_every_mode_is_reported():
    words = (
        r"time_s = 1\.0; must be > 1\.015169, the length of shaper zv "
        r"\(half periods 0\.822425 and 0\.192744 s\)"
    )
    with pytest.raises(Infeasible, match=words):
        plan_shaped("zv", problem_of(time_s=1.0, model=DOUBLE))


@pytest.mark.parametrize("law", sorted(LAWS))
def test_any_law_is_shaped_and_a_continuous_acceleration_stays_so(law):
    moved = plan_shaped("zvd", problem_of(0.2, 3.0, law=law))
    assert moved.at([0.0, 3.0]) == pytest.approx([0.0, 0.2], abs=1e-12)
    smooth = LAWS[law](1.0).continuous(2)
    if smooth:
        assert plan_shaped("zvd", problem_of(0.2, 3.0, law=law, input="jerk")).continuous(2)
    else:
        with pytest.raises(
            PlanError, match=rf"law = '{law}' with input jerk; its acceleration must be continuous"
        ):
            plan_shaped("zvd", problem_of(0.2, 3.0, law=law, input="jerk"))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"start_state": {"angle_rad": 0.1}}, "must be rest to rest: take matrix_exponential"),
        ({"goal_state": {"speed_m_s": 0.1}}, "must be rest to rest"),
        (
            {"robust": ("length",)},
            r"robust = \('length',\); must be \(\).*: leave it out and take zvd, zvdd or ei",
        ),
        ({"nonlinear": True}, "nonlinear = True; must be False.*: take collocation"),
        (
            {"input": "force"},
            "input = 'force'; must be acceleration or jerk.*take acceleration as input",
        ),
        (
            {"model": ChainModel(links=(BAR, BAR), joint_damping_n_m_s_rad=(50.0,))},
            "2 modes of which 1 oscillate; .* overdamped one: take matrix_exponential",
        ),
    ],
)
def test_problems_that_a_shaper_does_not_solve_are_refused_with_the_next_step(more, words):
    with pytest.raises(PlanError, match=words):
        plan_shaped("zv", problem_of(time_s=3.0, **more))


def test_an_unknown_shaper_is_named_with_the_nearest():
    with pytest.raises(PlanError, match="shaper = 'zvjoint'; did you mean 'zv_joint'"):
        plan_shaped("zvjoint", problem_of())


@pytest.mark.parametrize(
    "rate", [-1 + 0j, 0j, 1 - 1j, 0.1 + 1j, -1j, complex(math.nan, 1), complex(0, math.inf)]
)
@pytest.mark.parametrize("name", sorted(SHAPERS))
def test_a_mode_that_does_not_swing_or_grows_is_refused(name, rate):
    with pytest.raises(
        PlanError, match="of a mode; must have an imaginary part > 0 and a real part <= 0, both"
    ):
        SHAPERS[name](rate)
    with pytest.raises(PlanError, match="of a mode"):
        joint([1j, rate])


@pytest.mark.parametrize(("name", "most"), sorted(MAX_DAMPING_RATIO.items()))
def test_too_much_damping_for_a_shaper_is_refused_with_its_bound(name, most):
    with pytest.raises(PlanError, match=rf"for shaper {name}; must be <= {most}: take zvd or mzv"):
        SHAPERS[name](mode(1.0, most + 0.01))
    # At the bound itself, for every rounding of the eigenvalue.
    for frequency in np.linspace(0.2, 20.0, 12):
        assert SHAPERS[name](mode(frequency, most)).times_s[-1] > 0


def test_numbers_out_of_bounds_are_named():
    with pytest.raises(PlanError, match=r"tolerance = 5\.0; must be > 0 and < 1"):
        insensitivity(zv, 1j, 5.0)
    with pytest.raises(PlanError, match="derivatives = -1 of a shaper; must be >= 0"):
        zero_vibration(1j, -1)


def test_an_undamped_shaper_needs_no_scipy():
    code = (
        "import sys, planners.shapers as s; [f(1j) for f in s.SHAPERS.values()]; "
        "sys.exit('scipy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_table_has_every_name():
    assert tuple(SHAPERS) == (
        "zv",
        "zvd",
        "zvdd",
        "zvddd",
        "mzv",
        "ei",
        "ei_two_hump",
        "ei_three_hump",
        "um_zv",
    )
    assert (*SHAPERS, "zv_joint", "zvd_joint") == SHAPED
    assert all(isinstance(design(1j), Shaper) for design in SHAPERS.values())
