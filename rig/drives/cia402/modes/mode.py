"""Interface of a mode of operation, and the mode without motion."""

from __future__ import annotations

from typing import Protocol

from rig.drives.cia402.axis import DriveAxis
from rig.drives.cia402.modes.stop import StopRamp
from rig.drives.cia402.signals import DriveDemand

CONTROL_WORD = 0x6040
PROFILE_DECELERATION = 0x6084


class OperatingMode(Protocol):
    """Generator of the demand in the state OPERATION ENABLED."""

    @property
    def controls_position(self) -> bool:
        """True if the demand is a position, so that a following error is defined."""
        ...

    @property
    def obeys_switches(self) -> bool:
        """True if motion into an active end switch is a fault."""
        ...

    def reset(self) -> None:
        """Return to the state after power on."""
        ...

    def enter(self) -> None:
        """Start from the demand of the axis: its position, velocity and time."""
        ...

    def on_control_word(self, word: int, previous: int) -> None:
        """Take a control word in the state OPERATION ENABLED, with the one before it."""
        ...

    def on_sync(self, t_ns: int) -> None:
        """Take the objects that became valid with a SYNC at t_ns [ns]."""
        ...

    def step(self) -> DriveDemand:
        """Compute the demand of the sample that the axis has measured."""
        ...

    def status_bits(self) -> int:
        """Bits 10, 12 and 13 of the status word."""
        ...


class NoMode:
    """Mode 0: the axis rests where it is."""

    controls_position = True
    obeys_switches = False

    def __init__(self, axis: DriveAxis) -> None:
        """Hold an axis at rest."""
        self._axis = axis
        self._stop: StopRamp | None = None

    def reset(self) -> None:
        """Forget the stop."""
        self._stop = None

    def enter(self) -> None:
        """Stop a moving axis with the profile deceleration 6084."""
        deceleration = self._axis.acceleration_of(PROFILE_DECELERATION)
        self._stop = StopRamp(self._axis, deceleration, controls_position=True)

    def on_control_word(self, word: int, previous: int) -> None:
        """No command of its own."""

    def on_sync(self, t_ns: int) -> None:
        """No object of its own."""

    def step(self) -> DriveDemand:
        """Demand the stop, then hold the position."""
        return self._stop.step() if self._stop else self._axis.demand("brake")

    def status_bits(self) -> int:
        """No bits of its own."""
        return 0
