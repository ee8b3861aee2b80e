"""Check of a motor against a motion: torque through a gear, speed and heat, with margins.

At the motor's shaft tau = J q'' + B q', with J = J_motor + J_load / ratio^2 and B likewise (source
000, use of the actuator).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from itertools import product
from typing import NamedTuple

import numpy as np

from planners import bounds
from planners.errors import PlanError, check_range
from planners.spectra.spectrum import speed_steps
from planners.trajectories.driven import Term, real_part
from planners.trajectories.pieces import FloatArray, ModalTerm, Piece, Smooth, add
from planners.trajectories.trajectory import JUMP_REL, Peak, Trajectory

LIMIT_EXCESS_REL = 1e-9  # share of a limit that a value may exceed it by: rounding


@dataclass(frozen=True, kw_only=True)
class Motor:
    """Limits of a motor: two regions of the torque-speed plane, equal for all four signs.

    Intermittent region: |torque| <= peak, |speed| <= max, |torque x speed| <= peak power.
    Continuous region: the same, up to the continuous torque. Raises PlanError for a limit that is
    not 1e-12 to 1e12 (a power may be inf), or a continuous torque above the peak.
    """

    continuous_torque_n_m: float
    peak_torque_n_m: float
    max_speed_rad_s: float
    peak_power_w: float = math.inf

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name != "peak_power_w" or value != math.inf:
                bounds.datum(field.name, value)
        if self.continuous_torque_n_m > self.peak_torque_n_m:
            raise PlanError(
                f"continuous_torque_n_m = {self.continuous_torque_n_m}; must be <= "
                f"peak_torque_n_m = {self.peak_torque_n_m}: check whether the two are exchanged"
            )

    def outline(self, torque_n_m: float, points: int = 101) -> tuple[FloatArray, FloatArray]:
        """Compute the edge of a region: speed [rad/s] and torque [N m], (points,) each.

        torque_n_m is the continuous or the peak torque. Speeds are 0 to the largest; the edge is
        mirrored for the other signs.
        """
        bounds.datum("torque_n_m", torque_n_m)
        speed = np.linspace(0.0, self.max_speed_rad_s, points)
        by_power = np.divide(
            self.peak_power_w, speed, out=np.full(points, math.inf), where=speed > 0.0
        )
        return speed, np.minimum(torque_n_m, by_power)


@dataclass(frozen=True, kw_only=True)
class Drivetrain:
    """Inertia and friction of motor and load, and the gear between them.

    The trajectory is that of the load: in rad, or in m with a radius [m/rad], lead / 2 pi of a
    screw. Raises PlanError for numbers that are not 1e-12 to 1e12 (inertia and friction may be 0),
    and for an inertia of 0 in total.
    """

    motor_inertia_kg_m2: float
    load_inertia_kg_m2: float = 0.0  # about the output shaft; a mass m on a radius r is m r^2
    motor_friction_n_m_s_rad: float = 0.0
    load_friction_n_m_s_rad: float = 0.0
    gear_ratio: float = 1.0  # turns of the motor per turn of the output shaft
    radius_m: float = 1.0  # 1 for a trajectory in rad

    def __post_init__(self) -> None:
        for field in fields(self):
            bounds.datum(
                field.name,
                getattr(self, field.name),
                zero=field.name not in ("gear_ratio", "radius_m"),
            )
        if not self.inertia_kg_m2 > 0.0:
            raise PlanError(
                "inertia_kg_m2 = 0 of a drivetrain; must be > 0: give the inertia of the rotor"
            )

    @property
    def inertia_kg_m2(self) -> float:
        """Inertia at the motor's shaft: J_motor + J_load / ratio^2."""
        return self.motor_inertia_kg_m2 + self.load_inertia_kg_m2 / self.gear_ratio**2

    @property
    def friction_n_m_s_rad(self) -> float:
        """Viscous friction at the motor's shaft: B_motor + B_load / ratio^2."""
        return self.motor_friction_n_m_s_rad + self.load_friction_n_m_s_rad / self.gear_ratio**2

    def shaft_angle(self, trajectory: Trajectory) -> Trajectory:
        """Compute the angle of the motor's shaft [rad].

        Raises PlanError for a motion out of bounds, and for a step in speed within it, which would
        need an infinite torque.
        """
        bounds.duration(trajectory.duration_s)
        for position in trajectory.at(trajectory.breaks_s).tolist():
            check_range(
                "position",
                position,
                -bounds.FARTHEST_M,
                bounds.FARTHEST_M,
                "scale the motion to rad or m",
            )
        _check_speed_steps(trajectory)
        return trajectory.scaled(self.gear_ratio / self.radius_m)


class Effort(NamedTuple):
    """Peak and rms values of a motion at the motor's shaft.

    They are exact. The rms torque is over the motion, without rest.
    """

    peak_torque_n_m: Peak
    rms_torque_n_m: float
    peak_speed_rad_s: Peak
    peak_power_w: Peak
    duration_s: float


class Verdict(NamedTuple):
    """Margins of a motion: 1 - value / limit each, below 0 where the limit is exceeded."""

    effort: Effort
    cycle_torque_n_m: float  # rms over motion and rest
    least_rest_s: float  # least rest that keeps the continuous torque
    torque_margin: float
    thermal_margin: float
    speed_margin: float
    power_margin: float

    @property
    def margins(self) -> dict[str, float]:
        """Margins by the name of the limit."""
        return {
            "torque": self.torque_margin,
            "thermal": self.thermal_margin,
            "speed": self.speed_margin,
            "power": self.power_margin,
        }

    @property
    def feasible(self) -> bool:
        """True if every limit is kept; one that is met exactly is kept."""
        return min(self.margins.values()) >= -LIMIT_EXCESS_REL

    @property
    def tightest(self) -> str:
        """Name of the limit with the least margin."""
        return min(self.margins, key=self.margins.__getitem__)


