"""Settings of the master of the field bus, from `[drive]` and the envelope of `[safety]`."""

from __future__ import annotations

from comms.channels import MS
from rig.drives.cia402.object_dictionary import ObjectDictionary
from rig.run.drive_section import AxisDriveSection
from rig.run.tasks.drive.settings import DriveSettings, Identity
from rig.run.tasks.safety import Envelope

IDENTITY = 0x1018


def drive_settings(drive: AxisDriveSection, envelope: Envelope) -> DriveSettings:
    """Compute the settings; the identity is that of the EDS file of the drive."""
    eds = ObjectDictionary(drive.node_id)
    per_m = drive.increments_per_m
    return DriveSettings(
        node_id=drive.node_id,
        identity=Identity(eds.get(IDENTITY, 1), eds.get(IDENTITY, 2), eds.get(IDENTITY, 3)),
        increments_per_m=per_m,
        velocity_units_per_m_s=per_m,
        acceleration_units_per_m_s2=per_m,
        quick_stop_m_s2=drive.quick_stop_m_s2,
        sync_ns=drive.sync_ms * MS,
        heartbeat_ns=drive.heartbeat_ms * MS,
        lower_m=envelope.position_min_m,
        upper_m=envelope.position_max_m,
        following_error_m=drive.following_error_mm * 1e-3,
    )
