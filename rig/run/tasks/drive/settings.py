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


class DriveSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Node, its units, and the times of the cyclic exchange."""

    node_id: int = 1
    identity: Identity
    increments_per_m: float
    velocity_units_per_m_s: float
    acceleration_units_per_m_s2: float
    quick_stop_m_s2: float = 20.0
    lower_m: float = -0.25  # bounds of position that the drive keeps by itself
    upper_m: float = 0.25
    following_error_m: float = 0.005  # of the drive
    sync_ns: int = 5 * MS
    heartbeat_ns: int = 20 * MS  # of node and master

    @property
    def silent_ns(self) -> int:
        """Silence of the node after which the drive is taken for lost."""
        return 3 * self.heartbeat_ns

    @property
    def setpoint_stale_ns(self) -> int:
        """Longest time without a setpoint while the run goes on."""
        return 5 * self.heartbeat_ns
