"""Switches of the ball-screw axis: dry friction, sign of the nut force and end stops."""

from __future__ import annotations

import enum
import sys
from typing import NamedTuple

from sim_rig.ball_screw_params import AxisCoefficients
from sim_rig.ball_screw_series import Regime, ScrewState, ScrewTerms, screw_gain_m_rad
from sim_rig.crossing import first_below, value

# tolerance of a switching condition, of the sum of its terms: closer to its limit it is fulfilled
SWITCH_ROUNDING_REL = 16.0 * sys.float_info.epsilon
MAX_ROOT_STEPS = 60  # about ten are needed


class SwitchKind(enum.Enum):
    """Part of the regime that a switch changes."""

    MOTOR_STOPS = "motor stops"
    MOTOR_BREAKS_AWAY = "motor breaks away"
    TABLE_STOPS = "table stops"
    TABLE_BREAKS_AWAY = "table breaks away"
    NUT_FORCE = "nut force changes sign"
    STOP_REACHED = "stop reached"
    STOP_LEFT = "stop left"
    STOP_RELEASED = "stop force ends"
    STOP_PRESSED = "stop force begins"


class Guard(NamedTuple):
    """Quantity whose fall below its bound is a switch."""

    kind: SwitchKind
    direction: int  # of the motion or stop that begins, else 0
    terms: list[float]
    bound: float


class Switch(NamedTuple):
    """First switch within a step."""

    fraction: float  # of the step
    kind: SwitchKind
    direction: int


class Friction(NamedTuple):
    """Limits of a held part, with their rounding: it is held while low <= applied <= high."""

    low: float
    high: float
    tolerance: float


def has_motor_friction(axis: AxisCoefficients) -> bool:
    """Return True if drag or losses of the screw can hold the motor."""
    return axis.drag_n_m > 0.0 or axis.driving_m_rad != axis.driven_m_rad


def motor_friction(
    axis: AxisCoefficients, regime: Regime, nut_force_n: float, force_size_n: float
) -> Friction:
    """Compute the torques [N m] between which drag and screw losses hold the motor."""
    high = axis.drag_n_m + screw_gain_m_rad(axis, 1, regime.nut_force) * nut_force_n
    low = -axis.drag_n_m + screw_gain_m_rad(axis, -1, regime.nut_force) * nut_force_n
    size = axis.drag_n_m + axis.driving_m_rad * force_size_n
    return Friction(low, high, SWITCH_ROUNDING_REL * size)


def force_size_n(
    axis: AxisCoefficients, state: ScrewState, regime: Regime, force_n: float
) -> float:
    """Sum the magnitudes of the terms of the forces on the table [N], for their rounding."""
    moving = axis.tau_m_rad * abs(state.motor_speed_rad_s) + abs(state.table_speed_m_s)
    size = axis.stiffness_n_m * abs(state.deflection_m) + axis.damping_n_s_m * moving
    if regime.stop:
        size += axis.stop_stiffness_n_m * abs(state.position_m)
        size += axis.stop_damping_n_s_m * abs(state.table_speed_m_s)
    return size + axis.coulomb_n + abs(force_n)


def find_switch(
    axis: AxisCoefficients,
    state: ScrewState,
    regime: Regime,
    force_n: float,
    terms: ScrewTerms,
) -> Switch | None:
    """Find the first switch within the valid part of a step, if any."""
    size_n = force_size_n(axis, state, regime, force_n)
    guards = _motor_guards(axis, regime, terms, size_n)
    guards += _table_guards(axis, regime, force_n, terms, size_n)
    if axis.driving_m_rad != axis.driven_m_rad:
        signed = [regime.nut_force * term for term in terms.nut_force_n]
        guards.append(Guard(SwitchKind.NUT_FORCE, 0, signed, -SWITCH_ROUNDING_REL * size_n))
    guards += _stop_guards(axis, state, regime, terms)
    first: Switch | None = None
    for guard in guards:
        fraction = _first_crossing(_rescaled(guard.terms, terms.valid), guard.bound)
        if fraction is not None and (first is None or fraction < first.fraction):
            first = Switch(fraction, guard.kind, guard.direction)
    if first is None:
        return None
    return first._replace(fraction=terms.valid * first.fraction)


