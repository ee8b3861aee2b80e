"""Ball-screw axis: two independent integrations, matrices, closed forms, energy, sensors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from sim_rig.ball_screw_axis import AxisTruth, BallScrewAxis
from sim_rig.ball_screw_params import BallScrewParams

SAMPLE_S = 125e-6
TAU = 0.02 / (2.0 * math.pi)
FloatArray = NDArray[Any]
FRICTIONLESS = {
    "coulomb_force_n": 0.0,
    "viscous_friction_n_s_m": 0.0,
    "preload_drag_n_m": 0.0,
    "efficiency": 1.0,
}
WIDE = {"negative_stop_m": -900.0, "positive_stop_m": 900.0}
torques_n_m = st.lists(st.floats(-3.8, 3.8), min_size=1, max_size=30)
extended = pytest.mark.skipif(
    np.finfo(np.longdouble).eps > 1e-18, reason="this machine has no extended precision"
)


class Sample(NamedTuple):
    """Command, force and duration of a sample."""

    torque_n_m: float
    duration_s: float = SAMPLE_S
    force_n: float = 0.0


def run(axis: BallScrewAxis, samples: Sequence[Sample]) -> list[AxisTruth]:
    truths = []
    for sample in samples:
        axis.advance(*sample)
        truths.append(axis.truth())
    return truths


def constant(torque_n_m: float, count: int, sample_s: float = SAMPLE_S) -> list[Sample]:
    return [Sample(torque_n_m, sample_s)] * count


def wave(count: int, amplitude_n_m: float, sample_s: float = 1e-3) -> list[Sample]:
    """Torques with reversals and pauses, forces of another period."""
    k = np.arange(count)
    torques = amplitude_n_m * np.cos(0.03 * k) * np.sin(0.11 * k)
    forces = 40.0 * np.sin(0.05 * k)
    return [
        Sample(float(torque), sample_s, float(force))
        for torque, force in zip(torques, forces, strict=True)
    ]


class Regime(NamedTuple):
    """Signs of sliding (0 = held) and of the nut force; the stop that pushes, if any."""

    motor: int
    table: int
    force: int
    stop: int


class Equations:
    """Equations of the axis for y = (deflection, motor speed, position, table speed).

    Written from the data sheet of the plant, in the precision of `number`.
    """

    def __init__(self, p: BallScrewParams, number: Callable[[float], Any], rel: float) -> None:
        self.p, self.number, self.rel = p, number, rel
        self.tau = number(p.lead_m) / (2 * number(np.pi)) if number is float else number(TAU)
        self.j, self.m = (
            number(p.rotary_inertia_kg_m2),
            number(p.table_mass_kg) + number(p.screw_axial_mass_kg),
        )
        self.k, self.eta = number(p.axial_stiffness_n_m), number(p.efficiency)
        self.d = number(p.elastic_damping_n_s_m)
        self.weight = number(-p.table_mass_kg * 9.81 * math.sin(math.radians(p.slope_deg)))
        self.torque = self.force = number(0.0)

    def nut(self, y: FloatArray) -> Any:
        return self.k * y[0] + self.d * (self.tau * y[1] - y[3])

    def gain(self, motor: int, force: int) -> Any:
        return self.tau / self.eta if motor * force > 0 else self.tau * self.eta

    def stop(self, y: FloatArray, side: int) -> Any:
        """Penetration and force of a stop along side."""
        where = self.p.positive_stop_m if side > 0 else self.p.negative_stop_m
        depth = side * (y[2] - self.number(where))
        return depth, self.p.stop_stiffness_n_m * depth + self.p.stop_damping_n_s_m * side * y[3]

    def linear(self, r: Regime) -> tuple[FloatArray, FloatArray]:
        """A (4, 4) and b (4,) of a regime."""
        k, d, tau, p = self.k, self.d, self.tau, self.p
        gain = self.gain(r.motor, r.force) / self.j
        a = np.zeros((4, 4), dtype=self.number)
        b = np.zeros(4, dtype=self.number)
        a[0], a[2] = [0, tau, 0, -1], [0, 0, 0, 1]
        if r.motor:
            a[1] = [-gain * k, -gain * d * tau, 0, gain * d]
            b[1] = (self.torque - r.motor * self.number(p.preload_drag_n_m)) / self.j
        if r.table:
            a[3] = [k, d * tau, 0, -d - self.number(p.viscous_friction_n_s_m)]
            b[3] = self.force + self.weight - r.table * self.number(p.coulomb_force_n)
            if r.stop:
                where = p.positive_stop_m if r.stop > 0 else p.negative_stop_m
                a[3] -= [0, 0, p.stop_stiffness_n_m, p.stop_damping_n_s_m]
                b[3] += self.number(p.stop_stiffness_n_m) * self.number(where)
            a[3] /= self.m
            b[3] /= self.m
        return a, b

    def guards(self, y: FloatArray, r: Regime) -> dict[str, Any]:
        """Quantities that are positive while a regime is valid."""
        nut, p = self.nut(y), self.p
        size_n = self.rel * (abs(self.k * y[0]) + self.d * self.tau * abs(y[1]) + 100.0)
        found = {}
        if p.preload_drag_n_m or p.efficiency < 1.0:
            drag = self.number(p.preload_drag_n_m)
            if r.motor:
                found["motor"] = r.motor * y[1] + self.rel * (1.0 + abs(y[1]))
            else:
                found["motor+"] = drag + self.gain(1, r.force) * nut - self.torque
                found["motor-"] = drag - self.gain(-1, r.force) * nut + self.torque
                found["motor+"] += size_n * self.tau
                found["motor-"] += size_n * self.tau
        if p.efficiency < 1.0:
            found["force"] = r.force * nut + size_n
        if p.coulomb_force_n:
            if r.table:
                found["table"] = r.table * y[3] + self.rel * (0.01 + abs(y[3]))
            else:
                load = nut + self.force + self.weight
                if r.stop:
                    load -= r.stop * self.stop(y, r.stop)[1]
                limit = self.number(p.coulomb_force_n) + size_n
                found["table+"], found["table-"] = limit - load, limit + load
        if r.stop:
            found["release"] = self.stop(y, r.stop)[1] + 1e4 * size_n
        else:
            for side in (-1, 1):
                depth, push = self.stop(y, side)
                found[f"touch{side}"] = max(-depth + self.rel, -push + 1e4 * size_n)
        return found

    def switched(self, y: FloatArray, r: Regime, name: str) -> Regime:
        """Regime after a guard became negative; a part at rest is held first."""
        if name == "motor":
            y[1] = 0
            return r._replace(motor=0)
        if name == "table":
            y[3] = 0
            return r._replace(table=0)
        if name == "force":
            return r._replace(force=-r.force)
        if name == "release":
            return r._replace(stop=0)
        if name.startswith("touch"):
            return r._replace(stop=int(name[5:]))
        return r._replace(**{name[:-1]: 1 if name.endswith("+") else -1})

    def start(self) -> tuple[FloatArray, Regime]:
        p = self.p
        y = np.array([0, 0, self.number(p.start_m), 0], dtype=self.number)
        held = p.preload_drag_n_m > 0.0 or p.efficiency < 1.0
        return y, Regime(0 if held else 1, 0 if p.coulomb_force_n else 1, 1, 0)

    def settle(self, y: FloatArray, r: Regime) -> Regime:
        """Switch until no guard is negative."""
        for _ in range(20):
            wrong = [name for name, guard in self.guards(y, r).items() if guard < 0]
            if not wrong:
                return r
            r = self.switched(y, r, wrong[0])
        raise AssertionError(f"regime {r} does not settle")


def by_scipy(params: BallScrewParams, samples: Sequence[Sample]) -> tuple[FloatArray, int]:
    """State after the samples and number of switches: DOP853 with events, in short steps."""
    equations = Equations(params, float, 1e-12)
    (y, regime), switches = equations.start(), 0
    for sample in samples:
        equations.torque, equations.force = sample.torque_n_m, sample.force_n
        t_s = 0.0
        while t_s < sample.duration_s:
            regime = equations.settle(y, regime)
            a, b = equations.linear(regime)
            names = list(equations.guards(y, regime))
            events = [
                lambda _, y, name=name, regime=regime: equations.guards(y, regime)[name]
                for name in names
            ]
            for event in events:
                event.terminal, event.direction = True, -1.0
            leg = solve_ivp(
                lambda _, y, a=a, b=b: a @ y + b,
                (t_s, sample.duration_s),
                y,
                "DOP853",
                rtol=1e-12,
                atol=[1e-18, 1e-12, 1e-15, 1e-14],
                events=events,
                max_step=1e-4,
            )
            t_s, y = leg.t[-1], leg.y[:, -1]
            if leg.status == 1:
                switches += 1
                hit = next(n for n, t in zip(names, leg.t_events, strict=True) if t.size)
                regime = equations.switched(y, regime, hit)
    return y, switches


def in_extended_precision(
    params: BallScrewParams, samples: Sequence[Sample], step_s: float = 2e-5
) -> list[FloatArray]:
    """States (4,) after each sample: Taylor steps of 80-bit floats, switches by bisection."""
    equations = Equations(params, np.longdouble, 1e-17)
    y, regime = equations.start()
    states = []
    for sample in samples:
        equations.torque = np.longdouble(sample.torque_n_m)
        equations.force = np.longdouble(sample.force_n)
        left_s = np.longdouble(sample.duration_s)
        while left_s > 0:
            regime = equations.settle(y, regime)
            terms = taylor(*equations.linear(regime), y, min(left_s, np.longdouble(step_s)))
            part, name = first_negative(equations, regime, terms)
            y = evaluate(terms, part)
            left_s -= part * min(left_s, np.longdouble(step_s))
            if name:
                regime = equations.switched(y, regime, name)
        states.append(y.copy())
    return states


def taylor(a: FloatArray, b: FloatArray, y: FloatArray, step_s: Any) -> list[FloatArray]:
    terms = [y, step_s * (a @ y + b)]
    for k in range(2, 18):
        terms.append(step_s / k * (a @ terms[-1]))
    return terms


def evaluate(terms: list[FloatArray], part: Any) -> FloatArray:
    y = terms[-1]
    for term in reversed(terms[:-1]):
        y = y * part + term
    return y


def first_negative(
    equations: Equations, regime: Regime, terms: list[FloatArray]
) -> tuple[Any, str | None]:
    """Fraction of a step and name of the first guard that is negative at its end."""
    one = np.longdouble(1)

    def wrong(part: Any) -> list[str]:
        guards = equations.guards(evaluate(terms, part), regime)
        return [name for name, guard in guards.items() if guard < 0]

    if not wrong(one):
        return one, None
    low, high = np.longdouble(0), one
    for _ in range(70):
        middle = (low + high) / 2
        low, high = (low, middle) if wrong(middle) else (middle, high)
    return high, wrong(high)[0]


def state(truth: AxisTruth) -> FloatArray:
    """Motor angle x tau, motor speed, position and speed of the table."""
    return np.array(
        [
            TAU * truth.motor_angle_rad,
            truth.motor_speed_rad_s,
            truth.position_m,
            truth.velocity_m_s,
        ]
    )


CASES = {
    "free acceleration": (FRICTIONLESS, constant(1.0, 200), 0),
    "acceleration against friction": ({}, constant(1.0, 400), 1),
    "reversal through stiction": ({}, wave(150, 0.6), 15),
    "regenerative deceleration": ({}, constant(1.5, 160) + constant(-1.5, 200), 3),
    "low efficiency": ({"efficiency": 0.6}, wave(150, 1.0), 10),
    "no drag": ({"preload_drag_n_m": 0.0, "efficiency": 0.8}, wave(100, 0.5), 8),
    "no Coulomb friction": ({"coulomb_force_n": 0.0}, wave(100, 0.5), 10),
    "slope": ({"slope_deg": 20.0, "preload_drag_n_m": 0.05}, wave(120, 0.4), 8),
    "soft screw": ({"axial_stiffness_n_m": 1e5}, wave(100, 1.0), 8),
    "stop": ({"positive_stop_m": 0.002, "positive_switch_m": 0.001}, wave(100, 0.8), 25),
}


@pytest.mark.parametrize("case", CASES)
def test_the_motion_agrees_with_an_independent_integrator(case):
    changes, samples, least_switches = CASES[case]
    params = BallScrewParams(**changes)
    expected, switches = by_scipy(params, samples)
    assert switches >= least_switches
    truth = run(BallScrewAxis(params), samples)[-1]
    assert np.all(np.abs(state(truth)[1:] - expected[1:]) < [1e-8, 1e-11, 1e-10])
    assert truth.integration_error_m < 1e-14


@extended
@pytest.mark.parametrize("case", CASES)
def test_the_stated_error_bounds_the_error(case):
    changes, samples, _ = CASES[case]
    params = BallScrewParams(**changes)
    exact = in_extended_precision(params, samples)
    for truth, y in zip(run(BallScrewAxis(params), samples), exact, strict=True):
        travel_m = np.longdouble(truth.motor_angle_rad) * np.longdouble(TAU)
        assert abs(np.longdouble(truth.position_m) - y[2]) <= truth.integration_error_m
        assert abs(travel_m - y[2] - y[0]) <= truth.integration_error_m + 1e-18
    assert 0.0 < truth.integration_error_m < 1e-14


@extended
def test_the_stated_error_bounds_the_error_of_a_fast_second():
    k = np.arange(1000)
    samples = [Sample(float(torque), 1e-3) for torque in 0.25 + 1.2 * np.sin(0.02 * k)]
    params = BallScrewParams(**WIDE)
    exact = in_extended_precision(params, samples, 1e-4)
    truths = run(BallScrewAxis(params), samples)
    assert max(truth.velocity_m_s for truth in truths) > 1.0
    for truth, y in zip(truths, exact, strict=True):
        assert abs(np.longdouble(truth.position_m) - y[2]) <= truth.integration_error_m
    assert truth.integration_error_m < 1e-12


def sliding_matrix(params: BallScrewParams) -> tuple[FloatArray, FloatArray]:
    """A (4, 4) and b (4,) of the axis without dry friction and losses, for a torque of 1 N m."""
    equations = Equations(params, float, 0.0)
    equations.torque = 1.0
    return equations.linear(Regime(1, 1, 1, 0))


@pytest.mark.parametrize("sample_s", [SAMPLE_S, 1e-3])
def test_the_frictionless_motion_is_that_of_the_matrix_exponential(sample_s):
    params = BallScrewParams(**FRICTIONLESS, **WIDE)
    a, b = sliding_matrix(params)
    step = expm(np.block([[a, b[:, None]], [np.zeros((1, 5))]]) * sample_s)
    y = np.zeros(5)
    samples = wave(200, 1.0, sample_s)
    samples = [sample._replace(force_n=0.0) for sample in samples]
    for truth, sample in zip(run(BallScrewAxis(params), samples), samples, strict=True):
        y[4] = sample.torque_n_m
        y = step @ y
        assert truth.position_m == pytest.approx(y[2], abs=1e-13)
        assert truth.velocity_m_s == pytest.approx(y[3], abs=1e-12)


def test_the_motor_response_has_the_published_antiresonance_and_resonance():
    a, _ = sliding_matrix(BallScrewParams(**FRICTIONLESS))
    resonance = max(np.linalg.eigvals(a), key=lambda pole: pole.imag)
    zeros = np.linalg.eigvals(np.delete(np.delete(a, 1, 0), 1, 1))  # motor held
    antiresonance = max(zeros, key=lambda zero: zero.imag)
    assert abs(antiresonance) == pytest.approx(1823.162, rel=1e-6)
    assert abs(antiresonance) / (2.0 * math.pi) == pytest.approx(290.165, rel=1e-5)
    assert -antiresonance.real / abs(antiresonance) == pytest.approx(0.03, rel=1e-9)
    assert abs(resonance) == pytest.approx(2392.064, rel=1e-6)


def test_a_free_axis_vibrates_at_the_published_resonance():
    axis = BallScrewAxis(BallScrewParams(**FRICTIONLESS))
    run(axis, constant(0.5, 8))
    truths = run(axis, constant(0.0, 40))
    stretch = np.array([TAU * t.motor_angle_rad - t.position_m for t in truths])
    rate = np.array([TAU * t.motor_speed_rad_s - t.velocity_m_s for t in truths])
    samples = np.column_stack([stretch / 1e-6, rate / 1e-3])
    step, *_ = np.linalg.lstsq(samples[:-1], samples[1:], rcond=None)
    poles = np.log(np.linalg.eigvals(step).astype(complex)) / SAMPLE_S
    assert np.abs(poles) == pytest.approx(2392.064, rel=1e-6)


def test_a_table_vibrates_at_the_antiresonance_while_drag_holds_the_motor():
    params = BallScrewParams(coulomb_force_n=0.0, viscous_friction_n_s_m=0.0)
    axis = BallScrewAxis(params)
    run(axis, [Sample(0.0, SAMPLE_S, 20.0)] * 4)
    truths = run(axis, constant(0.0, 60))
    assert all(truth.motor_angle_rad == 0.0 for truth in truths)
    samples = np.array([[t.position_m / 1e-6, t.velocity_m_s / 1e-3] for t in truths])
    step, *_ = np.linalg.lstsq(samples[:-1], samples[1:], rcond=None)
    pole = np.log(np.linalg.eigvals(step).astype(complex))[0] / SAMPLE_S
    assert abs(pole) == pytest.approx(1823.162, rel=1e-6)
    assert -pole.real / abs(pole) == pytest.approx(0.03, rel=1e-6)


@pytest.mark.parametrize(("share_kg", "equivalent_kg"), [(0.0, 24.766674), (0.6534513, 25.420125)])
def test_a_free_axis_accelerates_as_its_equivalent_mass(share_kg, equivalent_kg):
    params = BallScrewParams(**FRICTIONLESS, **WIDE, screw_axial_mass_kg=share_kg)
    truths = run(BallScrewAxis(params), constant(1.0, 1000, 1e-3))  # the vibration has decayed
    assert truths[-1].acceleration_m_s2 == pytest.approx(1.0 / TAU / equivalent_kg, rel=1e-6)
    assert params.equivalent_mass_kg == pytest.approx(24.766674, rel=1e-7)


@pytest.mark.parametrize(("torque_n_m", "efficiency"), [(0.25, 0.95), (0.25, 1.0), (0.3, 0.7)])
def test_the_steady_speed_balances_torque_and_friction(torque_n_m, efficiency):
    params = BallScrewParams(efficiency=efficiency, viscous_friction_n_s_m=200.0, **WIDE)
    truth = run(BallScrewAxis(params), constant(torque_n_m, 500, 1e-2))[-1]
    nut_force_n = (torque_n_m - 0.16) * efficiency / TAU
    assert truth.velocity_m_s == pytest.approx((nut_force_n - 9.81) / 200.0, rel=1e-9)
    assert truth.motor_speed_rad_s * TAU == pytest.approx(truth.velocity_m_s, rel=1e-9)


def test_a_load_that_drives_the_motor_transmits_its_force_times_the_efficiency():
    params = BallScrewParams(slope_deg=10.0, viscous_friction_n_s_m=200.0, **WIDE)
    downhill = run(BallScrewAxis(params), constant(-0.155, 500, 1e-2))[-1]
    assert downhill.velocity_m_s < 0.0
    load_n = 98.1 * math.sin(math.radians(10.0)) - 9.81 - 200.0 * abs(downhill.velocity_m_s)
    assert load_n > 0.0
    assert load_n * 0.95 * TAU == pytest.approx(0.16 - 0.155, rel=1e-6)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-0.16, 0.16), min_size=1, max_size=20))
def test_a_torque_up_to_the_drag_moves_nothing(torques):
    samples = [Sample(torque) for torque in [*torques, 0.16, -0.16]]
    for truth in run(BallScrewAxis(BallScrewParams()), samples):
        assert truth.sticking
        assert state(truth).tolist() == [0.0] * 4


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_torque_above_the_drag_moves_the_motor(sign):
    truth = run(BallScrewAxis(BallScrewParams()), [Sample(sign * 0.1600001, 1e-5)])[-1]
    assert not truth.sticking
    expected_rad_s = 1e-7 / 1.4961769e-4 * 1e-5
    assert sign * truth.motor_speed_rad_s == pytest.approx(expected_rad_s, rel=1e-2)
    assert truth.velocity_m_s == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_table_sticks_up_to_the_coulomb_force_and_moves_above(sign):
    held = run(BallScrewAxis(BallScrewParams()), [Sample(0.0, 1e-2, sign * 9.81)])[-1]
    assert held.sticking
    assert held.position_m == 0.0
    moved = run(BallScrewAxis(BallScrewParams()), [Sample(0.0, 1e-5, sign * 9.8101)])[-1]
    assert not moved.sticking
    assert sign * moved.velocity_m_s == pytest.approx(1e-4 / 10.6534513 * 1e-5, rel=1e-2)


def test_the_axis_breaks_away_at_the_drag_plus_the_guide_friction_over_the_efficiency():
    breakaway_n_m = 0.16 + TAU * 9.81 / 0.95
    axis = BallScrewAxis(BallScrewParams())
    ramp = np.linspace(0.0, breakaway_n_m - 3e-4, 4000)
    truths = run(axis, [Sample(float(torque), 1e-3) for torque in ramp])
    assert truths[-1].position_m == 0.0
    assert truths[-1].motor_angle_rad > 0.0  # the spring yields
    assert run(axis, constant(breakaway_n_m + 3e-4, 100, 1e-3))[-1].position_m > 0.0


def test_losses_of_the_screw_hold_a_motor_under_load():
    params = BallScrewParams(
        preload_drag_n_m=0.0, coulomb_force_n=0.0, efficiency=0.8, viscous_friction_n_s_m=500.0
    )
    load_n = 100.0
    for torque_n_m, moves in ((TAU * 79.0, True), (TAU * 81.0, False), (TAU * 124.0, False)):
        axis = BallScrewAxis(params)
        run(
            axis,
            [Sample(torque_n_m * part, 1e-2, -load_n * part) for part in np.linspace(0, 1, 51)],
        )
        before = axis.truth()
        after = run(axis, [Sample(torque_n_m, 0.1, -load_n)])[-1]
        assert (after.motor_angle_rad != before.motor_angle_rad) == moves


def energy_j(params: BallScrewParams, truth: AxisTruth) -> float:
    stretch_m = TAU * truth.motor_angle_rad - truth.position_m
    depth_m = max(
        truth.position_m - params.positive_stop_m, params.negative_stop_m - truth.position_m, 0.0
    )
    masses = params.rotary_inertia_kg_m2 * truth.motor_speed_rad_s**2
    masses += params.vibrating_mass_kg * truth.velocity_m_s**2
    springs = params.axial_stiffness_n_m * stretch_m**2 + params.stop_stiffness_n_m * depth_m**2
    return 0.5 * (masses + springs)


@settings(max_examples=40, deadline=None)
@given(torques_n_m, st.floats(-300.0, 300.0), st.floats(0.1, 1.0), st.floats(0.0, 0.3))
def test_energy_is_never_created(torques, force_n, efficiency, drag_n_m):
    params = BallScrewParams(
        efficiency=efficiency,
        preload_drag_n_m=drag_n_m,
        positive_stop_m=0.001,
        positive_switch_m=0.0005,
    )
    axis = BallScrewAxis(params)
    before = axis.truth()
    for torque in torques:
        axis.advance(torque, 1e-3, force_n)
        after = axis.truth()
        work_j = torque * (after.motor_angle_rad - before.motor_angle_rad)
        work_j += force_n * (after.position_m - before.position_m)
        gained_j = energy_j(params, after) - energy_j(params, before)
        assert gained_j <= work_j + 1e-10
        before = after


def test_the_work_of_a_lossless_axis_is_its_energy():
    params = BallScrewParams(**FRICTIONLESS, elastic_damping_ratio=0.0)
    axis = BallScrewAxis(params)
    truth = run(axis, constant(0.8, 300))[-1]
    work_j = 0.8 * truth.motor_angle_rad
    assert energy_j(params, truth) == pytest.approx(work_j, rel=1e-9)
    coasting = run(axis, constant(0.0, 1500))[-1]
    assert energy_j(params, coasting) == pytest.approx(work_j, rel=1e-9)


def test_the_end_switches_close_at_their_positions():
    params = BallScrewParams(negative_switch_m=-0.01, positive_switch_m=0.01)
    for sign in (1.0, -1.0):
        axis = BallScrewAxis(params)
        for _ in range(400):
            axis.advance(sign * 0.6, 1e-3)
            position_m = axis.truth().position_m
            reading = axis.read()
            assert reading.positive_switch is (position_m >= 0.01)
            assert reading.negative_switch is (position_m <= -0.01)
        assert sign * position_m > 0.01


def test_a_stop_brings_the_axis_to_rest_and_holds_it():
    params = BallScrewParams(start_m=0.3)
    truths = run(BallScrewAxis(params), constant(0.5, 1000, 1e-3))
    impact_m_s = max(truth.velocity_m_s for truth in truths)
    moving_kg = params.equivalent_mass_kg + params.screw_axial_mass_kg
    deepest_m = max(truth.position_m for truth in truths) - 0.4
    assert deepest_m < impact_m_s * math.sqrt(moving_kg / 1e7)  # of an undamped stop
    assert truths[-1].at_stop
    assert truths[-1].velocity_m_s == pytest.approx(0.0, abs=1e-9)
    push_n = 1e7 * (truths[-1].position_m - 0.4)
    assert TAU * push_n < 0.5 / 0.95 + 0.16


def test_a_table_leaves_a_stop_when_the_torque_reverses():
    axis = BallScrewAxis(BallScrewParams(start_m=0.39))
    assert run(axis, constant(0.5, 500, 1e-3))[-1].at_stop
    left = run(axis, constant(-0.5, 200, 1e-3))[-1]
    assert not left.at_stop
    assert left.position_m < 0.4
    assert left.velocity_m_s < 0.0


def test_the_encoder_and_the_scale_round_down_to_their_steps():
    params = BallScrewParams(encoder_counts_per_rev=2**17, scale_resolution_m=1e-6)
    axis = BallScrewAxis(params)
    count_rad = 2.0 * math.pi / 2**17
    for sample in wave(300, 0.6):
        axis.advance(*sample)
        truth, reading = axis.truth(), axis.read()
        assert axis.read() == reading
        assert 0.0 <= truth.motor_angle_rad - reading.motor_angle_rad < count_rad * (1.0 + 1e-9)
        counts = reading.motor_angle_rad / count_rad
        assert counts == pytest.approx(round(counts), abs=1e-6)
        assert reading.table_position_m is not None
        assert -1e-15 <= truth.position_m - reading.table_position_m < 1e-6 * (1.0 + 1e-9)


def test_an_axis_without_scale_and_encoder_steps_reads_the_motor_angle_alone():
    axis = BallScrewAxis(BallScrewParams(encoder_counts_per_rev=0, start_m=0.1))
    run(axis, constant(1.0, 20))
    assert axis.read() == (axis.truth().motor_angle_rad, None, False, False)
    assert axis.truth().motor_angle_rad == pytest.approx(0.1 / TAU, rel=1e-2)


def test_the_torque_is_limited():
    plain, limited = BallScrewAxis(BallScrewParams()), BallScrewAxis(BallScrewParams())
    for command_n_m, applied_n_m in ((9.0, 3.8), (-4.0, -3.8), (0.3, 0.3)):
        truth = run(limited, [Sample(command_n_m)])[-1]
        assert truth.applied_torque_n_m == applied_n_m
        assert truth == run(plain, [Sample(applied_n_m)])[-1]


def test_a_lagging_torque_follows_the_command_with_its_time_constant():
    params = BallScrewParams(**FRICTIONLESS, torque_lag_s=2e-3)
    axis = BallScrewAxis(params)
    a, b = sliding_matrix(params)
    block = np.zeros((6, 6))
    block[:4, :4], block[:4, 4] = a, b
    block[4, 4], block[4, 5] = -500.0, 500.0
    step, y = expm(block * SAMPLE_S), np.zeros(6)
    for k in range(100):
        y[5] = math.sin(0.1 * k)
        y = step @ y
        truth = run(axis, [Sample(float(y[5]))])[-1]
        assert truth.applied_torque_n_m == pytest.approx(y[4], abs=1e-12)
        assert truth.position_m == pytest.approx(y[2], abs=1e-13)


def test_a_lagging_torque_breaks_the_motor_away_when_it_exceeds_the_drag():
    axis = BallScrewAxis(BallScrewParams(torque_lag_s=1e-2))
    breakaway_s = -1e-2 * math.log(1.0 - 0.16 / 0.2)
    assert run(axis, [Sample(0.2, breakaway_s * (1.0 - 1e-9))])[-1].sticking
    assert not run(axis, [Sample(0.2, breakaway_s * 2e-9)])[-1].sticking


def test_the_speed_fault_is_set_beyond_the_limit_and_stays():
    axis = BallScrewAxis(BallScrewParams(**WIDE))
    truths = run(axis, constant(3.8, 40, 1e-3) + constant(-3.8, 40, 1e-3))
    for k, truth in enumerate(truths):
        fast = any(TAU * abs(t.motor_speed_rad_s) > 1.0 for t in truths[: k + 1])
        assert truth.overspeed is fast
    assert truths[-1].overspeed
    assert truths[-1].velocity_m_s < 1.0


@settings(max_examples=15, deadline=None)
@given(torques_n_m, st.lists(st.floats(0.05, 1.0), min_size=1, max_size=6))
def test_the_motion_does_not_depend_on_how_a_sample_is_divided(torques, parts):
    whole, divided = BallScrewAxis(BallScrewParams()), BallScrewAxis(BallScrewParams())
    for torque_n_m in torques:
        whole.advance(torque_n_m, 1e-3, 20.0)
        for part in parts:
            divided.advance(torque_n_m, 1e-3 * part / sum(parts), 20.0)
        one, other = whole.truth(), divided.truth()
        # the parts add up to 1e-3 s but for rounding, at speeds below 3 m/s
        bound_m = one.integration_error_m + other.integration_error_m + 1e-16 * one.t_s
        assert abs(one.position_m - other.position_m) <= bound_m


@settings(max_examples=15, deadline=None)
@given(torques_n_m)
def test_opposite_inputs_give_the_opposite_motion(torques):
    one, other = BallScrewAxis(BallScrewParams()), BallScrewAxis(BallScrewParams())
    for torque_n_m in torques:
        one.advance(torque_n_m, 1e-3, 15.0)
        other.advance(-torque_n_m, 1e-3, -15.0)
        assert state(one.truth()) == pytest.approx(-state(other.truth()), abs=1e-12)


def test_equal_inputs_give_equal_floats():
    samples = wave(300, 0.8)
    truths = [run(BallScrewAxis(BallScrewParams()), samples) for _ in range(2)]
    assert truths[0] == truths[1]


def test_the_acceleration_is_the_derivative_of_the_velocity():
    axis = BallScrewAxis(BallScrewParams(**WIDE))
    for sample in wave(40, 1.5):
        before = run(axis, [sample])[-1]
        after = run(axis, [sample._replace(duration_s=1e-9)])[-1]
        slope_m_s2 = (after.velocity_m_s - before.velocity_m_s) / 1e-9
        assert before.acceleration_m_s2 == pytest.approx(slope_m_s2, abs=1e-2)


def test_a_sample_of_zero_duration_moves_nothing():
    axis = BallScrewAxis(BallScrewParams())
    before = run(axis, constant(0.5, 30))[-1]
    after = run(axis, [Sample(0.5, 0.0)])[-1]
    assert after == before


def test_many_samples_add_up_to_the_time_they_last():
    axis = BallScrewAxis(BallScrewParams())
    for _ in range(20_000):
        axis.advance(0.0, 1e-4)
    assert axis.truth().t_s == math.fsum([1e-4] * 20_000)


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_inputs_that_are_not_finite_are_refused(number):
    axis = BallScrewAxis(BallScrewParams())
    with pytest.raises(ValueError, match=r"torque_n_m = .*; must be finite: look for"):
        axis.advance(number, SAMPLE_S)
    with pytest.raises(ValueError, match=r"force_n = .*; must be finite: look for"):
        axis.advance(0.0, SAMPLE_S, number)


@pytest.mark.parametrize("duration_s", [-1e-9, math.nan, math.inf])
def test_a_duration_that_is_negative_or_not_finite_is_refused(duration_s):
    with pytest.raises(ValueError, match=r"duration_s = .*; must be >= 0 and finite"):
        BallScrewAxis(BallScrewParams()).advance(0.0, duration_s)


def test_a_motor_beyond_its_largest_speed_is_refused():
    params = BallScrewParams(**FRICTIONLESS, **WIDE, torque_limit_n_m=1e4)
    axis = BallScrewAxis(params)
    message = r"motor_speed_rad_s = .*; must be <= 1e\+06: stabilise the controller"
    with pytest.raises(ValueError, match=message):
        run(axis, constant(1e4, 10, 0.02))


WRONG = {
    "lead_m": 0.0,
    "rotary_inertia_kg_m2": -1.0,
    "table_mass_kg": 0.0,
    "screw_axial_mass_kg": -0.1,
    "axial_stiffness_n_m": 0.0,
    "elastic_damping_ratio": 1.5,
    "coulomb_force_n": -1.0,
    "viscous_friction_n_s_m": math.inf,
    "preload_drag_n_m": math.nan,
    "efficiency": 1.01,
    "slope_deg": 91.0,
    "torque_limit_n_m": 0.0,
    "torque_lag_s": -1e-3,
    "speed_limit_m_s": 0.0,
    "negative_stop_m": math.nan,
    "positive_stop_m": math.inf,
    "stop_stiffness_n_m": 0.0,
    "stop_damping_n_s_m": -1.0,
    "negative_switch_m": -2e3,
    "positive_switch_m": 2e3,
    "encoder_counts_per_rev": 1.5,
    "scale_resolution_m": -1e-6,
    "start_m": math.nan,
}


def test_every_parameter_has_a_wrong_value_here():
    assert set(WRONG) == set(BallScrewParams.__struct_fields__)


@pytest.mark.parametrize("key", WRONG)
def test_a_wrong_parameter_is_named_with_its_value_and_bound(key):
    with pytest.raises(ValueError, match=f"^{key} = .*: expected .*: [a-zA-Z0-9]"):
        BallScrewParams(**{key: WRONG[key]})


@settings(max_examples=100, deadline=None)
@given(st.sampled_from(sorted(WRONG)), st.floats(), st.floats(-3.8, 3.8), st.floats(-50.0, 50.0))
def test_an_axis_that_exists_can_be_advanced(key, number, torque_n_m, force_n):
    try:
        axis = BallScrewAxis(BallScrewParams(**{key: number}))
    except ValueError:
        return
    truth = run(axis, [Sample(torque_n_m, 1e-3, force_n), Sample(-torque_n_m, 1e-3)] * 5)[-1]
    assert np.all(np.isfinite(state(truth)))
    assert truth.integration_error_m < 1e-12


# a nut force of rounding size, or a displaced part, switched back and forth for ever
ENDLESS = {
    "heavy damping": (
        {"preload_drag_n_m": 0.4, "coulomb_force_n": 0.1, "elastic_damping_ratio": 1.0},
        2.6,
        5e-3,
    ),
    "no guide friction": (
        {
            "coulomb_force_n": 0.0,
            "viscous_friction_n_s_m": 0.0,
            "elastic_damping_ratio": 0.5,
            "axial_stiffness_n_m": 26306785.66142923,
            "lead_m": 0.04441516229369234,
        },
        3.26,
        1e-3,
    ),
    "lag": ({"coulomb_force_n": 0.0, "torque_lag_s": 0.09, "lead_m": 1e-3}, 1.6, 5e-3),
}


@pytest.mark.parametrize("case", ENDLESS)
def test_a_sample_ends_after_few_switches(case):
    changes, amplitude_n_m, sample_s = ENDLESS[case]
    axis = BallScrewAxis(BallScrewParams(**changes, **WIDE))
    torques = np.random.default_rng(1).uniform(-amplitude_n_m, amplitude_n_m, 150)
    truth = run(axis, [Sample(float(torque), sample_s) for torque in torques])[-1]
    assert truth.integration_error_m < 1e-11


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"negative_stop_m": 0.5}, r"negative_stop_m = 0.5; must be < negative_switch_m = -0.35"),
        ({"positive_switch_m": 0.4}, r"positive_switch_m = 0.4; must be < positive_stop_m = 0.4"),
        ({"start_m": 0.5}, r"start_m = 0.5; must be -0.4 to 0.4, between the stops"),
        ({"torque_lag_s": 1e-9}, r"torque_lag_s = 1e-09; must be 0 or >= 1e-05 s"),
        ({"axial_stiffness_n_m": 1e12}, r"axial_stiffness_n_m = .* must be <= 100000 rad/s"),
        ({"stop_damping_n_s_m": 1e8}, r"stop_damping_n_s_m = .* must be <= 100000 rad/s"),
    ],
)
def test_contradictory_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        BallScrewParams(**changes)
