"""Drive state machine of CiA 402: states, transitions 0 to 16, status word, control word."""

from __future__ import annotations

from enum import Enum, IntEnum, IntFlag
from typing import NamedTuple


class DriveState(IntEnum):
    """States of the drive; the value is that of bits 0, 1, 2, 3, 5 and 6 of the status word."""

    NOT_READY_TO_SWITCH_ON = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION_ACTIVE = 0x0F
    FAULT = 0x08


class DriveEvent(Enum):
    """Command of the control word, or internal event, that may cause a transition."""

    POWER_ON = "power on or reset"
    INITIALISED = "initialised"
    SHUTDOWN = "shutdown"
    SWITCH_ON = "switch on"  # the same bits as disable operation
    ENABLE_OPERATION = "enable operation"
    DISABLE_VOLTAGE = "disable voltage"
    QUICK_STOP = "quick stop"
    FAULT_RESET = "fault reset"
    FAULT_DETECTED = "fault detected"
    REACTION_COMPLETED = "fault reaction completed"
    STOP_COMPLETED = "quick stop completed"


class Transition(NamedTuple):
    """Row of the transition table."""

    number: int  # of CiA 402
    source: DriveState | None  # None: before power on
    event: DriveEvent
    target: DriveState


_S = DriveState
_E = DriveEvent

TRANSITIONS = (
    Transition(0, None, _E.POWER_ON, _S.NOT_READY_TO_SWITCH_ON),
    Transition(1, _S.NOT_READY_TO_SWITCH_ON, _E.INITIALISED, _S.SWITCH_ON_DISABLED),
    Transition(2, _S.SWITCH_ON_DISABLED, _E.SHUTDOWN, _S.READY_TO_SWITCH_ON),
    Transition(3, _S.READY_TO_SWITCH_ON, _E.SWITCH_ON, _S.SWITCHED_ON),
    Transition(3, _S.READY_TO_SWITCH_ON, _E.ENABLE_OPERATION, _S.SWITCHED_ON),  # then 4
    Transition(4, _S.SWITCHED_ON, _E.ENABLE_OPERATION, _S.OPERATION_ENABLED),
    Transition(5, _S.OPERATION_ENABLED, _E.SWITCH_ON, _S.SWITCHED_ON),
    Transition(6, _S.SWITCHED_ON, _E.SHUTDOWN, _S.READY_TO_SWITCH_ON),
    Transition(7, _S.READY_TO_SWITCH_ON, _E.DISABLE_VOLTAGE, _S.SWITCH_ON_DISABLED),
    Transition(7, _S.READY_TO_SWITCH_ON, _E.QUICK_STOP, _S.SWITCH_ON_DISABLED),
    Transition(8, _S.OPERATION_ENABLED, _E.SHUTDOWN, _S.READY_TO_SWITCH_ON),
    Transition(9, _S.OPERATION_ENABLED, _E.DISABLE_VOLTAGE, _S.SWITCH_ON_DISABLED),
    Transition(10, _S.SWITCHED_ON, _E.DISABLE_VOLTAGE, _S.SWITCH_ON_DISABLED),
    Transition(10, _S.SWITCHED_ON, _E.QUICK_STOP, _S.SWITCH_ON_DISABLED),
    Transition(11, _S.OPERATION_ENABLED, _E.QUICK_STOP, _S.QUICK_STOP_ACTIVE),
    Transition(12, _S.QUICK_STOP_ACTIVE, _E.DISABLE_VOLTAGE, _S.SWITCH_ON_DISABLED),
    Transition(12, _S.QUICK_STOP_ACTIVE, _E.STOP_COMPLETED, _S.SWITCH_ON_DISABLED),
    Transition(13, _S.NOT_READY_TO_SWITCH_ON, _E.FAULT_DETECTED, _S.FAULT_REACTION_ACTIVE),
    Transition(13, _S.SWITCH_ON_DISABLED, _E.FAULT_DETECTED, _S.FAULT_REACTION_ACTIVE),
    Transition(13, _S.READY_TO_SWITCH_ON, _E.FAULT_DETECTED, _S.FAULT_REACTION_ACTIVE),
    Transition(13, _S.SWITCHED_ON, _E.FAULT_DETECTED, _S.FAULT_REACTION_ACTIVE),
    Transition(13, _S.OPERATION_ENABLED, _E.FAULT_DETECTED, _S.FAULT_REACTION_ACTIVE),
    Transition(13, _S.QUICK_STOP_ACTIVE, _E.FAULT_DETECTED, _S.FAULT_REACTION_ACTIVE),
    Transition(14, _S.FAULT_REACTION_ACTIVE, _E.REACTION_COMPLETED, _S.FAULT),
    Transition(15, _S.FAULT, _E.FAULT_RESET, _S.SWITCH_ON_DISABLED),
    Transition(16, _S.QUICK_STOP_ACTIVE, _E.ENABLE_OPERATION, _S.OPERATION_ENABLED),
)