def _motor_guards(
    axis: AxisCoefficients, regime: Regime, terms: ScrewTerms, size_n: float
) -> list[Guard]:
    """List the end of sliding, or breaking away in both directions."""
    if not has_motor_friction(axis):
        return []
    if regime.motor:
        signed = [regime.motor * term for term in terms.motor_speed_rad_s]
        bound = -SWITCH_ROUNDING_REL * terms.size_rad_s
        return [Guard(SwitchKind.MOTOR_STOPS, 0, signed, bound)]
    guards = []
    torque_size = max(map(abs, terms.torque_n_m))
    bound = -SWITCH_ROUNDING_REL * (axis.drag_n_m + torque_size + axis.driving_m_rad * size_n)
    for direction in (1, -1):
        gain = screw_gain_m_rad(axis, direction, regime.nut_force)
        margin = [
            direction * (gain * force - torque)
            for force, torque in zip(terms.nut_force_n, terms.torque_n_m, strict=False)
        ]
        margin[0] += axis.drag_n_m
        guards.append(Guard(SwitchKind.MOTOR_BREAKS_AWAY, direction, margin, bound))
    return guards


def _table_guards(
    axis: AxisCoefficients, regime: Regime, force_n: float, terms: ScrewTerms, size_n: float
) -> list[Guard]:
    """List the end of sliding, or breaking away in both directions."""
    if not axis.coulomb_n:
        return []
    if regime.table:
        signed = [regime.table * term for term in terms.table_speed_m_s]
        bound = -SWITCH_ROUNDING_REL * axis.tau_m_rad * terms.size_rad_s
        return [Guard(SwitchKind.TABLE_STOPS, 0, signed, bound)]
    applied = list(terms.nut_force_n)
    applied[0] += force_n - (terms.stop_force_n[0] if regime.pressed else 0.0)
    guards = []
    for direction in (1, -1):
        margin = [-direction * term for term in applied]
        margin[0] += axis.coulomb_n
        bound = -SWITCH_ROUNDING_REL * size_n
        guards.append(Guard(SwitchKind.TABLE_BREAKS_AWAY, direction, margin, bound))
    return guards


def _stop_guards(
    axis: AxisCoefficients, state: ScrewState, regime: Regime, terms: ScrewTerms
) -> list[Guard]:
    """List reaching, pressing, releasing and leaving a stop."""
    if not regime.table:
        return []
    guards = []
    for side, stop_m in zip((-1, 1), axis.stops_m, strict=True):
        outside = 1 if regime.stop == side else -1
        gap = [outside * side * term for term in terms.travel_m]
        gap[0] += outside * side * (state.position_m - stop_m)
        bound = -SWITCH_ROUNDING_REL * (abs(stop_m) + abs(gap[0]))
        if outside < 0:
            guards.append(Guard(SwitchKind.STOP_REACHED, side, gap, bound))
            continue
        pressing = 1 if regime.pressed else -1
        force = [pressing * side * term for term in terms.stop_force_n]
        size = axis.stop_stiffness_n_m * (abs(stop_m) + abs(gap[0]))
        size += axis.stop_damping_n_s_m * abs(terms.table_speed_m_s[0])
        kind = SwitchKind.STOP_RELEASED if regime.pressed else SwitchKind.STOP_PRESSED
        guards.append(Guard(kind, side, force, -SWITCH_ROUNDING_REL * size))
        if not regime.pressed:
            guards.append(Guard(SwitchKind.STOP_LEFT, side, gap, bound))
    return guards


def _first_crossing(terms: list[float], bound: float) -> float | None:
    """Find the first t in [0, 1] at which a polynomial falls below a bound, None if it does not.

    The bound is lowered by the resolution of the crossing, or a switch could be found again at
    once. A polynomial whose slope keeps its sign needs no enclosure.
    """
    bound -= SWITCH_ROUNDING_REL * sum(map(abs, terms))
    if terms[0] < bound:
        return 0.0
    if terms[0] - sum(map(abs, terms[1:])) >= bound:
        return None
    curvature = sum(k * abs(term) for k, term in enumerate(terms[2:], 2))
    if abs(terms[1]) <= curvature:
        return first_below(terms, bound)
    if terms[1] > 0.0 or value(terms, 1.0) >= bound:
        return None
    return _root_of_falling(terms, bound)


def _root_of_falling(terms: list[float], bound: float) -> float:
    """Find the only crossing of a falling polynomial (regula falsi, Illinois variant)."""
    left, right = 0.0, 1.0
    above, below = terms[0] - bound, value(terms, 1.0) - bound
    negligible = sys.float_info.epsilon * sum(map(abs, terms))
    side = 0  # of the last point
    t = 0.0
    for _ in range(MAX_ROOT_STEPS):
        t = right - below * (right - left) / (below - above)
        rest = value(terms, t) - bound
        if abs(rest) <= negligible:
            break
        if rest < 0.0:
            right, below = t, rest
            above *= 0.5 if side < 0 else 1.0
            side = -1
        else:
            left, above = t, rest
            below *= 0.5 if side > 0 else 1.0
            side = 1
    return t


def _rescaled(terms: list[float], fraction: float) -> list[float]:
    """Rescale the terms of a polynomial to a fraction of its interval."""
    if fraction == 1.0:
        return terms
    return [term * fraction**k for k, term in enumerate(terms)]
