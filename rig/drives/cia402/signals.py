"""Measured and demanded motion that the node exchanges with the power stage, and its units.

User units: position in increments of the encoder, velocity in increments/s, acceleration in
increments/s^2, torque in permille of the rated torque. Objects of velocity and acceleration have
units of their own on the wire; DriveUnits relates all of them to rad or m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

from rig.drives.cia402.errors import Cia402Error

PERMILLE = 1000.0
NS_PER_S = 1e9
NS_PER_MS = 1_000_000
MAX_ERROR_CODE = 0xFFFF

DemandKind = Literal["position", "velocity", "torque", "off", "brake"]


class DriveFeedback(NamedTuple):
    """Measurement of one drive sample, in the frame of the encoder."""

    position: float  # [increments]
    velocity: float = 0.0  # [increments/s]
    torque: float = 0.0  # [permille of rated]
    negative_switch: bool = False  # end switch at the negative end is active
    positive_switch: bool = False
    drive_fault: int = 0  # error code of the power stage, e.g. 0x2310; 0 = none


def check_feedback(feedback: DriveFeedback) -> None:
    """Check that the measurement is finite and the fault has 16 bits; raises Cia402Error."""
    for name in ("position", "velocity", "torque"):
        value = getattr(feedback, name)
        if not math.isfinite(value):
            raise Cia402Error(
                f"{name} = {value} in the feedback; must be finite: "
                "report a failed sensor with drive_fault = 0x7300"
            )
    if not 0 <= feedback.drive_fault <= MAX_ERROR_CODE:
        raise Cia402Error(
            f"drive_fault = {feedback.drive_fault} in the feedback; must be 0 to "
            f"{MAX_ERROR_CODE}: give an error code of CiA 402, e.g. 0x2310"
        )


class DriveDemand(NamedTuple):
    """Demand to hold until the next drive sample, in the frame of the encoder.

    position: control the position, with velocity, acceleration and torque as feed-forward.
    velocity: control the velocity, with acceleration and torque as feed-forward.
    torque: apply the torque.
    brake: at rest; hold the position, by control or with a holding brake.
    off: power stage off, the motor is free unless a holding brake is closed.
    """

    kind: DemandKind
    position: float = 0.0  # [increments]
    velocity: float = 0.0  # [increments/s]
    acceleration: float = 0.0  # [increments/s^2]
    torque: float = 0.0  # [permille of rated]
    torque_limit: float = math.inf  # [permille of rated], of the controller of the drive
    speed_limit: float = math.inf  # [increments/s]


@dataclass(frozen=True, kw_only=True)
class DriveUnits:
    """Factors between the wire and rad or m; raises Cia402Error unless all are > 0 and finite.

    Velocity and acceleration on the wire are in increments/s and increments/s^2 by default.
    """

    increments_per_unit: float = 1.0  # per rad or m, of the position objects
    velocity_units_per_unit_s: float | None = None  # per rad/s or m/s, of the velocity objects
    acceleration_units_per_unit_s2: float | None = None  # per rad/s^2 or m/s^2
    rated_torque: float = 1.0  # [N m] or [N]; object 6076 holds it in thousandths

    def __post_init__(self) -> None:
        for name in (
            "increments_per_unit",
            "velocity_units_per_unit_s",
            "acceleration_units_per_unit_s2",
            "rated_torque",
        ):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise Cia402Error(
                    f"{name} = {value}; must be > 0 and finite: "
                    "take it from the data sheets of encoder and motor"
                )

    @property
    def velocity_per_wire_unit(self) -> float:
        """Velocity of one unit of the velocity objects [increments/s]."""
        if self.velocity_units_per_unit_s is None:
            return 1.0
        return self.increments_per_unit / self.velocity_units_per_unit_s

    @property
    def acceleration_per_wire_unit(self) -> float:
        """Acceleration of one unit of the acceleration objects [increments/s^2]."""
        if self.acceleration_units_per_unit_s2 is None:
            return 1.0
        return self.increments_per_unit / self.acceleration_units_per_unit_s2

    def to_increments(self, position: float) -> float:
        """Convert rad or m, or their rates, to increments, or their rates."""
        return position * self.increments_per_unit

    def from_increments(self, increments: float) -> float:
        """Convert increments, or their rates, to rad or m, or their rates."""
        return increments / self.increments_per_unit

    def to_permille(self, torque: float) -> float:
        """Convert a torque [N m] or force [N] to permille of the rated one."""
        return torque / self.rated_torque * PERMILLE

    def from_permille(self, torque: float) -> float:
        """Convert permille of the rated torque to a torque [N m] or force [N]."""
        return torque / PERMILLE * self.rated_torque
