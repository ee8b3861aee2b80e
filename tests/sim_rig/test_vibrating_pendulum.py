"""Vibration of the cable itself, against a string of many masses and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sim_rig import params
from sim_rig.load import Load
from sim_rig.load_params import CableParams, LengthChange, LinkParams, LoadParams
from sim_rig.spatial_pendulum import SpatialPendulum
from sim_rig.vibrating_pendulum import VibratingPendulum

G = 9.81
STEP_S = 1e-3
LINK = LinkParams(length_m=1.0, mass_kg=0.7)
FREE = LoadParams(damping_ratio=0.0)
NYLON = CableParams(damping_ratio=1e-6)
MASSES = 120  # of the string that the modes are compared with


@pytest.mark.parametrize(("time_ms", "tolerance"), [(2, 2e-3), (10, 2e-3), (50, 0.05)])
def test_the_modes_under_an_acceleration_are_those_of_a_string_of_many_masses(
    time_ms: int, tolerance: float
) -> None:
    """m' y'' = T y_ss along the string, M y'' = -T y_s at the load, pivot at 3 m/s2.

    The string keeps its tension; ours rises with the swing, so the phases part slowly.
    """
    h_m = 1.0 / MASSES
    tension_n, density = 0.7 * G, NYLON.linear_density_kg_m

    def rate(_t: float, state: np.ndarray) -> np.ndarray:
        y, v = state[: MASSES + 1], state[MASSES + 1 :]
        a = np.zeros(MASSES + 1)
        a[0] = 3.0
        a[1:-1] = tension_n / density * (y[2:] - 2.0 * y[1:-1] + y[:-2]) / h_m**2
        a[-1] = -tension_n * (y[-1] - y[-2]) / h_m / 0.7
        return np.concatenate([v, a])

    start = np.zeros(2 * MASSES + 2)
    y = solve_ivp(rate, (0.0, time_ms * 1e-3), start, rtol=1e-9, atol=1e-13).y[: MASSES + 1, -1]
    s = np.linspace(0.0, 1.0, MASSES + 1)
    bend = y - (y[0] + s * (y[-1] - y[0]))
    expected = [2.0 / MASSES * np.sum(bend * np.sin(k * np.pi * s)) for k in (1, 2, 3)]
    cable = VibratingPendulum(LINK, FREE, NYLON)
    vx = [3.0 * STEP_S / 2.0 * k for k in range(2 * time_ms + 1)]
    cable.advance(STEP_S, vx, [0.0] * len(vx), [0.0] * len(vx))
    assert cable.cable_modes_m == pytest.approx(expected, rel=tolerance, abs=2e-8)


def test_a_cable_at_rest_stays_straight_and_swings_as_a_plain_one() -> None:
    hanging = VibratingPendulum(LINK, FREE, NYLON)
    hanging.advance_at_rest(STEP_S, 200)
    assert hanging.cable_modes_m == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)
    link = LinkParams(length_m=1.0, mass_kg=0.7, initial_x_rad=0.2)
    plain, vibrating = SpatialPendulum(link, FREE), VibratingPendulum(link, FREE, NYLON)
    for one in (plain, vibrating):
        one.advance_at_rest(STEP_S, 900)
    assert vibrating.links[0] == pytest.approx(plain.links[0], abs=1e-13)


def test_a_mode_rings_at_the_frequency_of_the_string() -> None:
    """f_1 = sqrt(T / m') / 2 L: 43.7 Hz of 1 m of nylon under 0.7 kg."""
    cable = VibratingPendulum(LINK, FREE, CableParams(damping_ratio=1e-6, modes=1))
    vx = [0.5] * 5
    cable.advance(STEP_S, [0.0, 0.25, *vx], [0.0] * 7, [0.0] * 7)
    values = []
    for _ in range(600):
        cable.advance_at_rest(STEP_S, 1)
        values.append(cable.cable_modes_m[0])
    ring = np.array(values) - np.convolve(values, np.ones(23) / 23, mode="same")
    spectrum = np.abs(np.fft.rfft(ring * np.hanning(600), 16384))
    frequency_hz = np.argmax(spectrum) / (16384 * STEP_S)
    expected_hz = math.sqrt(0.7 * G / 0.0009) / 2.0
    assert expected_hz == pytest.approx(43.7, abs=0.05)
    assert frequency_hz == pytest.approx(expected_hz, rel=0.01)


def test_the_points_of_the_cable_are_its_modes_across_the_straight_line() -> None:
    cable = VibratingPendulum(LINK, FREE, NYLON)
    vx = [3.0 * STEP_S / 2.0 * k for k in range(21)]
    cable.advance(STEP_S, vx, [0.0] * 21, [0.0] * 21)
    points = np.array(cable.points_m)
    ends = points[[0, -1]]
    share = np.linspace(0.0, 1.0, len(points))
    bend_m = points - (ends[0] + share[:, None] * (ends[1] - ends[0]))
    shapes = np.sin(np.outer(share, np.arange(1, 4)) * np.pi)
    assert np.linalg.norm(ends[1]) == pytest.approx(1.0, abs=1e-12)
    assert np.max(np.abs(bend_m[:, 0])) > 1e-5
    lean = -links_x_rad(cable)
    across = bend_m @ np.array([math.cos(lean), 0.0, -math.sin(lean)])
    assert across == pytest.approx(shapes @ cable.cable_modes_m, abs=1e-12)


def links_x_rad(cable: VibratingPendulum) -> float:
    """Angle of the link in the plane x, positive towards +X."""
    return cable.links[0].angle_x_rad


def test_a_vibration_of_another_load_is_refused() -> None:
    bar = LinkParams(length_m=0.3, mass_kg=1.0, kind="bar")
    for links, changes in (([bar], ()), ([LINK], (LengthChange(at_s=1.0, change_m=-0.1),))):
        bench = params.BenchParams(links=tuple(links), cable=CableParams(), length_changes=changes)
        with pytest.raises(ValueError, match=r"\[bench.cable\] of"):
            Load(bench)
