"""Taylor series of the ball-screw axis between two switches; equations in ball_screw_motion.py."""

from __future__ import annotations

from typing import NamedTuple

from sim_rig.ball_screw_params import AxisCoefficients

MAX_ORDER = 24  # a series that has not converged is used over a part of its step
NEGLIGIBLE_TERM_REL = 1e-17  # of the largest term: two such terms in a row end a series


class Regime(NamedTuple):
    """Linear regime of the axis; changes at a switch only."""

    motor: int  # direction of the sliding motor: -1, 1; 0 = held by dry friction
    table: int  # likewise
    nut_force: int  # sign of the nut force on the table: -1, 1
    stop: int  # end stop that the table is at: -1, 1; 0 = none
    pressed: bool  # the stop pushes; False: the table leaves faster than the stop expands


class ScrewState(NamedTuple):
    """State of the axis."""

    deflection_m: float  # of the axial spring: tau x motor angle - position
    motor_speed_rad_s: float
    table_speed_m_s: float
    torque_n_m: float
    motor_angle_rad: float
    position_m: float


class ScrewInputs(NamedTuple):
    """Inputs held over a sample."""

    command_n_m: float
    force_n: float  # on the table along +X, with its weight


class ScrewTerms(NamedTuple):
    """Taylor terms over a step.

    After the fraction f of the step, each variable is the sum of its terms[k] f^k.
    """

    deflection_m: list[float]
    motor_speed_rad_s: list[float]
    table_speed_m_s: list[float]
    torque_n_m: list[float]
    motor_angle_rad: list[float]  # increment
    travel_m: list[float]  # increment of the position
    nut_force_n: list[float]
    stop_force_n: list[float]  # spring and damper of the stop, against +X; 0 off the stops
    size_rad_s: float  # largest term, as speed of the motor
    valid: float  # up to this fraction the truncation is negligible


def screw_gain_m_rad(axis: AxisCoefficients, direction: int, nut_force: int) -> float:
    """Compute the screw torque per nut force: tau / efficiency if the motor drives the load.

    It is tau x efficiency if the load drives the motor (source 004, appendix C, torque table).
    """
    return axis.driving_m_rad if direction * nut_force > 0 else axis.driven_m_rad


def taylor_terms(
    axis: AxisCoefficients,
    state: ScrewState,
    regime: Regime,
    inputs: ScrewInputs,
    step_s: float,
) -> ScrewTerms:
    """Compute the Taylor terms of a step by recursion."""
    tau, inertia, mass, stiffness, damping = axis[:5]
    viscous = axis.viscous_n_s_m
    lag = axis.lag_rate_1_s
    gain = screw_gain_m_rad(axis, regime.motor, regime.nut_force)
    stop_stiffness, stop_damping, penetration = _stop_law(axis, state, regime)
    pushing = 1.0 if regime.pressed else 0.0
    command = inputs.command_n_m
    drag = regime.motor * axis.drag_n_m
    load = inputs.force_n - regime.table * axis.coulomb_n
    torque_weight = step_s / inertia
    d, w, v, torque = state[:4]
    rows = [(d, w, v, torque, 0.0, 0.0)]
    forces = []
    valid = 1.0
    before = size = abs(w) + abs(v) / tau + torque_weight * (abs(torque) + axis.drag_n_m)
    for k in range(MAX_ORDER):
        dt = step_s / (k + 1)
        rate = tau * w - v
        nut_force = stiffness * d + damping * rate
        stop_force = stop_stiffness * penetration + stop_damping * v
        forces.append((nut_force, stop_force))
        d = dt * rate
        angle = dt * w
        penetration = dt * v
        w = dt * (torque - gain * nut_force - drag) / inertia if regime.motor else 0.0
        load += nut_force - viscous * v - pushing * stop_force
        v = dt * load / mass if regime.table else 0.0
        torque = dt * lag * (command - torque)
        command = drag = load = 0.0  # constant: in the first term only
        rows.append((d, w, v, torque, angle, penetration))
        now = abs(w) + abs(v) / tau + torque_weight * abs(torque)
        size = max(size, now)
        if before + now <= NEGLIGIBLE_TERM_REL * size:
            break
        before = now
    else:
        valid = min(1.0, (NEGLIGIBLE_TERM_REL * size / (before + now)) ** (1.0 / MAX_ORDER))
    columns = [list(column) for column in zip(*rows, strict=True)]
    force_columns = [list(column) for column in zip(*forces, strict=True)]
    deflection, motor_speed, table_speed, torques, angle_terms, travel = columns
    nut_forces, stop_forces = force_columns
    return ScrewTerms(
        deflection_m=deflection,
        motor_speed_rad_s=motor_speed,
        table_speed_m_s=table_speed,
        torque_n_m=torques,
        motor_angle_rad=angle_terms,
        travel_m=travel,
        nut_force_n=nut_forces,
        stop_force_n=stop_forces,
        size_rad_s=size,
        valid=valid,
    )


def _stop_law(
    axis: AxisCoefficients, state: ScrewState, regime: Regime
) -> tuple[float, float, float]:
    """Return stiffness, damping and signed penetration of the stop; zeros off the stops."""
    if not regime.stop:
        return 0.0, 0.0, 0.0
    penetration_m = state.position_m - axis.stops_m[regime.stop > 0]
    return axis.stop_stiffness_n_m, axis.stop_damping_n_s_m, penetration_m
