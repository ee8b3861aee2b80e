"""Profile position (mode 1 of CiA 402): trapezoidal moves with the set-point handshake.

A rising edge of bit 4 of the control word gives a set-point. It starts at once if the drive is
idle or bit 5 (change immediately) is set, else after the active one; one set-point can wait. Bit
6 makes it relative to the last set-point. Bit 9 (change on set-point) is not supported: each
set-point ends at rest.
"""

from __future__ import annotations

from rig.drives.cia402.axis import DriveAxis
from rig.drives.cia402.modes.cyclic import TARGET_POSITION
from rig.drives.cia402.modes.mode import CONTROL_WORD
from rig.drives.cia402.ramp import RampMotion, plan_move, plan_stop
from rig.drives.cia402.signals import NS_PER_MS, NS_PER_S, DemandKind, DriveDemand
from rig.drives.cia402.state_machine import ControlBit, StatusBit

HALT_OPTION = 0x605D
POSITION_WINDOW = 0x6067
POSITION_WINDOW_TIME = 0x6068  # [ms]
PROFILE_VELOCITY = 0x6081
PROFILE_ACCELERATION = 0x6083
PROFILE_DECELERATION = 0x6084
QUICK_STOP_DECELERATION = 0x6085

WINDOW_OFF = 0xFFFF_FFFF
_HALT_WITH_QUICK_STOP = 2  # option code of 605D


class ProfilePosition:
    """Generator of trapezoidal moves to set-points."""

    controls_position = True
    obeys_switches = True

    def __init__(self, axis: DriveAxis) -> None:
        """Move an axis."""
        self._axis = axis
        self.reset()

    def reset(self) -> None:
        """Forget all set-points."""
        self._target = 0.0  # of the active set-point [increments]
        self._motion: RampMotion | None = None
        self._start_ns = 0  # of the motion
        self._waiting: float | None = None  # next set-point [increments]
        self._is_acknowledged = False  # until the master clears bit 4
        self._is_halted = False
        self._is_target_limited = False
        self._inside_since_ns: int | None = None  # actual position in the window

    def enter(self) -> None:
        """Start without set-point; a moving axis stops with the profile deceleration."""
        self.reset()
        axis = self._axis
        deceleration = axis.acceleration_of(PROFILE_DECELERATION)
        self._start(plan_stop(axis.position, axis.velocity, deceleration))

    def on_control_word(self, word: int, previous: int) -> None:
        """Take a set-point at a rising edge of bit 4."""
        if not word & ControlBit.START:
            self._is_acknowledged = False
        elif not previous & ControlBit.START and self._waiting is None:
            self._accept(word)

    def on_sync(self, t_ns: int) -> None:
        """No object of its own."""

    def step(self) -> DriveDemand:
        """Demand the position of the profile."""
        self._apply_halt()
        axis = self._axis
        if self._is_target_limited:
            axis.is_limited = True
        if self._is_done() and self._waiting is not None and not self._is_halted:
            self._begin(self._waiting)
            self._waiting = None
        assert self._motion is not None
        point = self._motion.at(self._elapsed_s())
        axis.position = point.position
        axis.velocity = point.velocity
        self._watch_window()
        kind: DemandKind = "brake" if self._is_halted and self._is_done() else "position"
        return axis.demand(kind, point.acceleration)

    def status_bits(self) -> int:
        """Bit 10: target reached, or halted at rest. Bit 12: set-point acknowledged."""
        bits = 0
        if self._is_reached():
            bits |= StatusBit.TARGET_REACHED
        if self._is_acknowledged or self._waiting is not None:
            bits |= StatusBit.MODE_BIT_12
        return bits

    def _accept(self, word: int) -> None:
        axis = self._axis
        wanted = float(axis.dictionary.get(TARGET_POSITION))
        if word & ControlBit.RELATIVE:
            wanted += self._target
        target = axis.limit_position(wanted)
        self._is_target_limited = target != wanted
        self._is_acknowledged = True
        if self._is_halted:
            self._target = target  # starts when the halt ends
        elif word & ControlBit.CHANGE_IMMEDIATELY or self._is_done():
            self._begin(target)
        else:
            self._waiting = target

    def _begin(self, target: float) -> None:
        axis = self._axis
        limits = axis.profile_limits(PROFILE_VELOCITY, PROFILE_ACCELERATION, PROFILE_DECELERATION)
        self._start(plan_move(axis.position, axis.velocity, target, limits))
        self._target = target

    def _start(self, motion: RampMotion) -> None:
        self._motion = motion
        self._target = motion.target
        self._start_ns = self._axis.demand_t_ns
        self._inside_since_ns = None

    def _apply_halt(self) -> None:
        """Stop at the begin of a halt and continue to the target at its end."""
        axis = self._axis
        wants_halt = bool(axis.dictionary.get(CONTROL_WORD) & ControlBit.HALT)
        if wants_halt == self._is_halted:
            return
        self._is_halted = wants_halt
        if not wants_halt:
            self._begin(self._target)
            return
        target = self._target
        index = PROFILE_DECELERATION
        if axis.dictionary.get(HALT_OPTION) == _HALT_WITH_QUICK_STOP:
            index = QUICK_STOP_DECELERATION
        self._start(plan_stop(axis.position, axis.velocity, axis.acceleration_of(index)))
        self._target = target

    def _elapsed_s(self) -> float:
        return (self._axis.t_ns - self._start_ns) / NS_PER_S

    def _is_done(self) -> bool:
        return self._motion is None or self._elapsed_s() >= self._motion.duration_s

    def _watch_window(self) -> None:
        """Note since when the actual position is in the window around the target."""
        axis = self._axis
        window = axis.dictionary.get(POSITION_WINDOW)
        error = abs(axis.actual_position - self._target)
        is_inside = window == WINDOW_OFF or error <= window
        if not self._is_done() or not is_inside:
            self._inside_since_ns = None
        elif self._inside_since_ns is None:
            self._inside_since_ns = axis.t_ns

    def _is_reached(self) -> bool:
        if self._is_halted:
            return self._is_done()
        if self._inside_since_ns is None:
            return False
        inside_ns = self._axis.t_ns - self._inside_since_ns
        return inside_ns >= self._axis.dictionary.get(POSITION_WINDOW_TIME) * NS_PER_MS
