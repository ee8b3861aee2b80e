"""CAN frames and the COB-IDs of the predefined connection set (CiA 301)."""

from __future__ import annotations

from typing import NamedTuple

MAX_FRAME_BYTES = 8
NMT_COMMAND = 0x000
SYNC = 0x080
EMERGENCY = 0x080  # + node-ID, as all below
TPDO = (0x180, 0x280, 0x380, 0x480)
RPDO = (0x200, 0x300, 0x400, 0x500)
SDO_RESPONSE = 0x580  # server to client
SDO_REQUEST = 0x600  # client to server
HEARTBEAT = 0x700  # also the boot-up message

MIN_NODE_ID = 1
MAX_NODE_ID = 127
CAN_ID_MASK = 0x7FF  # base frame format, 11 bits
EXTENDED_FRAME = 1 << 29  # bit of a COB-ID entry
NO_REMOTE_REQUEST = 1 << 30  # bit of a COB-ID entry of a TPDO
NOT_VALID = 1 << 31  # bit of a COB-ID entry

_RESTRICTED = (
    (0x000, 0x07F),  # NMT, global fail-safe
    (0x101, 0x180),
    (0x581, 0x5FF),  # default SDO
    (0x601, 0x67F),  # default SDO
    (0x6E0, 0x6FF),
    (0x701, 0x7FF),  # NMT error control
)


class CanFrame(NamedTuple):
    """CAN data frame, or remote frame, in base frame format."""

    can_id: int  # 0 to 0x7FF
    data: bytes = b""  # 0 to 8 bytes
    is_remote: bool = False


def is_restricted(can_id: int) -> bool:
    """Tell if CiA 301 forbids the CAN-ID (0 to 0x7FF) for configurable services."""
    return any(low <= can_id <= high for low, high in _RESTRICTED)
