"""Spectra, zero-residual-vibration durations and elastic loads against tables, quadrature, ODEs."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import spherical_jn

from planners.errors import PlanError
from planners.laws import LAWS
from planners.laws.double_s import double_s
from planners.models.chain import ChainModel, Link
from planners.models.pendulum import PendulumModel
from planners.replay.metrics import swing_after
from planners.spectra.law_spectra import SPECTRA, law_spectrum, polynomial_spectrum, rect_spectrum
from planners.spectra.oscillator import MassChain, residual, response, suspended_load
from planners.spectra.periodic import harmonics
from planners.spectra.spectrum import spectrum, spectrum_by_cycles, transform
from planners.spectra.swing_free import swing_free_cycles, swing_free_durations_s
from planners.trajectories.driven import forced_response
from planners.trajectories.pieces import ExpPolynomial, ModalTerm, Smooth, polynomial
from planners.trajectories.trajectory import Trajectory

DATA = tomllib.loads((Path(__file__).parents[1] / "data" / "spectra.toml").read_text())
CYCLES = np.array(DATA["spectra"].pop("cycles"))
ONE = MassChain(masses_kg=(1.0,), stiffnesses_n_m=(100.0,), dampings_n_s_m=(2.0,)).modal
numbers = st.floats(-2, 2)
polynomials = st.builds(polynomial, st.floats(0.2, 2.0), st.lists(numbers, min_size=1, max_size=7))
waves = st.lists(
    st.builds(
        lambda s, w, a: ModalTerm(complex(s, w), (a + 0.3j,)),
        st.floats(-2, 1),
        st.floats(0.1, 30),
        numbers,
    ),
    max_size=2,
)
curves = st.builds(
    lambda d, c, m: ExpPolynomial(d, tuple(c), tuple(m)),
    st.floats(0.2, 2.0),
    st.lists(numbers, min_size=1, max_size=5),
    waves,
)


def smooth_twin(trajectory):
    """Build the same motion from smooth pieces."""
    return Trajectory(tuple(Smooth(p.duration_s, p.at, 4) for p in trajectory.pieces))


def integral(function, end_s):
    """Integrate by Gauss-Legendre, 32 nodes on each of 32 parts.

    Exact to rounding for a phase of less than 500 rad.
    """
    x, w = np.polynomial.legendre.leggauss(32)
    t = end_s / 32 * (np.arange(32)[:, None] + (1 + x) / 2)
    return complex(np.sum(function(t) * w) * end_s / 64)


def by_quadrature(trajectory, rate, origin_s=0.0):
    """Compute int a exp(-rate (t - origin)) piece by piece, steps in speed as impulses."""
    total, speed = 0j, 0.0
    for begin, piece in zip(trajectory.breaks_s.tolist(), trajectory.pieces, strict=False):
        total += (float(piece.at(np.zeros(()), 1)) - speed) * np.exp(-rate * (begin - origin_s))
        total += integral(
            lambda t, p=piece, b=begin: p.at(t, 2) * np.exp(-rate * (t + b - origin_s)),
            piece.duration_s,
        )
        speed = float(piece.at(np.asarray(piece.duration_s), 1))
    return total - speed * np.exp(-rate * (trajectory.duration_s - origin_s))


def test_the_spectra_of_the_laws_are_those_of_the_table():
    for name, values in DATA["spectra"].items():
        np.testing.assert_allclose(law_spectrum(name, CYCLES), values, atol=6e-7, err_msg=name)


@pytest.mark.parametrize("name", LAWS)
def test_every_law_s_spectrum_agrees_with_a_numerical_transform(name):
    law = LAWS[name](1.0)
    for cycles in (0.13, 0.5, 1.0, 2.0, 2.6, 7.3, 23.9):
        truth = abs(by_quadrature(law, 2j * math.pi * cycles)) / math.pi
        assert law_spectrum(name, cycles) == pytest.approx(truth, abs=1e-11)
        assert spectrum_by_cycles(law, cycles) == pytest.approx(truth, abs=1e-11)


@pytest.mark.parametrize("name", SPECTRA)
def test_closed_forms_and_trajectories_have_one_spectrum_also_where_a_formula_divides_by_zero(name):
    cycles = np.concatenate(
        [np.linspace(-8.0, 60.0, 2001), np.arange(0.0, 20.0, 0.5), [1e-9, 1.0 + 1e-9, 0.5 - 1e-12]]
    )
    np.testing.assert_allclose(
        law_spectrum(name, cycles), spectrum_by_cycles(LAWS[name](1.0), cycles), atol=1e-13
    )


def test_the_printed_spectrum_of_the_cubic_lacks_a_phase():
    cycles = np.array(DATA["misprint_cubic"]["cycles"])
    printed = (
        6
        / (math.pi**3 * cycles**2)
        * np.sqrt(1 + (math.pi * cycles) ** 2)
        * np.abs(np.sin(math.pi * cycles))
    )
    np.testing.assert_allclose(
        printed / polynomial_spectrum(1, cycles), DATA["misprint_cubic"]["ratio"], rtol=5e-3
    )


def test_the_spectrum_at_low_frequency_depends_on_the_distance_alone():
    for name in LAWS:
        assert law_spectrum(name, 1e-4, distance_m=-3.0, duration_s=2.0) == pytest.approx(
            2e-4 * 3.0 / 2.0, rel=1e-6
        )


def test_the_printed_forms_of_trapezoid_and_double_s_are_products_of_averages():
    a, b, x = 0.25, 0.2, np.array([0.3, 1.7, 2.9, 11.2])
    trapezoid = (
        2
        / ((1 - a) * a * math.pi**2 * x)
        * np.abs(np.sin((1 - a) * math.pi * x) * np.sin(a * math.pi * x))
    )
    sines = (
        np.sin((1 - a) * math.pi * x)
        * np.sin(a * (1 - b) * math.pi * x)
        * np.sin(a * b * math.pi * x)
    )
    double_s = 2 / (a**2 * b * (1 - a) * (1 - b) * math.pi**3 * x**2) * np.abs(sines)
    np.testing.assert_allclose(rect_spectrum((1 - a, a), x), trapezoid, atol=1e-15)
    np.testing.assert_allclose(rect_spectrum((1 - a, a * (1 - b), a * b), x), double_s, atol=1e-15)


@settings(max_examples=25)
@given(st.lists(curves, min_size=1, max_size=3), st.floats(-3, 3), st.floats(-60, 60))
def test_the_transform_of_any_pieces_agrees_with_quadrature(pieces, damping, frequency):
    trajectory, rate = Trajectory(tuple(pieces)), complex(damping, frequency)
    origin = trajectory.duration_s if damping < 0 else 0.0
    scale = 1.0 + sum(
        abs(p.at(np.linspace(0, p.duration_s, 50), k)).max() for p in pieces for k in (1, 2)
    )
    assert (
        abs(transform(trajectory, rate, origin) - by_quadrature(trajectory, rate, origin))
        < 1e-11 * scale
    )


@settings(max_examples=25)
@given(polynomials, st.floats(0.1, 100.0))
@example(polynomial(1.0, [0.0, 0.0, 4e-311]), 1.0)  # smaller than a double resolves
def test_a_smooth_piece_has_the_spectrum_of_the_closed_form_it_copies(piece, frequency):
    trajectory = Trajectory((piece,))
    scale = 1.0 + np.abs(piece.at(np.linspace(0, piece.duration_s, 50), 2)).max()
    assert (
        abs(spectrum(smooth_twin(trajectory), frequency) - spectrum(trajectory, frequency))
        < 1e-12 * scale
    )


@settings(max_examples=25)
@given(st.lists(curves, min_size=1, max_size=2), st.floats(0.1, 5.0), st.floats(0.1, 40.0))
def test_played_faster_a_motion_has_its_spectrum_stretched_and_raised(pieces, faster, frequency):
    trajectory = Trajectory(tuple(pieces))
    hastened = Trajectory(
        tuple(
            ExpPolynomial(
                p.duration_s / faster,
                tuple(c * faster**k for k, c in enumerate(p.coefficients)),
                tuple(ModalTerm(m.rate_1_s * faster, m.coefficients) for m in p.modes),
            )
            for p in pieces
        )
    )
    v = spectrum(trajectory, np.linspace(0.0, frequency, 5) / faster)
    np.testing.assert_allclose(
        spectrum(hastened, np.linspace(0.0, frequency, 5)),
        faster * v,
        rtol=1e-9,
        atol=1e-11 * (1 + v.max() * faster),
    )
    np.testing.assert_allclose(
        spectrum(trajectory.scaled(-2.5), frequency),
        2.5 * spectrum(trajectory, frequency),
        atol=1e-11 * (1 + v.max()),
    )


def test_the_transform_has_the_shape_of_the_rates_and_knows_conjugates():
    law, rates = LAWS["quintic"](1.3), np.array([[3j, -3j, 0j], [-0.4 + 2j, -0.4 - 2j, 1e-12j]])
    x = transform(law, rates, 1.3)
    assert x.shape == (2, 3)
    assert transform(law, 2j).shape == ()
    np.testing.assert_allclose(x[:, 0], x[:, 1].conj(), atol=1e-15)
    assert abs(x[0, 2]) < 1e-14


def test_a_rate_that_is_not_finite_or_overflows_is_refused():
    law = LAWS["cubic"](1.0)
    with pytest.raises(PlanError, match=r"must be finite"):
        transform(law, [1j, math.nan])
    with pytest.raises(PlanError, match=r"exp\(2000\); must be <= exp\(700\): set origin_s"):
        transform(law, -2000.0)
    assert transform(law, -2000.0, 1.0) == pytest.approx(
        by_quadrature(law, -2000.0, 1.0), abs=1e-14
    )


def test_unknown_laws_durations_and_shares_are_refused():
    with pytest.raises(PlanError, match="did you mean 'quintic'"):
        law_spectrum("quintc", 1.0)
    with pytest.raises(PlanError, match=r"duration_s = 0\.0; must be 1e-09 to"):
        law_spectrum("quintic", 1.0, duration_s=0.0)
    for bad in ([math.nan], [1.0, math.inf], math.nan):
        with pytest.raises(PlanError, match=r"cycles = (nan|inf) of a spectrum; must be finite"):
            law_spectrum("cubic", bad)
    with pytest.raises(PlanError, match=r"sum to 1\.1; must sum to 1"):
        rect_spectrum((0.5, 0.6), 1.0)


def test_the_harmonics_of_repeated_laws_are_those_of_the_table():
    for name, values in DATA["periodic"].items():
        found = harmonics(LAWS[name](1.0), 7)
        np.testing.assert_allclose(found.amplitudes_m_s2, [0.0, *values], atol=2e-6, err_msg=name)


def test_harmonics_grow_with_the_distance_and_shrink_with_the_square_of_the_time():
    unit, other = harmonics(LAWS["quintic"](1.0), 9), harmonics(LAWS["quintic"](4.0).scaled(3.0), 9)
    np.testing.assert_allclose(other.amplitudes_m_s2, 3.0 / 16.0 * unit.amplitudes_m_s2, atol=1e-13)


def test_enough_harmonics_add_up_to_the_acceleration_pauses_included():
    there_and_back = LAWS["septic"](1.0).then(LAWS["septic"](1.0).scaled(-1.0).shifted(1.0))
    series, t = harmonics(there_and_back, 400, period_s=2.5), np.linspace(0.0, 2.5, 101)
    np.testing.assert_allclose(series.at(t), there_and_back.at(t, 2), atol=2e-3)
    np.testing.assert_allclose(series.at(t + 2.5), series.at(t), atol=1e-9)


def test_a_motion_that_goes_on_with_the_speed_it_began_with_has_no_impulse_at_its_period():
    turn = Trajectory((ExpPolynomial(1.0, (0.0, 2.0), (ModalTerm(2j * math.pi, (0.1 + 0j,)),)),))
    found = harmonics(turn, 3)
    np.testing.assert_allclose(
        found.amplitudes_m_s2, [0.0, 0.1 * 4 * math.pi**2, 0.0, 0.0], atol=1e-13
    )
    assert abs(found.phases_rad[1]) == pytest.approx(math.pi)


def test_a_period_shorter_than_the_motion_or_a_negative_count_is_refused():
    with pytest.raises(
        PlanError, match=r"period_s = 0\.9 of a motion; must be finite and >= its duration, 1\.0 s"
    ):
        harmonics(LAWS["cubic"](1.0), 3, period_s=0.9)
    with pytest.raises(PlanError, match="count = -1"):
        harmonics(LAWS["cubic"](1.0), -1)


def test_swing_free_durations_are_those_of_the_table():
    for name, values in DATA["swing_free"].items():
        np.testing.assert_allclose(
            swing_free_cycles(LAWS[name](0.7))[:3], values, atol=6e-7, err_msg=name
        )


def test_swing_free_durations_in_closed_form_are_found_to_1e_12():
    np.testing.assert_allclose(
        swing_free_cycles(LAWS["harmonic"](1.0), 9.0), np.arange(1.5, 9.0), atol=1e-12
    )
    np.testing.assert_allclose(
        swing_free_cycles(LAWS["cycloidal"](3.0), 40.0), np.arange(2.0, 40.5), atol=1e-12
    )
    np.testing.assert_allclose(
        swing_free_cycles(LAWS["gutman_1_3"](1.0), 4.0), [2.0, math.sqrt(6.0), 4.0], atol=1e-12
    )
    for n, name in ((1, "cubic"), (2, "quintic"), (3, "septic")):
        zeros = swing_free_cycles(LAWS[name](1.0), 12.0)
        wave = spherical_jn(n, math.pi * np.linspace(0.1, 12.0, 5000))
        assert zeros.size == np.count_nonzero(wave[1:] * wave[:-1] < 0)
        assert np.all(np.abs(polynomial_spectrum(n, zeros)) < 3e-13)  # slope at most 0.5


def test_multiple_zeros_are_found_once_and_exactly():
    np.testing.assert_allclose(
        swing_free_cycles(LAWS["triangular"](1.0), 20.0), np.arange(2.0, 21.0, 2.0), atol=1e-12
    )
    zeros = [1.5, 3.0, 4.5, 6.0]  # 6 is triple
    np.testing.assert_allclose(swing_free_cycles(LAWS["double_s"](1.0), 6.0), zeros, atol=1e-12)


@settings(max_examples=15)
@given(st.floats(0.1, 0.5), st.floats(0.1, 0.5))
def test_a_double_s_is_swing_free_when_one_of_its_three_averages_lasts_whole_periods(alpha, beta):
    found = swing_free_cycles(double_s(1.0, alpha, beta), 8.0)
    shares = np.array([1 - alpha, alpha * (1 - beta), alpha * beta])
    expected = np.unique(np.concatenate([np.arange(1.0, 8.0 * share) / share for share in shares]))
    distances = np.abs(np.subtract.outer(found[found < 7.99], expected[expected < 7.99]))
    assert np.all(distances.min(axis=0) < 1e-6)  # two zeros so close may be taken for one
    assert np.all(distances.min(axis=1) < 1e-6)


def test_a_move_there_and_back_has_its_own_swing_free_durations():
    """The way back cancels the way out whenever it begins whole periods later."""
    back = LAWS["cubic"](1.0).then(LAWS["cubic"](1.0).scaled(-1.0).shifted(1.0))
    expected = np.sort(
        [*np.arange(2.0, 8.5, 2.0), *(2 * swing_free_cycles(LAWS["cubic"](1.0), 4.0))]
    )
    np.testing.assert_allclose(swing_free_cycles(back, 8.0), expected, atol=1e-12)


def test_a_motion_with_unlike_halves_is_swing_free_only_where_each_of_them_is():
    thirds = Trajectory((polynomial(0.3, (0, 0, 1.0)), polynomial(0.6, (0.09, 0.6, -0.5))))
    # one period up, two down
    np.testing.assert_allclose(swing_free_cycles(thirds, 5.9), [3.0], atol=1e-12)
    tenths = Trajectory((polynomial(0.3, (0, 0, 0.7)), polynomial(0.7, (0.063, 0.42, -0.3))))
    assert swing_free_cycles(tenths, 9.0).size == 0


@settings(max_examples=15)
@given(st.sampled_from(sorted(LAWS)), st.floats(0.2, 3.0))
def test_a_pendulum_is_at_rest_after_a_swing_free_duration(name, length_m):
    model = PendulumModel(length_m=length_m)
    durations = swing_free_durations_s(LAWS[name](1.0), model.natural_frequency_rad_s, 8.0)
    assert durations.size
    for duration in durations[:3].tolist():
        angles, rates = swing_after(model, LAWS[name](duration))
        assert model.amplitude_rad(angles, rates) < 1e-11


def test_bounds_of_the_search_for_swing_free_durations_are_named():
    with pytest.raises(PlanError, match=r"most_cycles = 1000000\.0; must be > 0\.01 and <= 1000"):
        swing_free_cycles(LAWS["cubic"](1.0), 1e6)
    with pytest.raises(PlanError, match=r"natural_frequency_rad_s = -2\.0"):
        swing_free_durations_s(LAWS["cubic"](1.0), -2.0, 5.0)


def test_the_response_of_the_mass_of_the_source_has_the_computed_figures():
    for name, figures in DATA["mass"].items():
        (z,) = response(ONE, LAWS[name](30.0).scaled(15.0), after_s=2.0)
        after = Trajectory(z.pieces[-1:]).peak().value
        assert after == pytest.approx(figures["after_m"], rel=5e-4)
        if "peak_m" in figures:
            assert z.peak().value == pytest.approx(figures["peak_m"], rel=5e-6)


def test_amplitudes_after_a_move_are_those_of_the_table():
    table = DATA["amplitude"]
    for damping, key in ((0.0, "undamped_m"), (2.0, "damped_m")):
        load = MassChain(
            masses_kg=(1.0,), stiffnesses_n_m=(100.0,), dampings_n_s_m=(damping,)
        ).modal
        found = [
            [float(residual(load, LAWS[n](t).scaled(15.0))[0]) for n in table["laws"]]
            for t in table["durations_s"]
        ]
        # the simulation of the table is accurate to 6e-6
        np.testing.assert_allclose(found, table[key], rtol=1e-5)


def test_the_residual_amplitude_of_an_undamped_load_is_pi_v_over_w():
    load = MassChain(masses_kg=(2.0,), stiffnesses_n_m=(50.0,)).modal
    for name in LAWS:
        law = LAWS[name](1.1)
        assert float(residual(load, law)[0]) == pytest.approx(
            math.pi * float(spectrum(law, 5.0)) / 5.0, rel=1e-12
        )


def by_dop853(chain, trajectory, t_s):
    """Simulate the positions of the masses by scipy: (n, times).

    The solver restarts at every joint, where a step in speed is an impulse on the masses.
    """
    n, masses = len(chain.masses_kg), np.array(chain.masses_kg)
    force = [
        np.diag(v) + np.diag([*v[1:], 0.0]) - np.diag(v[1:], 1) - np.diag(v[1:], -1)
        for v in (chain.stiffnesses_n_m, chain.dampings_n_s_m)
    ]
    state, speed, out = np.zeros(2 * n), 0.0, np.empty((n, len(t_s)))
    for begin, piece in zip(trajectory.breaks_s.tolist(), trajectory.pieces, strict=False):
        state[n:] -= float(piece.at(np.zeros(()), 1)) - speed

        def rates(t, x, piece=piece):
            return [
                *x[n:],
                *(
                    -float(piece.at(np.asarray(t), 2))
                    - (force[0] @ x[:n] + force[1] @ x[n:]) / masses
                ),
            ]

        done = solve_ivp(
            rates,
            (0.0, piece.duration_s),
            state,
            "DOP853",
            rtol=1e-11,
            atol=1e-13,
            dense_output=True,
        )
        inside = (t_s >= begin) & (t_s <= begin + piece.duration_s)
        out[:, inside] = done.sol(t_s[inside] - begin)[:n]
        state, speed = done.y[:, -1].copy(), float(piece.at(np.asarray(piece.duration_s), 1))
    return out


CHAINS = {
    "undamped": MassChain(masses_kg=(1.0, 2.0, 0.5), stiffnesses_n_m=(100.0, 300.0, 50.0)),
    "damped": MassChain(
        masses_kg=(1.0, 2.0, 0.5),
        stiffnesses_n_m=(100.0, 300.0, 50.0),
        dampings_n_s_m=(0.3, 4.0, 0.1),
    ),
    "overdamped": MassChain(
        masses_kg=(1.0, 0.2), stiffnesses_n_m=(40.0, 10.0), dampings_n_s_m=(30.0, 9.0)
    ),
}


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
@pytest.mark.parametrize("name", ["quintic", "modified_trapezoidal", "trapezoidal"])
def test_the_response_of_a_chain_agrees_with_scipy(chain, name):
    law = LAWS[name](1.7)
    t = np.linspace(0.0, 1.7, 60)
    places = response(chain.modal, law)
    np.testing.assert_allclose([z.at(t) for z in places], by_dop853(chain, law, t), atol=2e-10)


@settings(max_examples=15)
@given(st.lists(curves, min_size=1, max_size=2), st.floats(0.0, 3.0))
def test_the_response_to_any_motion_with_steps_in_speed_agrees_with_scipy(pieces, damping):
    chain = MassChain(masses_kg=(1.0,), stiffnesses_n_m=(90.0,), dampings_n_s_m=(damping,))
    trajectory = Trajectory(tuple(pieces))
    t = np.linspace(0.0, trajectory.duration_s, 20)[:-1]
    (z,) = response(chain.modal, trajectory)
    truth = by_dop853(chain, trajectory, t)[0]
    np.testing.assert_allclose(z.at(t), truth, atol=1e-8 * (1.0 + np.abs(truth).max()))


def test_the_response_to_a_smooth_motion_is_that_to_its_closed_form():
    for name in ("septic", "cycloidal", "modified_sine"):
        law, t = LAWS[name](1.2), np.linspace(0.0, 2.0, 50)
        for z, twin in zip(
            response(CHAINS["damped"].modal, law, 0.8),
            response(CHAINS["damped"].modal, smooth_twin(law), 0.8),
            strict=True,
        ):
            np.testing.assert_allclose(twin.at(t), z.at(t), atol=1e-12)


@pytest.mark.parametrize("slip", [0.0, 1e-12, 1e-6, 1e-3, 0.1, 0.33, 0.34, 1.0, 5.0])
def test_the_response_at_and_near_resonance_is_exact(slip):
    """z'' + 100 z = -cos(w t) has z = (cos(w t) - cos(10 t)) / (w^2 - 100).

    At w = 10 it is -t sin(10 t) / 20; both are written with a sinc.
    """
    w, t = 10.0 + slip, np.linspace(0.0, 3.0, 61)
    shaken = Trajectory((ExpPolynomial(3.0, (0.0,), (ModalTerm(1j * w, (-1.0 / w**2 + 0j,)),)),))
    load = MassChain(masses_kg=(1.0,), stiffnesses_n_m=(100.0,)).modal
    (z,) = response(load, shaken)
    exact = -t * np.sinc(slip * t / 2 / math.pi) * np.sin((10.0 + w) / 2 * t) / (10.0 + w)
    np.testing.assert_allclose(z.at(t), exact, atol=1e-14)


@settings(max_examples=30)
@given(curves, st.floats(-4, 1), st.floats(-20, 20), numbers)
def test_the_forced_response_of_a_mode_obeys_its_equation(forcing, damping, frequency, start):
    rate, t = complex(damping, frequency), np.linspace(0.0, forcing.duration_s, 7)
    terms = forced_response(forcing, rate, start + 0j)
    q = np.array([sum(term.at(x) for term in terms) for x in t.tolist()])
    end = integral(lambda s: forcing.at(s) * np.exp(rate * (t[-1] - s)), t[-1])
    assert q[0] == pytest.approx(start, abs=1e-9)
    assert abs(q[-1] - start * np.exp(rate * t[-1]) - end) < 1e-9 * (1.0 + abs(end))


def test_the_residual_amplitude_is_the_peak_of_the_free_motion():
    for chain in (CHAINS["undamped"], MassChain(masses_kg=(1.0,), stiffnesses_n_m=(100.0,))):
        places = response(chain.modal, LAWS["cubic"](1.0), after_s=60.0)
        bound = residual(chain.modal, LAWS["cubic"](1.0))
        peaks = np.array([Trajectory(z.pieces[-1:]).peak().value for z in places])
        assert np.all(peaks <= bound * (1 + 1e-9))
        assert np.all(peaks >= 0.9 * bound)  # the modes come into phase, nearly


def test_the_response_of_a_suspended_load_agrees_with_the_replay():
    model = ChainModel(links=(Link(0.5, 3.0), Link(0.7, 2.0)), damping_ratio=0.02)
    law = LAWS["quintic"](1.4).scaled(0.3)
    angles, _ = swing_after(model, law)
    places = response(suspended_load(model), law)
    np.testing.assert_allclose([float(z.at(1.4)) for z in places], angles, atol=1e-12)


def test_natural_frequencies_of_equal_masses_are_those_of_the_textbook():
    n = 5
    chain = MassChain(masses_kg=(0.4,) * n, stiffnesses_n_m=(250.0,) * n)
    k = np.arange(1, n + 1)
    expected = 2 * math.sqrt(250.0 / 0.4) * np.sin((2 * k - 1) * math.pi / (2 * (2 * n + 1)))
    np.testing.assert_allclose(chain.natural_frequencies_rad_s, expected, rtol=1e-12)
    np.testing.assert_allclose(chain.modal.eigenvalues_1_s, 1j * expected, rtol=1e-12, atol=1e-11)


def test_chains_with_bad_values_are_refused_by_name():
    with pytest.raises(PlanError, match="masses_kg is empty"):
        MassChain(masses_kg=(), stiffnesses_n_m=())
    with pytest.raises(PlanError, match=r"stiffnesses_n_m: 1 values; must be 2"):
        MassChain(masses_kg=(1.0, 1.0), stiffnesses_n_m=(1.0,))
    with pytest.raises(PlanError, match=r"dampings_n_s_m = \(-1\.0,\); must be >= 0"):
        MassChain(masses_kg=(1.0,), stiffnesses_n_m=(1.0,), dampings_n_s_m=(-1.0,))
    with pytest.raises(PlanError, match="the damping is critical"):
        _ = MassChain(masses_kg=(1.0,), stiffnesses_n_m=(100.0,), dampings_n_s_m=(20.0,)).modal
    with pytest.raises(PlanError, match=r"after_s = -1\.0"):
        response(ONE, LAWS["cubic"](1.0), after_s=-1.0)
