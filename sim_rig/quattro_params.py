"""Parameters of the simulated Quattro: geometry with its errors, masses, drives and servos.

Base radius, arm and forearm are those of the public robnux model of this robot. Plate, masses,
inertia, gear, torque and speed are a design choice after its data sheet (150 m/s2 with 2 kg);
friction, encoder and plate inertia are typical values. A QuattroParams that exists is valid.
"""

from __future__ import annotations

import math
from typing import Annotated

import msgspec
from msgspec import Meta

from sim_rig.field_check import check_fields

# speed at which the regularised dry friction reaches 71 % of its value
FRICTION_SPEED_RAD_S = 0.02
MAX_FRICTION_RATE_1_S = 1000.0  # of a joint alone; beyond, a step of 1 ms is inaccurate
MAX_SPEED_LOOP_1_S = 800.0  # gain over joint inertia; unstable at 2000, sampled at 1 kHz

Length = Annotated[float, Meta(ge=1e-3, le=10.0, description="give it in m")]
Offset = Annotated[float, Meta(ge=0.0, le=10.0, description="give it in m")]
LengthError = Annotated[float, Meta(ge=-0.02, le=0.02, description="actual minus nominal, in m")]
LegErrors = tuple[LengthError, LengthError, LengthError, LengthError]
PartMass = Annotated[float, Meta(ge=0.0, le=100.0, description="give it in kg")]
PlateMass = Annotated[float, Meta(ge=1e-2, le=100.0, description="give it in kg")]
PartInertia = Annotated[float, Meta(ge=1e-4, le=100.0, description="give it in kg m2")]
Ratio = Annotated[float, Meta(ge=1.0, le=1000.0, description="motor turns per turn of the joint")]
JointTorque = Annotated[float, Meta(gt=0.0, le=1e5, description="N m at the joint")]
JointSpeed = Annotated[float, Meta(gt=0.0, le=1e3, description="rad/s at the joint")]
DryFriction = Annotated[float, Meta(ge=0.0, le=1e3, description="N m at the joint, 0 for none")]
ViscousFriction = Annotated[float, Meta(ge=0.0, le=1e3, description="N m s/rad, 0 for none")]
Counts = Annotated[int, Meta(ge=0, le=2**40, description="0 for an encoder without steps")]
Bandwidth = Annotated[float, Meta(ge=0.1, le=100.0, description="give it in Hz, at -3 dB")]
DampingRatio = Annotated[float, Meta(ge=0.05, le=5.0, description="damping ratio of the setpoint")]
Rate = Annotated[float, Meta(ge=0.0, le=400.0, description="give it in 1/s")]
SpeedGain = Annotated[float, Meta(ge=0.0, le=1e4, description="give it in N m s/rad")]
ResetTime = Annotated[float, Meta(ge=5e-3, le=1e3, description="give it in s")]
Coordinate = Annotated[float, Meta(ge=-10.0, le=10.0, description="give it in m")]
Height = Annotated[float, Meta(ge=-10.0, le=-0.01, description="m, below the base")]
Gravity = Annotated[float, Meta(ge=0.0, le=30.0, description="give it in m/s2")]


