"""Motion of the axis in user increments: measured, demanded, and limited by the dictionary."""

from __future__ import annotations

from rig.drives.cia402.object_dictionary import ObjectDictionary
from rig.drives.cia402.ramp import RampLimits
from rig.drives.cia402.signals import DemandKind, DriveDemand, DriveFeedback, DriveUnits

POSITION_DEMAND = 0x6062
POSITION_ACTUAL = 0x6064
VELOCITY_DEMAND = 0x606B
VELOCITY_ACTUAL = 0x606C
MAX_TORQUE = 0x6072
TORQUE_DEMAND = 0x6074
TORQUE_ACTUAL = 0x6077
HOME_OFFSET = 0x607C
SOFTWARE_LIMIT = 0x607D
MAX_PROFILE_VELOCITY = 0x607F
MAX_MOTOR_SPEED = 0x6080
VELOCITY_OFFSET = 0x60B1
TORQUE_OFFSET = 0x60B2
DIGITAL_INPUTS = 0x60FD

_NEGATIVE_SWITCH = 1 << 0  # bits of 60FD
_POSITIVE_SWITCH = 1 << 1


class DriveAxis:
    """Position, velocity and limits of the axis.

    User positions are relative to the zero position of the application; the encoder reads
    `origin` there.
    """

    def __init__(self, dictionary: ObjectDictionary, units: DriveUnits) -> None:
        """Read limits from, and report actual values into, a dictionary."""
        self.dictionary = dictionary
        self.units = units
        self.reset()

    def reset(self) -> None:
        """Forget the measurements, the demand and the home position."""
        self.feedback = DriveFeedback(0.0)
        self.t_ns = 0
        self.demand_t_ns = 0  # time that position and velocity of the demand belong to
        self.dt_s = 0.0  # since the last sample
        self.origin = 0.0  # encoder position of the user position 0 [increments]
        self.position = 0.0  # demand, user frame [increments]
        self.velocity = 0.0  # demand [increments/s]
        self.is_limited = False  # a limit changed the demand of this sample

    @property
    def actual_position(self) -> float:
        """Measured position, user frame [increments]."""
        return self.feedback.position - self.origin

    @property
    def actual_velocity(self) -> float:
        """Measured velocity [increments/s]."""
        return self.feedback.velocity

    def measure(self, t_ns: int, dt_s: float, feedback: DriveFeedback) -> None:
        """Take the measurement at t_ns [ns], dt_s [s] after the last one."""
        self.t_ns = t_ns
        self.dt_s = dt_s
        self.feedback = feedback
        self.is_limited = False
        self.publish_actual()

    def publish_actual(self) -> None:
        """Write the actual values into the dictionary."""
        inputs = 0
        if self.feedback.negative_switch:
            inputs |= _NEGATIVE_SWITCH
        if self.feedback.positive_switch:
            inputs |= _POSITIVE_SWITCH
        wire_velocity = self.actual_velocity / self.units.velocity_per_wire_unit
        self.dictionary.set(POSITION_ACTUAL, round(self.actual_position))
        self.dictionary.set(VELOCITY_ACTUAL, round(wire_velocity))
        self.dictionary.set(TORQUE_ACTUAL, round(self.feedback.torque))
        self.dictionary.set(DIGITAL_INPUTS, inputs)

    def publish_demand(self, demand: DriveDemand) -> None:
        """Write the demand values into the dictionary."""
        wire_velocity = demand.velocity / self.units.velocity_per_wire_unit
        self.demand_t_ns = self.t_ns
        self.dictionary.set(POSITION_DEMAND, round(self.position))
        self.dictionary.set(VELOCITY_DEMAND, round(wire_velocity))
        self.dictionary.set(TORQUE_DEMAND, round(demand.torque))

    def follow_actual(self, *, is_moving: bool = False) -> None:
        """Set the demand to the measured position, and to its velocity or to rest."""
        self.demand_t_ns = self.t_ns
        self.position = self.actual_position
        self.velocity = self.actual_velocity if is_moving else 0.0

    def begin_to_brake(self) -> None:
        """Set the demand to the measured position and the slower of measured and demanded velocity.

        A blocked axis is slower than its demand; an encoder that jumps shows any velocity. If the
        two are opposite, the demand is at rest.
        """
        demanded, measured = self.velocity, self.actual_velocity
        self.follow_actual()
        if demanded * measured > 0.0:
            self.velocity = min(demanded, measured, key=abs)

    def set_home(self, encoder_position: float) -> None:
        """Take a position of the encoder [increments] as home.

        The zero position is home plus the home offset 607C (CiA 402, figure "home offset").
        """
        old_origin = self.origin
        self.origin = encoder_position + self.dictionary.get(HOME_OFFSET)
        self.position += old_origin - self.origin
        self.publish_actual()

    def velocity_of(self, index: int, subindex: int = 0) -> float:
        """Velocity in an object [increments/s]."""
        return self.dictionary.get(index, subindex) * self.units.velocity_per_wire_unit

    def acceleration_of(self, index: int) -> float:
        """Acceleration in an object [increments/s^2]."""
        return self.dictionary.get(index) * self.units.acceleration_per_wire_unit

    def profile_limits(self, speed: int, acceleration: int, deceleration: int) -> RampLimits:
        """Limits of a profile from the indices of its objects, with 607F and 6080."""
        profile_speed = min(self.velocity_of(speed), self.velocity_of(MAX_PROFILE_VELOCITY))
        return RampLimits(
            speed=min(profile_speed, self.speed_limit()),
            acceleration=self.acceleration_of(acceleration),
            deceleration=self.acceleration_of(deceleration),
        )

    def speed_limit(self) -> float:
        """Largest speed of the motor [increments/s], object 6080."""
        return self.velocity_of(MAX_MOTOR_SPEED)

    def torque_limit(self) -> float:
        """Largest torque [permille of rated], object 6072."""
        return float(self.dictionary.get(MAX_TORQUE))

    def limit(self, value: float, low: float, high: float) -> float:
        """Limit a value, and note that a limit is active if it is beyond."""
        limited = min(max(value, low), high)
        if limited != value:
            self.is_limited = True
        return limited

    def position_limits(self) -> tuple[float, float] | None:
        """Software position limits 607D [increments]; None if min >= max switches them off."""
        low = self.dictionary.get(SOFTWARE_LIMIT, 1)
        high = self.dictionary.get(SOFTWARE_LIMIT, 2)
        return (float(low), float(high)) if low < high else None

    def limit_position(self, target: float) -> float:
        """Limit a user position [increments] by the software position limits."""
        limits = self.position_limits()
        return self.limit(target, *limits) if limits else target

    def demand(
        self, kind: DemandKind, acceleration: float = 0.0, torque: float = 0.0
    ) -> DriveDemand:
        """Build the demand of this sample from the demanded position and velocity.

        acceleration [increments/s^2], torque [permille of rated].
        """
        return DriveDemand(
            kind=kind,
            position=self.position + self.origin,
            velocity=self.velocity,
            acceleration=acceleration,
            torque=torque,
            torque_limit=self.torque_limit(),
            speed_limit=self.speed_limit(),
        )
