"""Models of the identification against integrated equations and central differences."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from rig.analysis.identify.damped_envelope import envelope_with_terms, riccati
from rig.analysis.identify.decay_model import DecayModel, ParameterLayout, mode_sum
from rig.analysis.identify.free_swing import pendulum_swing
from rig.analysis.identify.large_swing import LargeSwing, natural_over_swing
from rig.analysis.identify.sampled import noise_rms, quantum_of, sampled, thinned
from tests.rig.analysis.decays import damped, noisy, pendulum

Array = npt.NDArray[np.float64]

T = np.arange(0, 6, 0.02)
RECORD = sampled(T, np.cos(3 * T), 1, 0.02)
AVERAGED = sampled(T, np.cos(3 * T), 3, 0.02)


def central(model: DecayModel, p: Array) -> Array:
    columns = []
    for n in range(p.size):
        step = np.zeros(p.size)
        step[n] = 1e-5 * max(1.0, abs(p[n]))
        columns.append((model(p + step)[0] - model(p - step)[0]) / (2 * step[n]))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize(
    ("layout", "p", "elliptic"),
    [
        (ParameterLayout(1), [3.2, 0.02, 0.3, 0.5, 0.01], True),
        (ParameterLayout(1), [3.2, 0.3, 0.3, 0.5, 0.01], True),
        (ParameterLayout(1), [3.2, 0.0, 0.3, 0.5, 0.01], True),
        (ParameterLayout(1), [3.2, -0.02, 0.3, 0.5, 0.01], False),
        (ParameterLayout(2), [3.2, 0.02, 0.1, 0.5, 5.1, 0.05, 0.05, -1, 0.01], True),
        (
            ParameterLayout(1, ("trend", "trend_squared")),
            [3.2, 0.02, 0.2, 0.5, 0, 0.03, 0.02],
            False,
        ),
        (ParameterLayout(1, ("quadratic", "coulomb")), [3.2, 0.02, 0.3, 0.5, 0, 0.05, 0.003], True),
        (ParameterLayout(1, ("coulomb", "trend")), [3.2, 0.02, 0.3, 0.5, 0, 0.003, 0.02], False),
    ],
)
def test_the_jacobian_of_the_closed_model_is_its_derivative(
    layout: ParameterLayout, p: list[float], elliptic: bool
) -> None:
    model = mode_sum(RECORD, layout, elliptic=elliptic)
    at = np.array(p)
    found = model(at)[1]
    expected = central(model, at)
    np.testing.assert_allclose(found, expected, atol=2e-6 * np.abs(expected).max())


def test_the_jacobian_of_an_averaged_swing_spans_its_derivative() -> None:
    p = np.array([3.2, 0.05, 0.2, 0.5, 0.01])
    model = mode_sum(AVERAGED, ParameterLayout(1), elliptic=True)
    found, expected = model(p)[1], central(model, p)
    projected = found @ np.linalg.lstsq(found, expected)[0]
    np.testing.assert_allclose(projected, expected, atol=1e-6)
    angle, slopes = pendulum_swing(p, RECORD.t_s, 3, 0.02)
    assert angle.shape == (T.size,)
    assert slopes.shape == (T.size, 5)


@pytest.mark.parametrize("terms", [(), ("quadratic",), ("coulomb", "quadratic")])
def test_the_jacobian_of_the_integrated_pendulum_is_its_derivative(terms: tuple[str, ...]) -> None:
    p = np.array([3.2, 0.05, 1.4, 0.2, 0.01, *[0.02] * len(terms)])
    model = LargeSwing(RECORD, ParameterLayout(1, terms))
    expected = central(model, p)
    np.testing.assert_allclose(model(p)[1], expected, atol=1e-4 * np.abs(expected).max())


def test_the_integrated_pendulum_is_the_pendulum_and_names_its_turning_points() -> None:
    truth = pendulum(T, 2.0, 0.5, 0.01)
    w0 = math.pi
    p = np.array([w0, 0.01 * w0, 2.0, 0.0, 0.0])
    model = LargeSwing(RECORD, ParameterLayout(1))
    np.testing.assert_allclose(model(p)[0], truth, atol=1e-5)
    turn = int(np.argmin(truth))
    assert model.amplitude(p, 0, T[turn : turn + 1])[0] == pytest.approx(-truth[turn], rel=1e-3)
    assert model.damping_ratio(p, 0, 1.5) == pytest.approx(0.01)


def test_the_damping_ratio_at_an_amplitude_takes_the_energy_of_drag_and_friction() -> None:
    """Against quadrature of the work over a quarter period at 1.2 rad."""
    w0, quadratic, coulomb, top = 3.0, 0.05, 0.02, 1.2
    drag = 3 * math.pi * quadratic / (4 * w0)
    dry = math.pi * coulomb * w0 / 2
    u = np.linspace(0, math.pi / 2, 20001)
    x = top * np.sin(u)
    rate = w0 * np.sqrt(np.maximum(2 * (np.cos(x) - math.cos(top)), 0))
    dx = top * np.cos(u)
    viscous = np.trapezoid(rate * dx, u)
    expected = (drag * np.trapezoid(rate**2 * dx, u) + dry * top) / (2 * w0 * viscous)
    model = LargeSwing(RECORD, ParameterLayout(1, ("quadratic", "coulomb")))
    found = model.damping_ratio(np.array([w0, 0, 1.4, 0, 0, quadratic, coulomb]), 0, top)
    assert found == pytest.approx(float(expected), rel=1e-5)


@pytest.mark.parametrize("numbers", [(0.3, 0.05, 0.2, 0.01), (0.3, 0, 0, 0.02), (0.2, 0.1, 0, 0)])
def test_the_envelope_solves_its_equation(numbers: tuple[float, ...]) -> None:
    start, viscous, quadratic, coulomb = numbers

    def rate(_t: float, B: Array) -> Array:
        return np.asarray(-(coulomb + viscous * B + quadratic * B * B))

    truth = solve_ivp(rate, (0, 6), [start], t_eval=T, rtol=1e-10, atol=1e-12).y[0]
    np.testing.assert_allclose(riccati(T, np.array(numbers)), truth, atol=1e-9)
    envelope = envelope_with_terms(T, np.array(numbers), elliptic=True)
    np.testing.assert_allclose(envelope.amplitude, truth, atol=1e-8)
    lag = np.concatenate([[0], np.cumsum((truth[1:] ** 2 + truth[:-1] ** 2) / 2 * 0.02)]) / 16
    np.testing.assert_allclose(envelope.lag, lag, rtol=0.02, atol=1e-6)


def test_the_small_frequency_over_that_of_a_swing_is_elliptic() -> None:
    t = np.arange(0, 8, 0.001)
    truth = pendulum(t, 1.5, 0.5, 0.0)
    zeros = t[1:][np.diff(np.sign(truth)) != 0]
    period_s = float(np.mean(np.diff(zeros[::2])))
    assert natural_over_swing(1.5) == pytest.approx(0.5 * period_s, rel=1e-3)


def test_blocks_keep_the_mean_and_end_at_a_gap() -> None:
    t = np.concatenate([np.arange(10.0), 20 + np.arange(12.0)])
    record = thinned(sampled(t, 2 * t, 1, 0.0), 4)
    np.testing.assert_allclose(record.t_s, [1.5, 5.5, 21.5, 25.5, 29.5])
    np.testing.assert_allclose(record.values, 2 * record.t_s)
    assert record.correlated_frames == 1
    assert record.average_frames == 4


def test_the_noise_of_fourth_differences_is_that_of_the_samples_under_a_swing() -> None:
    y = noisy(damped(np.arange(0, 40, 0.02), 0.5, 0.001, 0.1), 1e-3, 1)
    assert noise_rms(y) == pytest.approx(1e-3, rel=0.1)
    averaged = np.convolve(y, np.ones(3) / 3, "valid")
    assert noise_rms(averaged, 3) == pytest.approx(1e-3 / math.sqrt(3), rel=0.15)


def test_the_quantum_is_the_smallest_step_of_values_that_repeat() -> None:
    y = damped(np.arange(0, 40, 0.02), 0.5, 0.001, 0.1)
    assert quantum_of(0.004 * np.round(y / 0.004)) == pytest.approx(0.004)
    assert quantum_of(y) == 0.0