def check_motor(
    motor: Motor, drivetrain: Drivetrain, trajectory: Trajectory, rest_s: float = 0.0
) -> Verdict:
    """Check a motor that repeats a motion, with a rest of rest_s after each.

    Peaks are compared with the intermittent region, the rms torque over motion and rest with the
    continuous one (tau_eff <= tau_c and q'_max <= v_n of source 000).

    Raises PlanError for a rest that is not 0 to 1e9 s, a motion out of bounds, and a step in speed.
    """
    check_range("rest_s", rest_s, 0.0, bounds.LONGEST_S, "0 repeats the motion without a pause")
    need = effort(drivetrain, trajectory)
    heat = need.rms_torque_n_m**2 * need.duration_s  # integral of torque^2
    cycle = math.sqrt(heat / (need.duration_s + rest_s))
    return Verdict(
        need,
        cycle,
        least_rest_s=max(0.0, heat / motor.continuous_torque_n_m**2 - need.duration_s),
        torque_margin=1.0 - need.peak_torque_n_m.value / motor.peak_torque_n_m,
        thermal_margin=1.0 - cycle / motor.continuous_torque_n_m,
        speed_margin=1.0 - need.peak_speed_rad_s.value / motor.max_speed_rad_s,
        power_margin=1.0 - need.peak_power_w.value / motor.peak_power_w,
    )


def effort(drivetrain: Drivetrain, trajectory: Trajectory) -> Effort:
    """Compute peak and rms values at the motor's shaft.

    Torque^2 itself is integrated, so that a motion that starts or ends at speed is exact too.
    """
    shaft = drivetrain.shaft_angle(trajectory)
    torque = _torque(drivetrain, shaft)
    pieces = [
        _multiply(t, _differentiate(q, 1)) for t, q in zip(torque.pieces, shaft.pieces, strict=True)
    ]
    power = Trajectory(tuple(pieces))
    return Effort(torque.peak(), torque.rms(), shaft.peak(1), power.peak(), shaft.duration_s)


def torque(drivetrain: Drivetrain, trajectory: Trajectory) -> Trajectory:
    """Compute the torque at the motor's shaft over time [N m], piece by piece as the motion."""
    return _torque(drivetrain, drivetrain.shaft_angle(trajectory))


def operating_points(
    drivetrain: Drivetrain, trajectory: Trajectory, points_per_piece: int = 200
) -> tuple[FloatArray, FloatArray]:
    """Sample the motion in the torque-speed plane.

    Speed [rad/s] and torque [N m], (pieces x points,) each. Every piece is sampled from its own
    start to its own end, so that a step of torque is drawn as one.
    """
    shaft = drivetrain.shaft_angle(trajectory)
    speeds, torques = [], []
    for q, t in zip(shaft.pieces, _torque(drivetrain, shaft).pieces, strict=True):
        times = np.linspace(0.0, q.duration_s, points_per_piece)
        speeds.append(q.at(times, 1))
        torques.append(t.at(times))
    return np.concatenate(speeds), np.concatenate(torques)


def _torque(drivetrain: Drivetrain, shaft: Trajectory) -> Trajectory:
    inertia, friction = drivetrain.inertia_kg_m2, drivetrain.friction_n_m_s_rad
    pieces = []
    for angle in shaft.pieces:
        accelerating = _differentiate(angle, 2).scaled(inertia)
        pieces.append(add(accelerating, _differentiate(angle, 1).scaled(friction)))
    return Trajectory(tuple(pieces))


def _differentiate(piece: Piece, order: int) -> Piece:
    if isinstance(piece, Smooth):
        return Smooth(
            piece.duration_s, lambda t, k: piece.at(t, k + order), piece.highest_order - order
        )
    for _ in range(order):
        piece = piece.derivative()
    return piece


def _multiply(a: Piece, b: Piece) -> Piece:
    """Compute a(t) b(t).

    The product of two oscillations is half the oscillation of the sum of their rates plus half that
    of the difference.
    """
    if isinstance(a, Smooth) or isinstance(b, Smooth):
        return Smooth(a.duration_s, lambda t, _: a.at(t) * b.at(t), 0)
    parts: list[tuple[complex, Term]] = []
    terms_a = (ModalTerm(0j, a.coefficients), *a.modes)
    terms_b = (ModalTerm(0j, b.coefficients), *b.modes)
    for (r, p), (s, q) in product(terms_a, terms_b):
        for rate, other in ((s, np.array(q)), (s.conjugate(), np.conj(q))):
            parts.append((0.5, Term(r + rate, tuple(np.convolve(p, other).tolist()))))
    return real_part(parts, a.duration_s)


def _check_speed_steps(trajectory: Trajectory) -> None:
    steps = np.abs(speed_steps(trajectory)[1:-1])
    if steps.size and steps.max() > JUMP_REL * trajectory.peak(1).value:
        k = int(steps.argmax())
        raise PlanError(
            f"speed steps by {steps[k]:.6g} at {trajectory.breaks_s[k + 1]:.6g} s; must be 0 for a "
            "motor: blend the segments"
        )
