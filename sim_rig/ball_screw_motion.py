"""Motion of the ball-screw axis under a held torque command and force.

With q, w angle and speed of the motor, x, v position and speed of the table, deflection
d = tau q - x and nut force F = K d + D (tau w - v):

    J w' = T - g F - T_d sign(w),    g = tau / eta if F w > 0, tau eta if F w < 0
    M v' = F - B v - F_c sign(v) + force - stop force
    T' = (command - T) / lag, or T = command

(two masses: source 001; forces, friction and efficiency: source 004, appendix C). All dry friction
is set-valued (Filippov): at w = 0, T - tau F takes every value up to the limits for w > 0 and
w < 0, so the efficiency is a dry friction in proportion to |F|. At F = 0 both gains give zero
torque. Hence the power tau F w enters the screw, and never less than F tau w / eta or eta leaves
the motor. A stop pushes with max(0, k p + c p') at the penetration p > 0.
Between two switches the motion is linear.
"""

from __future__ import annotations

import sys

from sim_rig.ball_screw_params import BallScrewParams
from sim_rig.ball_screw_propagator import sliding_step
from sim_rig.ball_screw_series import Regime, ScrewInputs, ScrewState, ScrewTerms, taylor_terms
from sim_rig.ball_screw_switches import (
    SWITCH_ROUNDING_REL,
    Switch,
    SwitchKind,
    find_switch,
    force_size_n,
    has_motor_friction,
    motor_friction,
)
from sim_rig.crossing import value

STEP_ROUNDING_REL = 2.0 * sys.float_info.epsilon  # error of a step, of its largest term
MAX_PROPAGATED_RATE = 8.0  # rate x duration of a whole sample in one step
MAX_PART_RATE = 0.5  # rate x duration of a part of a sample
MAX_SWITCHES = 10_000  # in a sample; a reversal takes about ten
# the others leave all forces continuous, so that a late switch has no effect; displaced there,
# the motion could cross the same switch again and again
FRICTION_SWITCHES = (
    SwitchKind.MOTOR_STOPS,
    SwitchKind.MOTOR_BREAKS_AWAY,
    SwitchKind.TABLE_STOPS,
    SwitchKind.TABLE_BREAKS_AWAY,
    SwitchKind.STOP_REACHED,
)


