"""States of a drive, and the control word that leads from each towards operation (CiA 402)."""

from __future__ import annotations

import enum

STATE_MASK = 0x6F
FAULT_RESET = 0x80
SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, QUICK_STOP = 0x06, 0x07, 0x0F, 0x02
WARNING_BITS = 0x4F  # states without the quick stop bit


# error codes of CiA 402 that a drive of a rig reports
ERROR_NAMES = {
    0x2310: " (continuous over-current)",
    0x8130: " (heartbeat of the master lost)",
    0x8611: " (following error)",
    0x8612: " (limit of position or end switch)",
}


class NodeState(enum.Enum):
    """State in the status word."""

    NOT_READY = "not ready to switch on"
    DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"


_BY_BITS = {
    0x21: NodeState.READY,
    0x23: NodeState.SWITCHED_ON,
    0x27: NodeState.ENABLED,
    0x07: NodeState.QUICK_STOP,
}
_BY_BITS_WITHOUT_QUICK_STOP = {
    0x00: NodeState.NOT_READY,
    0x40: NodeState.DISABLED,
    0x0F: NodeState.FAULT_REACTION,
    0x08: NodeState.FAULT,
}
_TOWARDS_OPERATION = {
    NodeState.DISABLED: SHUTDOWN,
    NodeState.READY: SWITCH_ON,
    NodeState.SWITCHED_ON: ENABLE_OPERATION,
    NodeState.ENABLED: ENABLE_OPERATION,
}


def state_of(status_word: int) -> NodeState:
    """Read the state from a status word."""
    state = _BY_BITS.get(status_word & STATE_MASK)
    if state is not None:
        return state
    return _BY_BITS_WITHOUT_QUICK_STOP.get(status_word & WARNING_BITS, NodeState.NOT_READY)


def towards(state: NodeState, is_enabling: bool) -> int:
    """Return the control word of the next step: to operation, or else to `ready to switch on`."""
    if not is_enabling:
        return SHUTDOWN
    return _TOWARDS_OPERATION.get(state, SHUTDOWN)
