"""Settings of the master of the field bus."""

from __future__ import annotations

from typing import NamedTuple

import msgspec

from comms.channels import MS


class Identity(NamedTuple):
    """Object 1018 of a node, as its EDS file names it."""

    vendor: int
    product: int
    revision: int


class ProgramStep(NamedTuple):
    """Target of a SYNC in the mode cyclic synchronous position."""

    position: int  # [increments]
    torque: int  # offset, of the acceleration asked [permille of the rated torque]


class DriveSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Node, its units, and the times of the cyclic exchange.

    The unit of position is m along X, or rad of the motor of a joint.
    """

    node_id: int = 1
    identity: Identity
    increments_per_unit: float
    velocity_units_per_unit_s: float
    acceleration_units_per_unit_s2: float
    quick_stop: float = 20.0  # deceleration [unit/s^2]
    lower: float = -0.25  # bounds of position that the drive keeps by itself
    upper: float = 0.25
    following_error: float = 0.005  # of the drive
    torque_limit_permille: int = 1000  # of the rated torque
    sync_ns: int = 5 * MS
    heartbeat_ns: int = 20 * MS  # of node and master
    # targets from the start on, one a SYNC; without a program, setpoints of the controller
    program: list[ProgramStep] = []
    has_accelerometer: bool = False  # the node sends the acceleration of the load

    @property
    def silent_ns(self) -> int:
        """Silence of the node after which the drive is taken for lost."""
        return 3 * self.heartbeat_ns

    @property
    def setpoint_stale_ns(self) -> int:
        """Longest time without a setpoint while the run goes on."""
        return 5 * self.heartbeat_ns