class ScrewMotion:
    """State of the axis; a perturbed one is displaced after each step by the rounding error."""

    def __init__(self, params: BallScrewParams, *, perturbed: bool = False) -> None:
        self._axis = params.coefficients()
        self._perturbed = perturbed
        self.state = ScrewState(
            deflection_m=0.0,
            motor_speed_rad_s=0.0,
            table_speed_m_s=0.0,
            torque_n_m=0.0,
            motor_angle_rad=params.start_m / params.tau_m_rad,
            position_m=params.start_m,
        )
        self.regime = Regime(
            motor=0 if has_motor_friction(self._axis) else 1,
            table=0 if self._axis.coulomb_n else 1,
            nut_force=1,
            stop=0,
            pressed=False,
        )
        self._inputs = ScrewInputs(0.0, self._axis.weight_n)
        self._before_s = 0.0  # duration of the sample before
        self._repeated_part_s = 0.0
        self._switches = 0  # in the present sample
        self._max_propagated_s = MAX_PROPAGATED_RATE * self._axis.max_step_s

    @property
    def held(self) -> bool:
        """True if dry friction holds motor and table."""
        return not (self.regime.motor or self.regime.table)

    def advance(self, command_n_m: float, force_n: float, duration_s: float) -> None:
        """Integrate over a duration with constant command and force on the table along +X.

        Raises RuntimeError after MAX_SWITCHES switches.
        """
        self._switches = 0
        self._inputs = ScrewInputs(command_n_m, force_n + self._axis.weight_n)
        if not self._axis.lag_rate_1_s:
            self.state = self.state._replace(torque_n_m=command_n_m)
        if self._stays_held():
            return
        part_s = self._part_s(duration_s)
        if 0.0 < part_s < duration_s and self._propagate(duration_s):
            return
        left_s = duration_s
        while left_s > 0.0:
            if 0.0 < part_s <= left_s and self._propagate(part_s):
                left_s -= part_s
            else:
                left_s -= self._step(min(left_s, self._max_step_s(part_s)))

    def _part_s(self, duration_s: float) -> float:
        """Divide a sample into equal parts with a propagator each; 0 for a new duration.

        A propagator takes milliseconds to compute, so it has to serve many samples.
        """
        if duration_s != self._before_s:
            self._before_s = duration_s
            self._repeated_part_s = 0.0
        elif not self._repeated_part_s:
            part_s = duration_s
            while part_s > MAX_PART_RATE * self._axis.max_step_s:
                part_s *= 0.5
            self._repeated_part_s = part_s
        return self._repeated_part_s

    def _max_step_s(self, part_s: float) -> float:
        """Compute the longest Taylor step; one part, if only a switch prevented a propagator."""
        if self.regime.stop:
            return self._axis.max_stop_step_s
        if part_s and self._slides:
            return part_s
        return self._axis.max_step_s

    @property
    def _slides(self) -> bool:
        """True if motor and table slide off the stops."""
        return bool(self.regime.motor and self.regime.table and not self.regime.stop)

    def acceleration_m_s2(self) -> float:
        """Compute the acceleration v' of the table under the present inputs."""
        if not self.regime.table:
            return 0.0
        axis = self._axis
        friction_n = axis.viscous_n_s_m * self.state.table_speed_m_s
        friction_n += self.regime.table * axis.coulomb_n
        return (self._load_n() - friction_n) / axis.mass_kg

    def _stays_held(self) -> bool:
        """Check that nothing moves: motor, table and torque are constant within the friction."""
        inputs = self._inputs
        if not self.held or self.state.torque_n_m != inputs.command_n_m:
            return False
        terms = taylor_terms(self._axis, self.state, self.regime, inputs, 0.0)
        return find_switch(self._axis, self.state, self.regime, inputs.force_n, terms) is None

    def _propagate(self, duration_s: float) -> bool:
        """Take the whole sample in one step, if motor and table slide without a switch."""
        if not self._slides or duration_s > self._max_propagated_s:
            return False
        state = sliding_step(self._axis, self.state, self.regime, self._inputs, duration_s)
        if state is None:
            return False
        if self._perturbed:
            size_rad_s = self._size_rad_s(duration_s)
            self.state = state
            self._perturb(size_rad_s, switched=False)
        else:
            self.state = state
        return True

    def _step(self, step_s: float) -> float:
        """Take one Taylor step, up to the first switch if any; return its duration [s]."""
        axis = self._axis
        terms = taylor_terms(axis, self.state, self.regime, self._inputs, step_s)
        switch = find_switch(axis, self.state, self.regime, self._inputs.force_n, terms)
        fraction = terms.valid if switch is None else switch.fraction
        self.state = _state_at(self.state, terms, fraction)
        if switch is not None:
            self._apply(switch)
        if self._perturbed and (switch is None or switch.kind in FRICTION_SWITCHES):
            self._perturb(terms.size_rad_s, switched=switch is not None)
        return fraction * step_s

    def _apply(self, switch: Switch) -> None:
        """Change the regime at a switch; a part that came to rest sticks or slides on."""
        self._switches += 1
        if self._switches > MAX_SWITCHES:
            raise RuntimeError(
                f"{self._switches} switches of {switch.kind.value!r} and others in a sample; "
                f"must be <= {MAX_SWITCHES}: shorten the sample, or change the parameters a little"
            )
        regime = self.regime
        match switch.kind:
            case SwitchKind.MOTOR_STOPS:
                self.state = self.state._replace(motor_speed_rad_s=0.0)
                regime = regime._replace(motor=self._motor_direction())
            case SwitchKind.MOTOR_BREAKS_AWAY:
                regime = regime._replace(motor=switch.direction)
            case SwitchKind.TABLE_STOPS:
                self.state = self.state._replace(table_speed_m_s=0.0)
                regime = regime._replace(table=self._table_direction())
            case SwitchKind.TABLE_BREAKS_AWAY:
                regime = regime._replace(table=switch.direction)
            case SwitchKind.NUT_FORCE:
                regime = regime._replace(nut_force=-regime.nut_force)
            case SwitchKind.STOP_REACHED:
                regime = regime._replace(stop=switch.direction, pressed=True)
            case SwitchKind.STOP_LEFT:
                regime = regime._replace(stop=0, pressed=False)
            case SwitchKind.STOP_RELEASED | SwitchKind.STOP_PRESSED:
                regime = regime._replace(pressed=not regime.pressed)
        self.regime = regime

    def _motor_direction(self) -> int:
        """Compute the direction of a motor that came to rest; 0 = held."""
        size_n = force_size_n(self._axis, self.state, self.regime, self._inputs.force_n)
        limits = motor_friction(self._axis, self.regime, self._nut_force_n(), size_n)
        torque_n_m = self.state.torque_n_m
        tolerance = limits.tolerance + SWITCH_ROUNDING_REL * abs(torque_n_m)
        if torque_n_m > limits.high + tolerance:
            return 1
        return -1 if torque_n_m < limits.low - tolerance else 0

    def _table_direction(self) -> int:
        """Compute the direction of a table that came to rest; 0 = held."""
        load_n = self._load_n()
        size_n = force_size_n(self._axis, self.state, self.regime, self._inputs.force_n)
        if abs(load_n) <= self._axis.coulomb_n + SWITCH_ROUNDING_REL * size_n:
            return 0
        return 1 if load_n > 0.0 else -1

    def _load_n(self) -> float:
        """Sum nut force, force, weight and stop force on the table."""
        load_n = self._nut_force_n() + self._inputs.force_n
        if not self.regime.pressed:
            return load_n
        axis, state = self._axis, self.state
        penetration_m = state.position_m - axis.stops_m[self.regime.stop > 0]
        load_n -= axis.stop_stiffness_n_m * penetration_m
        return load_n - axis.stop_damping_n_s_m * state.table_speed_m_s

    def _nut_force_n(self) -> float:
        axis, state = self._axis, self.state
        rate_m_s = axis.tau_m_rad * state.motor_speed_rad_s - state.table_speed_m_s
        return axis.stiffness_n_m * state.deflection_m + axis.damping_n_s_m * rate_m_s

    def _size_rad_s(self, step_s: float) -> float:
        """Sum the magnitudes of the terms of the motor's speed after a step."""
        axis, state = self._axis, self.state
        speed_m_s = axis.tau_m_rad * abs(state.motor_speed_rad_s) + abs(state.table_speed_m_s)
        force_n = axis.stiffness_n_m * abs(state.deflection_m) + axis.damping_n_s_m * speed_m_s
        torque_n_m = abs(state.torque_n_m) + axis.drag_n_m + axis.driving_m_rad * force_n
        return speed_m_s / axis.tau_m_rad + step_s * torque_n_m / axis.inertia_kg_m2

    def _perturb(self, size_rad_s: float, *, switched: bool) -> None:
        """Displace motor and table together, in one direction; a held part stays held.

        After a switch each part is displaced in the direction of its sliding. The deflection
        keeps the nut force, or a displaced part could switch back at once, again and again.
        """
        rounding_rel = 4.0 * SWITCH_ROUNDING_REL if switched else STEP_ROUNDING_REL
        error_rad_s = rounding_rel * size_rad_s
        axis = self._axis
        motor, table = self.regime.motor, self.regime.table
        d, w, v, torque_n_m, angle_rad, position_m = self.state
        rate_m_s = axis.tau_m_rad * w - v
        if motor:
            w += motor * error_rad_s if switched else error_rad_s
            angle_rad += STEP_ROUNDING_REL * abs(angle_rad)
        if table:
            error_m_s = axis.tau_m_rad * error_rad_s
            v += table * error_m_s if switched else error_m_s
            position_m += STEP_ROUNDING_REL * abs(position_m)
        if switched or not (motor and table):
            rate_m_s -= axis.tau_m_rad * w - v
            d += axis.damping_n_s_m / axis.stiffness_n_m * rate_m_s
        self.state = ScrewState(d, w, v, torque_n_m, angle_rad, position_m)


def _state_at(state: ScrewState, terms: ScrewTerms, fraction: float) -> ScrewState:
    """Evaluate the state after a fraction of a step."""
    return ScrewState(
        value(terms.deflection_m, fraction),
        value(terms.motor_speed_rad_s, fraction),
        value(terms.table_speed_m_s, fraction),
        value(terms.torque_n_m, fraction),
        state.motor_angle_rad + value(terms.motor_angle_rad, fraction),
        state.position_m + value(terms.travel_m, fraction),
    )