_BY_SOURCE = {(row.source, row.event): row for row in TRANSITIONS}


def find_transition(source: DriveState | None, event: DriveEvent) -> Transition | None:
    """Find the transition of an event in a state; None if there is none."""
    return _BY_SOURCE.get((source, event))


class ControlBit(IntFlag):
    """Bits of the control word 6040."""

    SWITCH_ON = 1 << 0
    ENABLE_VOLTAGE = 1 << 1
    QUICK_STOP = 1 << 2  # 0 asks for a quick stop
    ENABLE_OPERATION = 1 << 3
    START = 1 << 4  # new set-point (profile position), start of homing
    CHANGE_IMMEDIATELY = 1 << 5
    RELATIVE = 1 << 6
    FAULT_RESET = 1 << 7
    HALT = 1 << 8


def decode_control_word(word: int, previous: int) -> DriveEvent | None:
    """Decode the command of a control word.

    Fault reset is a rising edge of bit 7 against the previous word. A word with bit 7 set holds no
    other command.
    """
    if word & ControlBit.FAULT_RESET:
        is_edge = not previous & ControlBit.FAULT_RESET
        return DriveEvent.FAULT_RESET if is_edge else None
    if not word & ControlBit.ENABLE_VOLTAGE:
        return DriveEvent.DISABLE_VOLTAGE
    if not word & ControlBit.QUICK_STOP:
        return DriveEvent.QUICK_STOP
    if not word & ControlBit.SWITCH_ON:
        return DriveEvent.SHUTDOWN
    if word & ControlBit.ENABLE_OPERATION:
        return DriveEvent.ENABLE_OPERATION
    return DriveEvent.SWITCH_ON


class StatusBit(IntFlag):
    """Bits of the status word 6041 beside those of the state."""

    VOLTAGE_ENABLED = 1 << 4
    REMOTE = 1 << 9  # the control word is obeyed
    TARGET_REACHED = 1 << 10
    LIMIT_ACTIVE = 1 << 11
    MODE_BIT_12 = 1 << 12  # acknowledge, homing attained, or command followed
    MODE_BIT_13 = 1 << 13  # following error or homing error


POWERED_STATES = frozenset(
    {
        DriveState.SWITCHED_ON,
        DriveState.OPERATION_ENABLED,
        DriveState.QUICK_STOP_ACTIVE,
        DriveState.FAULT_REACTION_ACTIVE,
    }
)
MOVING_STATES = frozenset(
    {
        DriveState.OPERATION_ENABLED,
        DriveState.QUICK_STOP_ACTIVE,
        DriveState.FAULT_REACTION_ACTIVE,
    }
)


def compose_status_word(state: DriveState, mode_bits: int = 0) -> int:
    """Compose the status word of a state with bits 10 to 13 as the mode of operation sets them."""
    word = int(state) | mode_bits
    if state in POWERED_STATES:
        word |= StatusBit.VOLTAGE_ENABLED
    if state is not DriveState.NOT_READY_TO_SWITCH_ON:
        word |= StatusBit.REMOTE
    return int(word)
