"""Settings of the master of the field bus, from `[drive]` and the envelope of `[safety]`."""

from __future__ import annotations

from comms.channels import MS
from rig.drives.cia402.object_dictionary import ObjectDictionary
from rig.drives.cia402.signals import PERMILLE
from rig.errors import ConfigError
from rig.run.drive_section import AxisDriveSection, NodeSection
from rig.run.tasks.drive.settings import DriveSettings, Identity
from rig.run.tasks.safety import Envelope

IDENTITY = 0x1018
MAX_PERMILLE = 2**16 - 1


def drive_settings(drive: AxisDriveSection, envelope: Envelope) -> DriveSettings:
    """Compute the settings; the identity is that of the EDS file of the drive."""
    per_m = drive.increments_per_unit
    return DriveSettings(
        node_id=drive.node_id,
        identity=shipped_identity(drive.node_id),
        increments_per_unit=per_m,
        velocity_units_per_unit_s=per_m,
        acceleration_units_per_unit_s2=per_m,
        quick_stop=drive.quick_stop_m_s2,
        torque_limit_permille=torque_limit_permille(drive),
        sync_ns=drive.sync_ms * MS,
        heartbeat_ns=drive.heartbeat_ms * MS,
        lower=envelope.position_min_m,
        upper=envelope.position_max_m,
        following_error=drive.following_error_mm * 1e-3,
    )


def shipped_identity(node_id: int) -> Identity:
    """Read vendor, product and revision of the EDS file that ships."""
    eds = ObjectDictionary(node_id)
    return Identity(eds.get(IDENTITY, 1), eds.get(IDENTITY, 2), eds.get(IDENTITY, 3))


def torque_limit_permille(drive: NodeSection) -> int:
    """Compute the torque limit on the wire; raises ConfigError for one that object 6072 lacks."""
    permille = round(drive.torque_limit_n_m / drive.rated_torque_n_m * PERMILLE)
    if not 1 <= permille <= MAX_PERMILLE:
        raise ConfigError(
            f"torque_limit_n_m = {drive.torque_limit_n_m:g} with rated_torque_n_m = "
            f"{drive.rated_torque_n_m:g} of the drive; their ratio must be 0.001 to 65.5: "
            "correct one of the two"
        )
    return permille
