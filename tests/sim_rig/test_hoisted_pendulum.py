"""Cable whose length changes, against an independent integration and invariants."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sim_rig.hoisted_pendulum import HoistedPendulum
from sim_rig.load_params import LengthChange, LinkParams, LoadParams
from sim_rig.spatial_pendulum import SpatialPendulum

G = 9.81
STEP_S = 1e-3
FREE = LoadParams(damping_ratio=0.0)
SHORTER = LengthChange(at_s=0.5, duration_s=1.2, change_m=-0.18)


def test_a_planar_swing_agrees_with_an_independent_integration() -> None:
    """l theta'' + 2 l' theta' + g sin theta + a cos theta = 0, pivot along x."""
    link = LinkParams(length_m=0.9624, mass_kg=0.7, initial_x_rad=0.2)
    hoisted = HoistedPendulum(link, FREE, [SHORTER])
    t_s = np.arange(6001) * STEP_S / 2.0
    hoisted.advance(STEP_S, (0.2 * np.sin(2.0 * t_s)).tolist(), [0.0] * t_s.size, [0.0] * t_s.size)

    def rate(t: float, y: np.ndarray) -> list[float]:
        share = min(max((t - 0.5) / 1.2, 0.0), 1.0)
        length = 0.9624 - 0.18 * (share - math.sin(2 * math.pi * share) / (2 * math.pi))
        speed = -0.18 / 1.2 * (1.0 - math.cos(2 * math.pi * share))
        pull = 0.4 * math.cos(2.0 * t) * math.cos(y[0]) + G * math.sin(y[0])
        return [y[1], -(2.0 * speed * y[1] + pull) / length]

    expected = solve_ivp(rate, (0.0, 3.0), [0.2, 0.0], rtol=1e-11, atol=1e-13, max_step=0.02)
    found = hoisted.links[0]
    assert found.angle_x_rad == pytest.approx(expected.y[0, -1], abs=1e-8)
    assert found.rate_x_rad_s == pytest.approx(expected.y[1, -1], abs=1e-7)
    assert hoisted.length_m == pytest.approx(0.7824, abs=1e-12)


def test_turning_momentum_about_the_vertical_is_kept() -> None:
    """l^2 (u x u')_z of a spatial swing does not change while the cable is hauled in."""
    link = LinkParams(length_m=1.0, mass_kg=0.7, initial_x_rad=0.2, initial_rate_y_rad_s=0.4)
    hoisted = HoistedPendulum(link, FREE, [SHORTER])

    def momentum() -> float:
        link_now = hoisted.links[0]
        x, y = math.tan(link_now.angle_x_rad), math.tan(link_now.angle_y_rad)
        down = 1.0 / math.sqrt(1.0 + x * x + y * y)
        vx = (1.0 + x * x) * link_now.rate_x_rad_s
        vy = (1.0 + y * y) * link_now.rate_y_rad_s
        return (hoisted.length_m * down) ** 2 * (x * vy - y * vx)

    before = momentum()
    hoisted.advance_at_rest(STEP_S, 2500)
    assert momentum() == pytest.approx(before, rel=1e-8)


def test_without_a_change_it_is_the_plain_pendulum() -> None:
    link = LinkParams(length_m=0.8, mass_kg=0.7, initial_x_rad=0.2, initial_y_rad=-0.1)
    load = LoadParams(damping_ratio=0.01)
    later = LengthChange(at_s=100.0, change_m=0.1)
    plain, hoisted = SpatialPendulum(link, load), HoistedPendulum(link, load, [later])
    for one in (plain, hoisted):
        one.advance_at_rest(STEP_S, 1500)
    assert hoisted.links[0] == pytest.approx(plain.links[0], abs=1e-13)
    pivot = (0.5, -0.3, 0.2)
    undamped = HoistedPendulum(link, FREE, [later])
    assert undamped.force_n(pivot) == pytest.approx(SpatialPendulum(link, FREE).force_n(pivot))


def test_a_hanging_load_feels_the_acceleration_of_its_cable() -> None:
    change = LengthChange(at_s=0.0, duration_s=1.0, change_m=-0.2)
    hoisted = HoistedPendulum(LinkParams(length_m=1.0, mass_kg=2.0), FREE, [change])
    hoisted.advance_at_rest(STEP_S, 250)
    up_m_s2 = 0.2 * 2.0 * math.pi
    assert hoisted.force_n((0.0, 0.0, 0.0))[2] == pytest.approx(-2.0 * (G + up_m_s2), rel=1e-9)


def test_a_cable_that_becomes_too_short_is_named() -> None:
    with pytest.raises(ValueError, match=r"shorten the cable to 0\.02 m; must leave 0\.05 m"):
        HoistedPendulum(
            LinkParams(length_m=0.2, mass_kg=1.0), FREE, [LengthChange(at_s=0.0, change_m=-0.18)]
        )
