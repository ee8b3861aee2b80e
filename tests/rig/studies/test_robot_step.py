"""Step response of the robot, and the fit of a second order on responses that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from rig.studies.source_004.robot_step import (
    StepResponse,
    fit_second_order,
    measure,
    rise_time_s,
    second_order,
)


def known(omega_rad_s: float, zeta: float, delay_s: float = 0.0) -> StepResponse:
    """Response of a second order by scipy, read every millisecond."""
    t_s = np.arange(0.0, 0.25, 1e-3)
    fine_s = np.linspace(0.0, 0.25, 25_001)
    system = ([omega_rad_s**2], [1.0, 2.0 * zeta * omega_rad_s, omega_rad_s**2])
    _, y = signal.step(system, T=fine_s)
    return StepResponse(t_s, np.interp(t_s - delay_s, fine_s, y, left=0.0))


def test_a_fit_finds_back_frequency_damping_and_delay() -> None:
    fit = fit_second_order(known(80.0, 0.7, 0.004))
    assert fit.natural_rad_s == pytest.approx(80.0, rel=1e-3)
    assert fit.damping == pytest.approx(0.7, abs=1e-3)
    assert fit.delay_s == pytest.approx(0.004, abs=2e-5)


def test_the_closed_form_of_a_second_order_is_that_of_scipy() -> None:
    response = known(60.0, 0.4)
    mine = second_order(response.t_s, 60.0, 0.4, 0.0)
    np.testing.assert_allclose(mine, response.share, atol=1e-6)


def test_the_rise_time_of_a_first_order_is_2_2_time_constants() -> None:
    t_s = np.arange(0.0, 0.25, 1e-3)
    response = StepResponse(t_s, 1.0 - np.exp(-t_s / 0.0145))
    assert rise_time_s(response) == pytest.approx(0.0145 * math.log(9.0), rel=1e-3)


def test_the_robot_rises_in_31_ms_as_a_second_order_of_11_hz() -> None:
    """Filter of its servos: 11 Hz at -3 dB, damping 0.9; the encoders see 1 ms of sampling more."""
    response = measure()
    assert rise_time_s(response) == pytest.approx(0.031, abs=0.001)
    fit = fit_second_order(response)
    assert fit.rms < 0.005
    assert fit.damping == pytest.approx(0.9, abs=0.02)
    b = 1.0 - 2.0 * fit.damping**2
    bandwidth_hz = fit.natural_rad_s * math.sqrt(b + math.hypot(b, 1.0)) / (2.0 * math.pi)
    assert bandwidth_hz == pytest.approx(11.0, abs=0.4)
