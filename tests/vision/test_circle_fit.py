"""Circle through points: exact, with noise, with outliers, and none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vision.circle_fit import Circle, fit_circle

CENTRE_PX, RADIUS_PX, NOISE_PX = (50.0, -7.0), 120.0, 0.05


def arc(
    middle_rad: float, span_rad: float, count: int, random: np.random.Generator, noise_px: float
) -> tuple[np.ndarray, np.ndarray]:
    angles = middle_rad + random.uniform(-0.5, 0.5, count) * span_rad
    x = CENTRE_PX[0] + RADIUS_PX * np.sin(angles) + random.normal(0.0, noise_px, count)
    y = CENTRE_PX[1] + RADIUS_PX * np.cos(angles) + random.normal(0.0, noise_px, count)
    return x, y


def found(x: np.ndarray, y: np.ndarray) -> Circle:
    circle = fit_circle(x, y)
    assert circle is not None
    return circle


@given(
    u=st.floats(-5000.0, 5000.0),
    v=st.floats(-5000.0, 5000.0),
    radius=st.floats(5.0, 3000.0),
    first=st.floats(-3.0, 3.0),
    span=st.floats(0.2, 6.0),
)
def test_points_on_a_circle_give_its_centre_and_radius(
    u: float, v: float, radius: float, first: float, span: float
) -> None:
    angles = first + np.linspace(0.0, span, 9)
    circle = found(u + radius * np.sin(angles), v + radius * np.cos(angles))
    # the sagitta of the arc, radius (1 - cos(span / 2)), is what tells the centre
    tolerance = 1e-7 * radius / (1.0 - math.cos(0.5 * min(span, math.pi))) + 1e-6
    assert circle.centre_px == pytest.approx((u, v), abs=tolerance)
    assert circle.radius_px == pytest.approx(radius, abs=tolerance)
    assert circle.points == 9


@pytest.mark.parametrize("middle_rad", [0.0, 0.4])
def test_the_errors_are_those_that_the_fit_states(middle_rad: float) -> None:
    random = np.random.default_rng(1)
    scores, errors, stated = [], [], []
    for _ in range(300):
        circle = found(*arc(middle_rad, 0.5, 25, random, NOISE_PX))
        error = np.subtract(circle.centre_px, CENTRE_PX)
        radius = (circle.radius_px - RADIUS_PX) / circle.sigma_radius_px
        scores.append([*error / circle.sigma_centre_px, radius])
        errors.append(error)
        stated.append(circle.correlation)
    rms = np.sqrt(np.mean(np.square(scores), axis=0))
    assert ((rms > 0.85) & (rms < 1.3)).all()
    assert np.mean(stated) == pytest.approx(np.corrcoef(np.transpose(errors))[0, 1], abs=0.15)


def test_the_scatter_is_the_noise_across_the_circle() -> None:
    circle = found(*arc(0.0, 2.0, 400, np.random.default_rng(2), NOISE_PX))
    assert circle.scatter_px == pytest.approx(NOISE_PX, rel=0.15)


def test_points_beside_the_circle_are_left_out() -> None:
    x, y = arc(0.0, 0.8, 30, np.random.default_rng(3), NOISE_PX)
    x[4] += 3.0
    y[9] -= 8.0
    y[20] += 2.0
    circle = found(x, y)
    assert 26 <= circle.points <= 27
    assert abs(circle.centre_px[1] - CENTRE_PX[1]) < 4.0 * circle.sigma_centre_px[1]
    assert circle.scatter_px < 2.0 * NOISE_PX


@pytest.mark.parametrize(
    ("x", "y"),
    [
        (np.arange(10.0), 2.0 * np.arange(10.0)),
        (np.arange(10.0), np.zeros(10)),
        (np.full(10, 3.0), np.full(10, 4.0)),
    ],
)
def test_points_on_a_line_or_at_one_place_have_no_circle(x: np.ndarray, y: np.ndarray) -> None:
    assert fit_circle(x, y) is None


def test_points_on_a_noisy_line_do_not_tell_the_radius() -> None:
    random = np.random.default_rng(5)
    for _ in range(20):
        x = 4.0 * np.arange(16)
        circle = found(x, random.normal(0.0, 0.01, 16))
        # chance decides between the two sides of the line
        assert circle.sigma_radius_px > 0.2 * circle.radius_px
        assert circle.sigma_centre_px[1] > 0.2 * circle.radius_px


def test_four_points_are_too_few() -> None:
    x, y = arc(0.0, 1.0, 5, np.random.default_rng(4), 0.0)
    assert fit_circle(x, y) is not None
    assert fit_circle(x[:4], y[:4]) is None
