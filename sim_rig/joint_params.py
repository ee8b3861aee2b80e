"""Parameters of the simulated elastic joint: motor, harmonic drive, load and their sensors.

The defaults are the rig listed in source 001, section "risultati sperimentali". A Joint that exists
is valid.
"""

from __future__ import annotations

import math
from typing import Annotated

import msgspec
from msgspec import Meta

from sim_rig.field_check import check_fields

# natural frequency or decay rate of a mode; beyond, a step is under 10 us and a simulated second
# takes a minute
MAX_RATE_RAD_S = 1e5

Inertia = Annotated[float, Meta(ge=1e-12, le=1e6, description="give it in kg m2")]
Ratio = Annotated[
    float, Meta(ge=1e-3, le=1e6, description="turns of the motor per turn of the load")
]
Friction = Annotated[float, Meta(ge=0.0, le=1e6, description="give it in N m s/rad, 0 for none")]
Stiffness = Annotated[
    float, Meta(ge=1e-9, le=1e12, description="give it in N m/rad, referred to the motor")
]
Limit = Annotated[float, Meta(gt=0.0, description="give it in N m, inf for none")]
Torque = Annotated[float, Meta(ge=0.0, le=1e6, description="give it in N m, 0 for none")]
Push = Annotated[float, Meta(ge=-1e6, le=1e6, description="give it in N m")]
Cycles = Annotated[float, Meta(ge=1e-3, le=1e4, description="periods per turn of the motor")]
PhaseAngle = Annotated[float, Meta(ge=-1e3, le=1e3, description="give it in rad")]
Angle = Annotated[float, Meta(ge=0.0, le=1.0, description="give it in rad, 0 for none")]
Counts = Annotated[int, Meta(ge=0, le=2**40, description="0 for an encoder without steps")]
Noise = Annotated[float, Meta(ge=0.0, le=1e6, description="rms in rad/s2, 0 for none")]
Bias = Annotated[float, Meta(ge=-1e6, le=1e6, description="give it in rad/s2")]
Instant = Annotated[float, Meta(ge=0.0, le=1e6, description="seconds since the start of the bench")]


class DisturbancePulse(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Disturbance pulse: constant torques on motor and load over start_s <= t < end_s.

    Raises ValueError, as Joint does.
    """

    start_s: Instant
    end_s: Instant
    motor_n_m: Push = 0.0
    load_n_m: Push = 0.0  # at the output shaft

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.end_s > self.start_s:
            raise ValueError(
                f"end_s = {self.end_s} of a disturbance; must be > start_s = {self.start_s}: "
                "exchange them, or give a later end"
            )


Pulses = Annotated[tuple[DisturbancePulse, ...], Meta(description="give DisturbancePulse objects")]


# constants from which all five printed modes of source 001 follow
FITTED = {
    "load_inertia_kg_m2": 2.8736758,
    "motor_friction_n_m_s_rad": 0.0034839632,
    "load_friction_n_m_s_rad": 4.9173636,
    "stiffness_n_m_rad": 3.1682276,
    "elastic_damping_n_m_s_rad": 0.0033101368,
}
PARAMETER_SETS: dict[str, dict[str, float]] = {"listed": {}, "fitted": FITTED}


class Joint(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    omit_defaults=True,  # JSON has no infinity
):
    """Two masses and a spring; ripple, friction and sensor errors are 0 by default.

    Raises ValueError naming key, value, bound and next step; also for a mode faster than
    MAX_RATE_RAD_S, and for an encoder ripple so steep that the reading decreases.
    """

    motor_inertia_kg_m2: Inertia = 1.5e-4
    load_inertia_kg_m2: Inertia = 2.7  # about the output shaft
    gear_ratio: Ratio = 100.0
    motor_friction_n_m_s_rad: Friction = 3.4e-3  # viscous
    load_friction_n_m_s_rad: Friction = 0.0  # viscous, at the output shaft
    # of the spring between motor angle and gear_ratio x load angle, referred to the motor
    stiffness_n_m_rad: Stiffness = 3.1
    elastic_damping_n_m_s_rad: Friction = 2.2e-3  # in parallel with that spring
    torque_limit_n_m: Limit = math.inf  # the drive limits the command
    # x sin(cycles_per_rev x motor angle + phase), on the motor
    torque_ripple_n_m: Torque = 0.0
    torque_ripple_cycles_per_rev: Cycles = 2.0  # a wave generator has two lobes
    torque_ripple_phase_rad: PhaseAngle = 0.0
    coulomb_torque_n_m: Torque = 0.0  # dry friction at the motor
    # x sin(cycles_per_rev x motor angle), added to the reading
    encoder_ripple_rad: Angle = 0.0
    encoder_ripple_cycles_per_rev: Cycles = 1.0  # an eccentric disc
    encoder_counts_per_rev: Counts = 8192
    accelerometer_noise_rad_s2: Noise = 0.0  # white, one value a sample
    accelerometer_bias_rad_s2: Bias = 0.0
    disturbances: Pulses = ()

    def __post_init__(self) -> None:
        check_fields(self)
        for key, rate_rad_s in self._rates_rad_s().items():
            if rate_rad_s > MAX_RATE_RAD_S:
                raise ValueError(
                    f"{key} = {getattr(self, key)} gives a mode of {rate_rad_s:.3g} rad/s; "
                    f"must be <= {MAX_RATE_RAD_S:g} rad/s: "
                    "lower it, or raise the inertia it acts on"
                )
        slope = self.encoder_ripple_rad * self.encoder_ripple_cycles_per_rev
        if slope >= 1.0:
            raise ValueError(
                f"encoder_ripple_rad = {self.encoder_ripple_rad} with "
                f"encoder_ripple_cycles_per_rev = {self.encoder_ripple_cycles_per_rev:g}; "
                "their product must be < 1, or the reading decreases while the angle increases: "
                "lower one of them"
            )

    @property
    def reflected_inertia_kg_m2(self) -> float:
        """Reflected inertia of the load, at the motor shaft."""
        return self.load_inertia_kg_m2 / self.gear_ratio**2

    @property
    def max_rate_rad_s(self) -> float:
        """Upper bound of all rates of the linearised motion."""
        return sum(self._rates_rad_s().values())

    def _rates_rad_s(self) -> dict[str, float]:
        """Compute resonance, ripple frequency and three decay rates, by the key causing each."""
        mobility = 1.0 / self.motor_inertia_kg_m2 + 1.0 / self.reflected_inertia_kg_m2
        ripple_n_m_rad = self.torque_ripple_n_m * self.torque_ripple_cycles_per_rev
        return {
            "stiffness_n_m_rad": math.sqrt(self.stiffness_n_m_rad * mobility),
            "elastic_damping_n_m_s_rad": self.elastic_damping_n_m_s_rad * mobility,
            "motor_friction_n_m_s_rad": self.motor_friction_n_m_s_rad / self.motor_inertia_kg_m2,
            "load_friction_n_m_s_rad": self.load_friction_n_m_s_rad / self.load_inertia_kg_m2,
            "torque_ripple_n_m": math.sqrt(ripple_n_m_rad / self.motor_inertia_kg_m2),
        }
