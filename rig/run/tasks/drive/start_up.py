"""Configuration of a drive before it moves: identity, PDOs, heartbeats, mode and quick stop."""

from __future__ import annotations

from comms.channels import MS
from rig.run.tasks.drive.sdo_client import Access
from rig.run.tasks.drive.settings import DriveSettings

MASTER_ID = 127  # node-ID of the heartbeat of the master
RPDO, TPDO_MOTION, TPDO_STATUS = 0x200, 0x180, 0x280  # COB-IDs, plus the node-ID
LOST_AFTER = 2  # periods of the heartbeat
NOT_VALID = 1 << 31
EVERY_SYNC = 1  # transmission type
CYCLIC_SYNCHRONOUS_POSITION = 8
RAMP_TO_DISABLED = 2  # quick stop option: the ramp of 6085, then switch on disabled
# entries of a mapping: index, subindex, length in bits
CONTROL_WORD = 0x6040_0010
TARGET_POSITION = 0x607A_0020
STATUS_WORD = 0x6041_0010
TORQUE = 0x6077_0010
POSITION = 0x6064_0020
VELOCITY = 0x606C_0020
TORQUE_OFFSET = 0x60B2_0010
LOAD_ACCELERATION = 0x2000_0020


def accesses(s: DriveSettings) -> list[Access]:
    """List the reads and writes of the configuration, in their order."""
    heartbeat_ms = s.heartbeat_ns // MS
    sync_ms = s.sync_ns // MS
    quick_stop = round(s.quick_stop * s.acceleration_units_per_unit_s2)
    target = [CONTROL_WORD, TARGET_POSITION]
    if s.program:
        target.append(TORQUE_OFFSET)
    status = [STATUS_WORD, TORQUE]
    if s.has_accelerometer:
        status.append(LOAD_ACCELERATION)
    return [
        Access(0x1018, 1, 4, s.identity.vendor, is_read=True),
        Access(0x1018, 2, 4, s.identity.product, is_read=True),
        Access(0x1018, 3, 4, s.identity.revision, is_read=True),
        Access(0x1016, 1, 4, MASTER_ID << 16 | LOST_AFTER * heartbeat_ms),
        Access(0x1017, 0, 2, heartbeat_ms),
        *_pdo(0x1400, RPDO + s.node_id, target),
        *_pdo(0x1800, TPDO_MOTION + s.node_id, [POSITION, VELOCITY]),
        *_pdo(0x1801, TPDO_STATUS + s.node_id, status),
        Access(0x1802, 1, 4, NOT_VALID | 0x380 + s.node_id),
        Access(0x1803, 1, 4, NOT_VALID | 0x480 + s.node_id),
        Access(0x6060, 0, 1, CYCLIC_SYNCHRONOUS_POSITION),
        Access(0x60C2, 1, 1, sync_ms),
        Access(0x60C2, 2, 1, -3),  # times 10^-3 s
        Access(0x6085, 0, 4, quick_stop),
        Access(0x605A, 0, 2, RAMP_TO_DISABLED),
        Access(0x6072, 0, 2, s.torque_limit_permille, is_optional=True),
        Access(0x607D, 1, 4, round(s.lower * s.increments_per_unit)),
        Access(0x607D, 2, 4, round(s.upper * s.increments_per_unit)),
        Access(0x6065, 0, 4, round(s.following_error * s.increments_per_unit)),
    ]


def _pdo(parameter: int, cob_id: int, objects: list[int]) -> list[Access]:
    """Configure a PDO as CiA 301 orders it: switch off, map, switch on; each object is mapped."""
    mapping = parameter + 0x200
    entries = [Access(mapping, k, 4, mapped) for k, mapped in enumerate(objects, start=1)]
    return [
        Access(parameter, 1, 4, NOT_VALID | cob_id),
        Access(parameter, 2, 1, EVERY_SYNC),
        Access(mapping, 0, 1, 0),
        *entries,
        Access(mapping, 0, 1, len(entries)),
        Access(parameter, 1, 4, cob_id),
    ]
