"""Load under a clock that runs fast or slow: against scipy in true time, and scaled parameters."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rig.analysis.identify.decay import fit_decay
from sim_rig.bench import Bench
from sim_rig.joint_params import Joint
from sim_rig.load import Load
from sim_rig.load_params import CableParams, LengthChange, LinkParams, LoadParams, Push
from sim_rig.params import BenchParams, PendulumParams
from sim_rig.run_time_load import LoadInRunTime

MS = 1_000_000
STEP_S = 1e-3
RATES = [1.0005, 0.9995]
SWINGING = PendulumParams(length_m=0.6, initial_swing_rad=0.2, damping_ratio=0.01)
BARS = (
    LinkParams(
        length_m=0.4,
        mass_kg=0.3,
        kind="bar",
        joint_stiffness_n_m_rad=2.0,
        joint_damping_n_m_s_rad=0.01,
        initial_rate_x_rad_s=0.7,
    ),
    LinkParams(length_m=0.5, mass_kg=0.5, initial_y_rad=0.1, drag_n_s2_m2=0.05),
)
LOADS: dict[str, dict[str, Any]] = {
    "pendulum": {"pendulum": SWINGING},
    "chain": {
        "links": BARS,
        "load": LoadParams(damping_ratio=0.01, tip_mass_kg=0.1),
        "pushes": (Push(at_s=0.5, duration_s=0.2, force_n=(0.5, 0.3, 0.0), link=2),),
    },
    "hoisted cable": {
        "pendulum": SWINGING,
        "length_changes": (LengthChange(at_s=0.4, duration_s=0.8, change_m=0.2),),
    },
    "vibrating cable": {"pendulum": SWINGING, "cable": CableParams()},
}


def ppm(rate: float) -> float:
    return 1e6 * (rate - 1.0)


def along_x(t_s: np.ndarray) -> np.ndarray:
    """Velocity of a platform that goes to and fro, from rest [m/s]."""
    return 0.1 * np.sin(2.0 * np.pi * 0.9 * t_s)


def in_space(steps: int, amplitude_y_m_s: float) -> tuple[list[float], list[float], list[float]]:
    """Velocities along x, y, z at start, middle and end of each step [m/s]."""
    t_s = 0.5 * STEP_S * np.arange(2 * steps + 1)
    y_m_s = amplitude_y_m_s * np.sin(7.0 * t_s)
    z_m_s = 0.05 * np.sin(5.0 * t_s)
    return along_x(t_s).tolist(), y_m_s.tolist(), z_m_s.tolist()


def slowed(plant: dict[str, Any], rate: float) -> BenchParams:
    """Write the plant with parameters in units of run time: seconds are shorter by the rate."""
    links = [
        msgspec.structs.replace(
            link,
            joint_stiffness_n_m_rad=link.joint_stiffness_n_m_rad / rate**2,
            joint_damping_n_m_s_rad=link.joint_damping_n_m_s_rad / rate,
            initial_rate_x_rad_s=link.initial_rate_x_rad_s / rate,
        )
        for link in plant.get("links", ())
    ]
    pushes = [
        Push(
            at_s=push.at_s * rate,
            duration_s=push.duration_s * rate,
            force_n=tuple(force / rate**2 for force in push.force_n),
            link=push.link,
        )
        for push in plant.get("pushes", ())
    ]
    changes = [
        msgspec.structs.replace(one, at_s=one.at_s * rate, duration_s=one.duration_s * rate)
        for one in plant.get("length_changes", ())
    ]
    gravity_m_s2 = 9.81 / rate**2
    return BenchParams(
        pendulum=msgspec.structs.replace(SWINGING, gravity_m_s2=gravity_m_s2),
        links=tuple(links),
        load=msgspec.structs.replace(plant.get("load", LoadParams()), gravity_m_s2=gravity_m_s2),
        pushes=tuple(pushes),
        length_changes=tuple(changes),
        cable=plant.get("cable"),
    )


@pytest.mark.parametrize("rate", RATES)
def test_a_driven_pendulum_swings_as_an_own_integration_in_true_time(rate: float) -> None:
    steps = 8000
    t_s = 0.5 * STEP_S * np.arange(2 * steps + 1)
    load = LoadInRunTime(BenchParams(pendulum=SWINGING, clock_ppm=ppm(rate)))
    still = [0.0] * t_s.size
    found = []
    for k in range(0, steps, 100):
        part = slice(2 * k, 2 * k + 201)
        load.advance(STEP_S, along_x(t_s)[part].tolist(), still[part], still[part])
        found.append(load.angle_rad)
    omega_rad_s = math.sqrt(9.81 / 0.6)

    def change(t_true_s: float, x: np.ndarray) -> list[float]:
        # the velocity along x of the run, v(r t), is r v(r t) in true time
        turn = 2.0 * math.pi * 0.9 * rate
        pivot_m_s2 = rate * 0.1 * turn * math.cos(turn * t_true_s)
        swing = -(omega_rad_s**2) * math.sin(x[0]) - pivot_m_s2 / 0.6 * math.cos(x[0])
        return [x[1], swing - 2.0 * 0.01 * omega_rad_s * x[1]]

    at_run_s = 0.1 * np.arange(1, steps // 100 + 1)
    expected = solve_ivp(
        change,
        (0.0, at_run_s[-1] / rate),
        [0.2, 0.0],
        method="DOP853",
        t_eval=at_run_s / rate,
        rtol=1e-12,
        atol=1e-14,
    )
    np.testing.assert_allclose(found, expected.y[0], rtol=0.0, atol=1e-9)
    assert load.angular_velocity_rad_s == pytest.approx(expected.y[1][-1] / rate, abs=1e-8)


@pytest.mark.parametrize("rate", RATES)
def test_a_free_decay_shows_the_clock_in_its_frequency_and_not_in_its_damping(rate: float) -> None:
    pendulum = PendulumParams(length_m=0.9, initial_swing_rad=0.1, damping_ratio=2e-3)
    plant = Bench(BenchParams(pendulum=pendulum, clock_ppm=ppm(rate)))
    angles = []
    for k in range(1200):
        plant.advance(20 * MS * k)
        angles.append(plant.angle_rad)
    fit = fit_decay(0.02 * np.arange(1200), np.array(angles))
    true_hz = math.sqrt(9.81 / 0.9) / (2.0 * math.pi)
    assert fit.natural_frequency_hz * rate == pytest.approx(true_hz, rel=1e-6)
    assert fit.damping_ratio == pytest.approx(2e-3, rel=1e-4)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("name", LOADS)
def test_a_load_in_run_time_is_one_with_scaled_gravity_springs_dampers_and_instants(
    name: str, rate: float
) -> None:
    load = LoadInRunTime(BenchParams(**LOADS[name], clock_ppm=ppm(rate)))
    other = Load(slowed(LOADS[name], rate))
    for one in (load, other):
        one.await_run()
        one.advance_at_rest(STEP_S, 300)
        one.start_run(0.1)
        one.advance(STEP_S, *in_space(1500, 0.0))
        one.advance(STEP_S, *in_space(300, 0.08))
    np.testing.assert_allclose(load.links, other.links, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(load.lengths_m, other.lengths_m, rtol=1e-12)
    np.testing.assert_allclose(load.points_m, other.points_m, rtol=0.0, atol=1e-11)
    pivot_m_s2 = (0.7, -0.4, 0.2)
    np.testing.assert_allclose(load.force_n(pivot_m_s2), other.force_n(pivot_m_s2), rtol=1e-10)


def test_the_bounds_of_the_clock_error_are_kept_and_a_joint_has_none() -> None:
    with pytest.raises(msgspec.ValidationError, match="<= 1000"):
        msgspec.convert({"clock_ppm": 1001}, BenchParams)
    with pytest.raises(ValueError, match="elastic joint"):
        BenchParams(clock_ppm=20.0, joint=Joint())
