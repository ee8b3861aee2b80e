"""Simulated platform and load, compared with closed forms and an independent integrator."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal, special
from scipy.integrate import solve_ivp

from sim_rig import params
from sim_rig.bench import Bench
from sim_rig.params import BenchParams
from sim_rig.pendulum import Pendulum
from sim_rig.robot import ServoLoop

MS = 1_000_000
ROBOT = params.RobotParams()


def bench(**pendulum: float) -> Bench:
    return Bench(BenchParams(pendulum=params.PendulumParams(**pendulum)))


@pytest.mark.parametrize("damping", [0.3, 0.9, 1.0, 2.0])
def test_the_position_loop_has_half_the_power_at_its_bandwidth(damping: float) -> None:
    loop = ServoLoop(params.RobotParams(bandwidth_hz=7.0, damping=damping))
    wn = loop.natural_rad_s
    _, response = signal.freqs([wn**2], [1.0, 2.0 * damping * wn, wn**2], [2.0 * math.pi * 7.0])
    assert abs(response[0]) ** 2 == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("damping", [0.3, 0.9, 1.0, 2.0])
def test_the_step_response_of_the_platform_is_that_of_the_transfer_function(
    damping: float,
) -> None:
    robot = params.RobotParams(bandwidth_hz=7.0, damping=damping)
    wn = ServoLoop(robot).natural_rad_s
    t_s = np.arange(1, 401) * 1e-3
    _, expected = signal.step(
        ([wn**2], [1.0, 2.0 * damping * wn, wn**2]), T=np.concatenate([[0.0], t_s])
    )
    plant = Bench(BenchParams(robot=robot))
    plant.set_setpoint((0.01, -0.02, 0.0005))
    positions = []
    for k in range(1, 401):
        plant.advance(k * MS)
        positions.append(plant.position_m)
    np.testing.assert_allclose(positions, np.outer(expected[1:], [0.01, -0.02, 0.0005]), atol=1e-13)


def test_the_default_position_loop_has_a_rise_time_of_31_ms() -> None:
    plant = bench()
    plant.set_setpoint((0.01, 0.0, 0.0))
    x = []
    for k in range(1, 1001):
        plant.advance(k * MS // 10)
        x.append(plant.position_m[0] / 0.01)
    rise_s = (np.searchsorted(x, 0.9) - np.searchsorted(x, 0.1)) * 1e-4
    assert rise_s == pytest.approx(0.031, abs=0.001)


def test_an_undamped_load_keeps_its_energy_for_24_s() -> None:
    plant = bench(damping_ratio=0.0, initial_swing_rad=math.radians(20.0))
    energy = 9.81 * (1.0 - math.cos(plant.angle_rad))
    drift = 0.0
    for k in range(1, 2401):
        plant.advance(10 * k * MS)
        now = 9.81 * (1.0 - math.cos(plant.angle_rad)) + 0.5 * plant.angular_velocity_rad_s**2
        drift = max(drift, abs(now / energy - 1.0))
    assert drift < 1e-12


@pytest.mark.parametrize("swing_rad", [0.01, 0.5, 1.4])
def test_a_free_load_returns_after_the_period_of_the_elliptic_integral(swing_rad: float) -> None:
    period_s = 4.0 * math.sqrt(1.3 / 9.81) * special.ellipk(math.sin(swing_rad / 2.0) ** 2)
    plant = bench(length_m=1.3, damping_ratio=0.0, initial_swing_rad=swing_rad)
    plant.advance(round(period_s * 1e9))
    assert plant.angle_rad == pytest.approx(swing_rad, abs=1e-8)
    assert plant.angular_velocity_rad_s == pytest.approx(0.0, abs=1e-7)


def test_a_small_swing_decays_with_the_damping_ratio() -> None:
    zeta, w = 0.02, math.sqrt(9.81)
    wd = w * math.sqrt(1.0 - zeta * zeta)
    plant = bench(damping_ratio=zeta, initial_swing_rad=1e-4)
    for t_s in (0.7, 1.9, 5.0):
        plant.advance(round(t_s * 1e9))
        expected = (
            1e-4
            * math.exp(-zeta * w * t_s)
            * (math.cos(wd * t_s) + zeta * w / wd * math.sin(wd * t_s))
        )
        assert plant.angle_rad == pytest.approx(expected, abs=1e-12)


def reference_angle(
    setpoints: list[tuple[float, tuple[float, float, float]]], end_s: float, swing_rad: float
) -> list[float]:
    """Integrate (theta, theta') by DOP853 from the accelerations of the pivot.

    One solution between two setpoints.
    """
    wn, zeta, length, g, drag = ServoLoop(ROBOT).natural_rad_s, ROBOT.damping, 0.8, 9.81, 0.01
    y = np.array([0.0, 0.0, 0.0, 0.0, swing_rad, 0.0])  # x, x', z, z', theta, theta'
    for (t0, (aim_x, _, aim_z)), (t1, _) in zip(
        setpoints, [*setpoints[1:], (end_s, (0.0, 0.0, 0.0))], strict=True
    ):

        def rate(
            _t: float, y: np.ndarray, aim_x: float = aim_x, aim_z: float = aim_z
        ) -> list[float]:
            ax = wn**2 * (aim_x - y[0]) - 2.0 * zeta * wn * y[1]
            az = wn**2 * (aim_z - y[2]) - 2.0 * zeta * wn * y[3]
            turn = (
                -((g + az) * math.sin(y[4]) + ax * math.cos(y[4])) / length
                - 2.0 * drag * math.sqrt(g / length) * y[5]
            )
            return [y[1], ax, y[3], az, y[5], turn]

        y = solve_ivp(rate, (t0, t1), y, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return [float(y[4]), float(y[5])]


@pytest.mark.parametrize("spacing_ns", [5_000_000, 7_300_001])
def test_a_load_under_setpoint_steps_agrees_with_an_independent_integrator(
    spacing_ns: int,
) -> None:
    rng = np.random.default_rng(3)
    aims = np.cumsum(rng.uniform(-0.0005, 0.0006, size=(150, 2)), axis=0)
    plan = [(k * spacing_ns, (float(x), 0.0, float(z))) for k, (x, z) in enumerate(aims)]
    plant = bench(length_m=0.8, damping_ratio=0.01, initial_swing_rad=0.3)
    for t_ns, position_m in plan:
        plant.advance(t_ns)
        plant.set_setpoint(position_m)
    end_ns = 151 * spacing_ns
    plant.advance(end_ns)
    angle, rate = reference_angle([(t * 1e-9, p) for t, p in plan], end_ns * 1e-9, 0.3)
    assert plant.angle_rad == pytest.approx(angle, abs=1e-7)
    assert plant.angular_velocity_rad_s == pytest.approx(rate, abs=1e-6)


@given(vx=st.floats(-3.0, 3.0), vz=st.floats(-3.0, 3.0), swing=st.floats(-1.5, 1.5))
@settings(max_examples=30, deadline=None)
def test_a_pivot_in_uniform_motion_gives_the_swing_of_one_at_rest(
    vx: float, vz: float, swing: float
) -> None:
    resting = Pendulum(params.PendulumParams(initial_swing_rad=swing, damping_ratio=0.03))
    moving = Pendulum(params.PendulumParams(initial_swing_rad=swing, damping_ratio=0.03))
    resting.advance_at_rest(1e-3, 700)
    moving.advance(1e-3, [vx] * 1401, [vz] * 1401)
    assert moving.angle_rad == pytest.approx(resting.angle_rad, abs=1e-8)
    assert moving.angular_velocity_rad_s == pytest.approx(resting.angular_velocity_rad_s, abs=1e-7)


@given(stops=st.lists(st.integers(1, 400 * MS - 1), max_size=20))
@settings(max_examples=30, deadline=None)
def test_the_motion_does_not_depend_on_the_stops_of_the_bench(stops: list[int]) -> None:
    straight, halting = bench(initial_swing_rad=0.2), bench(initial_swing_rad=0.2)
    for plant, pauses in ((straight, []), (halting, sorted(stops))):
        plant.set_setpoint((0.002, 0.0005, 0.0002))
        for t_ns in [*pauses, 400 * MS]:
            plant.advance(t_ns)
            assert plant.t_ns == t_ns
    assert halting.position_m == pytest.approx(straight.position_m, abs=1e-14)
    # error of Runge-Kutta at a step of the acceleration of 17 m/s^2
    assert halting.angle_rad == pytest.approx(straight.angle_rad, abs=1e-8)


def test_a_platform_comes_to_rest_on_its_setpoint() -> None:
    plant = bench()
    plant.set_setpoint((0.1, 0.0, 0.0))
    plant.advance(3_000 * MS)
    assert plant.position_m == pytest.approx((0.1, 0.0, 0.0), abs=1e-14)
    assert max(map(abs, plant.velocity_m_s)) < 1e-12


def test_time_does_not_run_backwards() -> None:
    plant = bench()
    plant.advance(5 * MS)
    with pytest.raises(ValueError, match=r"t_ns = 4000000; must be >= 5000000, .*: advance in"):
        plant.advance(4 * MS)


@pytest.mark.parametrize(
    ("section", "complaint"),
    [
        ({"pendulum": {"length_m": -0.2}}, r"length_m"),
        ({"pendulum": {"lenght_m": 0.2}}, r"lenght_m"),
        ({"robot": {"bandwidth_hz": "fast"}}, r"bandwidth_hz"),
        ({"cameras": [{"noise": 1e6}]}, r"noise"),
        ({"view": {"width": 0}}, r"width"),
        ({"view": {"rate_hz": 200.0}}, r"exposure_ms = 10.0 .*must be <= 5 ms"),
    ],
)
def test_a_parameter_out_of_bounds_is_refused_with_its_name(
    section: dict[str, object], complaint: str
) -> None:
    with pytest.raises(msgspec.ValidationError, match=complaint):
        msgspec.convert(section, BenchParams)
