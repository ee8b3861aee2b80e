"""Homing (mode 6 of CiA 402): methods 17 and 18 on an end switch, 35 and 37 where the axis is.

Methods 17 and 18 search the negative or positive end switch at 6099:01, reverse, and take the
position of the sample at which the switch releases at 6099:02 as home. The home position is
accurate to the travel in one sample. All ramps have the acceleration 609A. A switch at the other
end ends the homing with an error.
"""

from __future__ import annotations

from enum import Enum

from rig.drives.cia402.axis import DriveAxis
from rig.drives.cia402.errors import AbortCode, SdoAbort
from rig.drives.cia402.modes.mode import CONTROL_WORD
from rig.drives.cia402.ramp import approach_velocity
from rig.drives.cia402.signals import DriveDemand
from rig.drives.cia402.state_machine import ControlBit, StatusBit

HOMING_METHOD = 0x6098
HOMING_SPEEDS = 0x6099
HOMING_ACCELERATION = 0x609A

_SEARCH_SPEED = 1  # sub-index of 6099
_RELEASE_SPEED = 2

NEGATIVE_END_SWITCH = 17
POSITIVE_END_SWITCH = 18
ACTUAL_POSITION = (35, 37)
METHODS = (NEGATIVE_END_SWITCH, POSITIVE_END_SWITCH, *ACTUAL_POSITION)


class HomingPhase(Enum):
    """Progress of the homing."""

    IDLE = "not started, interrupted or completed"
    SEARCH = "moving into the switch"
    RELEASE = "moving out of the switch"


class Homing:
    """Generator of the homing motion."""

    controls_position = True
    obeys_switches = False

    def __init__(self, axis: DriveAxis) -> None:
        """Home an axis."""
        self._axis = axis
        axis.dictionary.add_check(HOMING_METHOD, _check_method)
        self.reset()

    def reset(self) -> None:
        """Forget the home position."""
        self._phase = HomingPhase.IDLE
        self._is_attained = False
        self._is_failed = False
        self._direction = 0.0  # towards the switch
        self._other_switch = False  # state of the other switch at the last sample

    def enter(self) -> None:
        """Stop a moving axis; a home position found before stays attained."""
        self._phase = HomingPhase.IDLE
        self._is_failed = False

    def on_control_word(self, word: int, previous: int) -> None:
        """Start at a rising edge of bit 4, interrupt at a falling one."""
        if not word & ControlBit.START:
            self._phase = HomingPhase.IDLE
        elif not previous & ControlBit.START:
            self._start()

    def on_sync(self, t_ns: int) -> None:
        """No object of its own."""

    def step(self) -> DriveDemand:
        """Demand the position of the homing motion."""
        self._watch_switches()
        axis = self._axis
        last = axis.velocity
        rate = axis.acceleration_of(HOMING_ACCELERATION)
        axis.velocity = approach_velocity(last, self._wanted_velocity(), rate * axis.dt_s)
        axis.position += (last + axis.velocity) / 2.0 * axis.dt_s
        acceleration = (axis.velocity - last) / axis.dt_s if axis.dt_s > 0.0 else 0.0
        return axis.demand("position", acceleration)

    def status_bits(self) -> int:
        """Bit 10: at rest. Bit 12: attained. Bit 13: error. All 0 while homing."""
        if self._phase is not HomingPhase.IDLE:
            return 0
        bits = 0
        if self._axis.velocity == 0.0:
            bits |= StatusBit.TARGET_REACHED
        if self._is_attained:
            bits |= StatusBit.MODE_BIT_12
        if self._is_failed:
            bits |= StatusBit.MODE_BIT_13
        return bits

    def _start(self) -> None:
        self._is_attained = False
        self._is_failed = False
        axis = self._axis
        method = axis.dictionary.get(HOMING_METHOD)
        if method in ACTUAL_POSITION:
            self._attain()
            return
        self._direction = -1.0 if method == NEGATIVE_END_SWITCH else 1.0
        self._phase = HomingPhase.SEARCH
        self._other_switch = self._switch(-self._direction)

    def _attain(self) -> None:
        self._axis.set_home(self._axis.feedback.position)
        self._phase = HomingPhase.IDLE
        self._is_attained = True

    def _watch_switches(self) -> None:
        if self._phase is HomingPhase.IDLE:
            return
        other = self._switch(-self._direction)
        if other and not self._other_switch:
            self._phase = HomingPhase.IDLE
            self._is_failed = True
            return
        self._other_switch = other
        is_active = self._switch(self._direction)
        if self._phase is HomingPhase.SEARCH and is_active:
            self._phase = HomingPhase.RELEASE
        elif self._phase is HomingPhase.RELEASE and not is_active:
            self._attain()

    def _switch(self, direction: float) -> bool:
        """State of the end switch in a direction."""
        feedback = self._axis.feedback
        return feedback.negative_switch if direction < 0.0 else feedback.positive_switch

    def _wanted_velocity(self) -> float:
        axis = self._axis
        is_halted = bool(axis.dictionary.get(CONTROL_WORD) & ControlBit.HALT)
        if self._phase is HomingPhase.IDLE or is_halted:
            return 0.0
        if self._phase is HomingPhase.SEARCH:
            speed = min(axis.velocity_of(HOMING_SPEEDS, _SEARCH_SPEED), axis.speed_limit())
            return self._direction * speed
        speed = min(axis.velocity_of(HOMING_SPEEDS, _RELEASE_SPEED), axis.speed_limit())
        return -self._direction * speed


def _check_method(subindex: int, value: int) -> None:
    if value not in METHODS:
        detail = f"{value}, must be one of {METHODS}: this drive homes on end switches alone"
        raise SdoAbort(AbortCode.INVALID_VALUE, HOMING_METHOD, subindex, detail)