class QuattroParams(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="quattro",
):
    """Robot of four arms (`[bench.robot]` with `kind = "quattro"`); rise time 31 ms by default.

    Raises ValueError naming key, value, bound and next step; also for friction beyond
    MAX_FRICTION_RATE_1_S and a speed gain beyond MAX_SPEED_LOOP_1_S.
    """

    base_radius_m: Length = 0.300  # axis of the base to the shoulders
    arm_m: Length = 0.400
    forearm_m: Length = 1.020
    bar_m: Length = 0.24  # rotating bar of the plate
    offset_m: Offset = 0.12  # plate points beside the ends of the bar, along y
    arm_error_m: LegErrors = (0.0, 0.0, 0.0, 0.0)  # unknown to the servos, as the next two
    forearm_error_m: LegErrors = (0.0, 0.0, 0.0, 0.0)
    base_radius_error_m: LengthError = 0.0
    arm_mass_kg: PartMass = 0.9  # thin bar
    forearm_mass_kg: PartMass = 0.35  # both rods of a leg; half at the elbow, half at the plate
    plate_mass_kg: PlateMass = 1.3
    plate_inertia_kg_m2: PartInertia = 0.01  # about z, of the parts that turn
    motor_inertia_kg_m2: PartInertia = 0.3  # motor and gear, at the joint
    gear_ratio: Ratio = 33.0
    torque_limit_n_m: JointTorque = 260.0
    speed_limit_rad_s: JointSpeed = 35.0
    coulomb_n_m: DryFriction = 1.5
    viscous_n_m_s_rad: ViscousFriction = 0.5
    encoder_counts_per_rev: Counts = 1_048_576  # of the motor
    bandwidth_hz: Bandwidth = 11.0  # filter of the setpoint, second order
    damping: DampingRatio = 0.9
    position_gain_1_s: Rate = 100.0
    speed_gain_n_m_s_rad: SpeedGain = 150.0
    reset_time_s: ResetTime = 0.03  # of the integral part
    gravity_m_s2: Gravity = 9.81
    start_m: Coordinate = 0.0  # start position along X, from home
    home_z_m: Height = -0.90  # height of the home position over the base

    def __post_init__(self) -> None:
        check_fields(self)
        slope_n_m_s = self.coulomb_n_m / FRICTION_SPEED_RAD_S + self.viscous_n_m_s_rad
        rate_1_s = slope_n_m_s / self.joint_inertia_kg_m2
        if rate_1_s > MAX_FRICTION_RATE_1_S:
            raise ValueError(
                f"coulomb_n_m = {self.coulomb_n_m} and viscous_n_m_s_rad = "
                f"{self.viscous_n_m_s_rad} give a rate of {rate_1_s:.3g} 1/s; must be <= "
                f"{MAX_FRICTION_RATE_1_S:g} 1/s: lower them, or raise motor_inertia_kg_m2"
            )
        loop_1_s = self.speed_gain_n_m_s_rad / self.joint_inertia_kg_m2
        if loop_1_s > MAX_SPEED_LOOP_1_S:
            raise ValueError(
                f"speed_gain_n_m_s_rad = {self.speed_gain_n_m_s_rad} gives a loop of "
                f"{loop_1_s:.3g} 1/s; must be <= {MAX_SPEED_LOOP_1_S:g} 1/s: "
                "lower it, or raise motor_inertia_kg_m2"
            )

    @property
    def joint_inertia_kg_m2(self) -> float:
        """Inertia of a joint: motor, arm, half a forearm at the elbow (0.376 by default)."""
        square_m2 = self.arm_m * self.arm_m
        arm_kg_m2 = self.arm_mass_kg * square_m2 / 3.0
        return self.motor_inertia_kg_m2 + arm_kg_m2 + 0.5 * self.forearm_mass_kg * square_m2

    @property
    def arm_moment_kg_m(self) -> float:
        """First moment of an arm and half a forearm about the joint."""
        return 0.5 * (self.arm_mass_kg + self.forearm_mass_kg) * self.arm_m

    @property
    def moving_mass_kg(self) -> float:
        """Mass at the plate: plate and half of the four forearms."""
        return self.plate_mass_kg + 2.0 * self.forearm_mass_kg

    @property
    def turning_inertia_kg_m2(self) -> float:
        """Inertia about z at the plate, with half of the forearms at the ends of the bar."""
        forearms_kg = 2.0 * self.forearm_mass_kg
        return self.plate_inertia_kg_m2 + forearms_kg * (0.5 * self.bar_m) ** 2

    @property
    def count_rad(self) -> float:
        """Step of the encoder at the joint; 0 for an encoder without steps."""
        counts = self.encoder_counts_per_rev * self.gear_ratio
        return 2.0 * math.pi / counts if counts else 0.0
