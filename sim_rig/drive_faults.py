"""Faults of the drive on the field bus, counted from the first motion of the table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

MOVING = 1e-3  # speed of the load [m/s or rad/s]
POWER_STAGE_CODE = 0x2310  # continuous over-current (CiA 402)


class DriveFault(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Fault of `[[bench.drive_faults]]`.

    node_reset: the node restarts. drive_fault: the power stage reports over-current. encoder_step:
    the encoder reads step_m of travel, or step_rad of the motor, more from then on. silent: the
    node sends nothing for duration_s.
    """

    kind: Literal["node_reset", "drive_fault", "encoder_step", "silent"]
    after_motion_s: Annotated[float, Meta(ge=0.0, le=3600.0)]
    step_m: Annotated[float, Meta(ge=-1.0, le=1.0)] = 0.0
    step_rad: Annotated[float, Meta(ge=-1e4, le=1e4)] = 0.0
    duration_s: Annotated[float, Meta(ge=0.0, le=3600.0)] = 1.0


class FaultSchedule:
    """Faults that are still to come, and those that last."""

    def __init__(self, faults: Sequence[DriveFault]) -> None:
        self._coming = sorted(faults, key=lambda fault: fault.after_motion_s)
        self._moved_ns: int | None = None
        self._silent_until_ns = -1
        self.step_m = 0.0
        self.step_rad = 0.0

    def is_silent(self, t_ns: int) -> bool:
        """Tell if the node sends nothing."""
        return t_ns < self._silent_until_ns

    def due(self, t_ns: int, speed: float) -> list[DriveFault]:
        """Return the faults that begin at t_ns."""
        if self._moved_ns is None:
            if not self._coming or abs(speed) < MOVING:
                return []
            self._moved_ns = t_ns
        begun = []
        while self._coming and self._coming[0].after_motion_s * 1e9 <= t_ns - self._moved_ns:
            fault = self._coming.pop(0)
            if fault.kind == "silent":
                self._silent_until_ns = t_ns + round(fault.duration_s * 1e9)
            elif fault.kind == "encoder_step":
                self.step_m += fault.step_m
                self.step_rad += fault.step_rad
            begun.append(fault)
        return begun
