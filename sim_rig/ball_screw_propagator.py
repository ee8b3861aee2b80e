"""Exact step of the sliding ball-screw axis by matrix exponential, with bounds of its excursion.

While motor and table slide off the stops, y = (d, w, v, T) of ball_screw_motion.py obeys
y' = A y + b with constant b. With Phi(t), the integral of exp(A s) over 0 <= s <= t, and the
initial rate y'(0), a step is y(t) = y(0) + Phi(t) y'(0). Phi and its integral are summed in 40
digits and rounded once.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig.ball_screw_params import AxisCoefficients
from sim_rig.ball_screw_series import Regime, ScrewInputs, ScrewState, screw_gain_m_rad
from sim_rig.ball_screw_switches import has_motor_friction

DIGITS = 40
NEGLIGIBLE_ENTRY = Decimal("1e-30")  # of a term: the series of matrices ends
BOUND_PARTS = 32  # of the step, on which the excursion is bounded
BOUND_MARGIN_REL = 1e-9  # more than the rounding of the bounds
Row = tuple[float, float, float, float]


class SlidingPropagator(NamedTuple):
    """Increments over a step per initial rate (d', w', v', T').

    The bounds hold throughout the step: |w(t) - w(0)| <= motor_speed_bound . |r|, with
    r = (d', d'', v', T') at the start. In rigid motion d' = d'' = 0.
    """

    deflection: Row
    motor_speed: Row
    table_speed: Row
    torque: float  # T has no other input than T'
    motor_angle: Row  # beyond step x initial speed
    travel: Row  # likewise
    motor_speed_bound: Row
    table_speed_bound: Row
    nut_force_bound: Row


def sliding_step(
    axis: AxisCoefficients,
    state: ScrewState,
    regime: Regime,
    inputs: ScrewInputs,
    step_s: float,
) -> ScrewState | None:
    """Compute the state after a step off the stops; None if a switch may occur in it.

    Products of plain floats written out, as this is the common case of each sample.
    """
    d, w, v, torque, angle, position = state
    motor, table = regime.motor, regime.table
    gain = screw_gain_m_rad(axis, motor, regime.nut_force)
    step = sliding_propagator(axis, gain, step_s)
    rate = axis.tau_m_rad * w - v  # d'
    nut_force = axis.stiffness_n_m * d + axis.damping_n_s_m * rate
    screw_torque = gain * nut_force + motor * axis.drag_n_m
    w1 = (torque - screw_torque) / axis.inertia_kg_m2
    friction = axis.viscous_n_s_m * v + table * axis.coulomb_n
    v1 = (nut_force + inputs.force_n - friction) / axis.mass_kg
    t1 = axis.lag_rate_1_s * (inputs.command_n_m - torque)

    size_d, size_v, size_t = abs(rate), abs(v1), abs(t1)
    size_r = abs(axis.tau_m_rad * w1 - v1)
    bd, br, bv, bt = step.motor_speed_bound
    reach = bd * size_d + br * size_r + bv * size_v + bt * size_t
    if motor * w <= reach and has_motor_friction(axis):
        return None
    bd, br, bv, bt = step.nut_force_bound
    reach = bd * size_d + br * size_r + bv * size_v + bt * size_t
    if regime.nut_force * nut_force <= reach and axis.driving_m_rad != axis.driven_m_rad:
        return None
    bd, br, bv, bt = step.table_speed_bound
    reach = bd * size_d + br * size_r + bv * size_v + bt * size_t
    if table * v <= reach and axis.coulomb_n:
        return None
    reach_m = step_s * (abs(v) + reach)
    negative_m, positive_m = axis.stops_m
    if not negative_m + reach_m < position < positive_m - reach_m:
        return None

    dd, dw, dv, dt = step.deflection
    wd, ww, wv, wt = step.motor_speed
    vd, vw, vv, vt = step.table_speed
    qd, qw, qv, qt = step.motor_angle
    xd, xw, xv, xt = step.travel
    return ScrewState(
        d + (dd * rate + dw * w1 + dv * v1 + dt * t1),
        w + (wd * rate + ww * w1 + wv * v1 + wt * t1),
        v + (vd * rate + vw * w1 + vv * v1 + vt * t1),
        torque + step.torque * t1,
        angle + (step_s * w + qd * rate + qw * w1 + qv * v1 + qt * t1),
        position + (step_s * v + xd * rate + xw * w1 + xv * v1 + xt * t1),
    )


@lru_cache(maxsize=256)
def sliding_propagator(
    axis: AxisCoefficients, gain_m_rad: float, step_s: float
) -> SlidingPropagator:
    """Compute the propagator of a step; gain_m_rad is the screw torque per nut force."""
    matrix = _system_matrix(axis, gain_m_rad)
    phi, double = _exponential_integrals(matrix, step_s)
    nut_force = np.array(
        [
            axis.stiffness_n_m,
            axis.damping_n_s_m * axis.tau_m_rad,
            -axis.damping_n_s_m,
            0.0,
        ]
    )
    outputs = np.vstack([np.eye(4)[1:3], nut_force])  # (3, 4)
    basis = np.eye(4)  # of y'(0) = basis @ r, from tau w' = d'' + v'
    basis[1, 1:3] = 1.0 / axis.tau_m_rad
    basis[2, 1:3] = (0.0, 1.0)
    bounds = _excursion_bounds(matrix, outputs, basis, step_s)
    return SlidingPropagator(
        deflection=_row(phi[0]),
        motor_speed=_row(phi[1]),
        table_speed=_row(phi[2]),
        torque=float(phi[3, 3]),
        motor_angle=_row(double[1]),
        travel=_row(double[2]),
        motor_speed_bound=_row(bounds[0]),
        table_speed_bound=_row(bounds[1]),
        nut_force_bound=_row(bounds[2]),
    )


def _system_matrix(axis: AxisCoefficients, gain_m_rad: float) -> NDArray[Any]:
    """Build A (4, 4) in decimals."""
    tau, inertia, mass, stiffness, damping = map(Decimal, axis[:5])
    gain = Decimal(gain_m_rad)
    viscous = Decimal(axis.viscous_n_s_m)
    zero = Decimal(0)
    with localcontext(prec=DIGITS):
        torque_per_m = gain * stiffness
        torque_per_m_s = gain * damping
        return np.array(
            [
                [zero, tau, Decimal(-1), zero],
                [
                    -torque_per_m / inertia,
                    -torque_per_m_s * tau / inertia,
                    torque_per_m_s / inertia,
                    1 / inertia,
                ],
                [stiffness / mass, damping * tau / mass, -(damping + viscous) / mass, zero],
                [zero, zero, zero, -Decimal(axis.lag_rate_1_s)],
            ],
            dtype=object,
        )


def _exponential_integrals(
    matrix: NDArray[Any], step_s: float
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Sum the series of the integral and of the double integral of exp(A t), both (4, 4)."""
    with localcontext(prec=DIGITS):
        step = Decimal(step_s)
        identity = np.array([[Decimal(i == j) for j in range(4)] for i in range(4)], dtype=object)
        term = identity * step
        phi = term
        double = term * step / 2
        k = 1
        while np.abs(term).max() > NEGLIGIBLE_ENTRY:
            k += 1
            term = (term @ matrix) * (step / k)
            phi = phi + term
            double = double + term * (step / (k + 1))
        return phi, double


def _excursion_bounds(
    matrix: NDArray[Any],
    outputs: NDArray[np.float64],
    basis: NDArray[np.float64],
    step_s: float,
) -> NDArray[np.float64]:
    """Bound |C Phi(t) R| entry by entry over the step, for outputs C (n, 4) and a basis R (4, 4).

    Between two of the points, |Phi(t + s) - Phi(t)| <= |exp(A t)| Phi_|A|(s), with Phi_|A| of the
    matrix of magnitudes.
    """
    part_s = step_s / BOUND_PARTS
    part = _exponential_integrals(matrix, part_s)[0].astype(float)
    magnitude = _exponential_integrals(np.abs(matrix), part_s)[0].astype(float)
    exponential = np.eye(4)
    part_exponential = np.eye(4) + matrix.astype(float) @ part
    phi = np.zeros((4, 4))
    bound = np.zeros((len(outputs), 4))
    for _ in range(BOUND_PARTS):
        reach = np.abs(outputs @ phi @ basis)
        reach += np.abs(outputs @ exponential) @ magnitude @ np.abs(basis)
        bound = np.maximum(bound, reach)
        phi = phi + exponential @ part
        exponential = exponential @ part_exponential
    return bound * (1.0 + BOUND_MARGIN_REL)


def _row(entries: NDArray[Any]) -> Row:
    first, second, third, fourth = map(float, entries)
    return first, second, third, fourth
