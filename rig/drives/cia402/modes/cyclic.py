"""Cyclic synchronous position, velocity and torque (modes 8, 9 and 10 of CiA 402).

A target becomes valid with a SYNC, or with its write if no SYNC follows. The demand moves to it
linearly over the interpolation period 60C2, so it lags one period behind the master.
"""

from __future__ import annotations

from typing import NamedTuple

from rig.drives.cia402.axis import TORQUE_OFFSET, VELOCITY_OFFSET, DriveAxis
from rig.drives.cia402.modes.interpolator import LinearInterpolator
from rig.drives.cia402.signals import DriveDemand
from rig.drives.cia402.state_machine import StatusBit

VELOCITY_THRESHOLD = 0x606F
TARGET_TORQUE = 0x6071
TARGET_POSITION = 0x607A
POSITION_OFFSET = 0x60B0
INTERPOLATION_PERIOD = 0x60C2
TARGET_VELOCITY = 0x60FF

SPEED_ROUNDING_REL = 1e-9  # of the largest change of position in one sample


class CyclicTarget(NamedTuple):
    """Indices of a target and of the offset that is added to it."""

    target: int
    offset: int


POSITION_TARGET = CyclicTarget(TARGET_POSITION, POSITION_OFFSET)
VELOCITY_TARGET = CyclicTarget(TARGET_VELOCITY, VELOCITY_OFFSET)
TORQUE_TARGET = CyclicTarget(TARGET_TORQUE, TORQUE_OFFSET)


class _CyclicMode:
    """Common part: the sum of target and offset, interpolated between SYNCs."""

    controls_position = False
    obeys_switches = True
    indices: CyclicTarget

    def __init__(self, axis: DriveAxis) -> None:
        self._axis = axis
        self._interpolator = LinearInterpolator()
        self._last_inputs = (0, 0)

    def reset(self) -> None:
        """Forget the target."""
        self._interpolator.hold(0.0)
        self._last_inputs = (0, 0)

    def enter(self) -> None:
        """Start from the demand; a target written before is valid from the next SYNC on."""
        self._interpolator.hold(self._start_value())
        self._last_inputs = self._inputs()

    def on_control_word(self, word: int, previous: int) -> None:
        """No command of its own."""

    def on_sync(self, t_ns: int) -> None:
        """Make the target valid at t_ns [ns]."""
        self._last_inputs = target, torque = self._inputs()
        self._interpolator.aim(target * self._scale(), t_ns, self._period_ns(), torque)

    def status_bits(self) -> int:
        """Bit 12: the drive follows the target; 0 while a limit is active."""
        if self._axis.is_limited:
            return 0
        return StatusBit.MODE_BIT_12

    def _value(self) -> float:
        """Interpolated value of this sample."""
        if self._inputs() != self._last_inputs:
            self.on_sync(self._axis.t_ns)  # written without a SYNC
        return self._interpolator.value_at(self._axis.t_ns)

    def _inputs(self) -> tuple[int, int]:
        """Target with its offset, and torque offset."""
        dictionary = self._axis.dictionary
        target = dictionary.get(self.indices.target) + dictionary.get(self.indices.offset)
        return target, dictionary.get(TORQUE_OFFSET)

    def _period_ns(self) -> int:
        """Interpolation period [ns]; its exponent is -6 to -1, so it is exact."""
        dictionary = self._axis.dictionary
        value = dictionary.get(INTERPOLATION_PERIOD, 1)
        exponent = dictionary.get(INTERPOLATION_PERIOD, 2)
        return int(value * 10 ** (9 + exponent))

    def _start_value(self) -> float:
        raise NotImplementedError

    def _scale(self) -> float:
        """User units of one unit of the target."""
        return 1.0


class CyclicPosition(_CyclicMode):
    """Cyclic synchronous position: limited by 607D in position and by 6080 in speed.

    The master sets the target to the actual position before it enables the drive: the first SYNC
    makes the target valid wherever it is.
    """

    controls_position = True
    indices = POSITION_TARGET

    def step(self) -> DriveDemand:
        """Demand a position, with velocity 60B1 and torque 60B2 added as feed-forward."""
        axis = self._axis
        target = axis.limit_position(self._value())
        if axis.dt_s > 0.0:
            self._approach(target)
        velocity_offset = axis.velocity_of(VELOCITY_OFFSET)
        torque = self._interpolator.feed_forward_at(axis.t_ns)
        demand = axis.demand("position", torque=torque)
        return demand._replace(velocity=demand.velocity + velocity_offset)

    def _approach(self, target: float) -> None:
        """Move the demand to the target, no faster than the motor may."""
        axis = self._axis
        change = target - axis.position
        largest = axis.speed_limit() * axis.dt_s
        if abs(change) > largest * (1.0 + SPEED_ROUNDING_REL):
            axis.position += axis.limit(change, -largest, largest)
            axis.velocity = axis.speed_limit() if change > 0.0 else -axis.speed_limit()
        else:
            axis.position = target
            axis.velocity = change / axis.dt_s

    def _start_value(self) -> float:
        return self._axis.position


class CyclicVelocity(_CyclicMode):
    """Cyclic synchronous velocity, limited by 6080."""

    indices = VELOCITY_TARGET

    def step(self) -> DriveDemand:
        """Demand a velocity, with the torque 60B2 added as feed-forward."""
        axis = self._axis
        limit = axis.speed_limit()
        last = axis.velocity
        velocity = axis.limit(self._value(), -limit, limit)
        acceleration = (velocity - last) / axis.dt_s if axis.dt_s > 0.0 else 0.0
        axis.follow_actual()
        axis.velocity = velocity
        torque = self._interpolator.feed_forward_at(axis.t_ns)
        return axis.demand("velocity", acceleration, torque)

    def _start_value(self) -> float:
        return self._axis.velocity

    def _scale(self) -> float:
        return self._axis.units.velocity_per_wire_unit


class CyclicTorque(_CyclicMode):
    """Cyclic synchronous torque, limited by 6072; the drive limits the speed to 6080."""

    indices = TORQUE_TARGET

    def step(self) -> DriveDemand:
        """Demand a torque."""
        axis = self._axis
        limit = axis.torque_limit()
        torque = axis.limit(self._value(), -limit, limit)
        axis.follow_actual(is_moving=True)
        if abs(axis.velocity) <= axis.velocity_of(VELOCITY_THRESHOLD):
            axis.velocity = 0.0
        return axis.demand("torque", torque=torque)

    def _start_value(self) -> float:
        return 0.0
