"""Emergency messages, error register 1001 and error history 1003 (CiA 301)."""

from __future__ import annotations

import struct
from enum import IntEnum

from rig.drives.cia402.errors import AbortCode, SdoAbort
from rig.drives.cia402.frames import CAN_ID_MASK, NOT_VALID, CanFrame
from rig.drives.cia402.object_dictionary import ObjectDictionary

ERROR_REGISTER = 0x1001
ERROR_HISTORY = 0x1003
EMERGENCY_COB_ID = 0x1014
HISTORY_LENGTH = 8

_MESSAGE = struct.Struct("<HBHxxx")  # error code, error register, additional information

GENERIC_ERROR = 1 << 0
CURRENT_ERROR = 1 << 1
VOLTAGE_ERROR = 1 << 2
TEMPERATURE_ERROR = 1 << 3
COMMUNICATION_ERROR = 1 << 4
PROFILE_ERROR = 1 << 5  # specific to the device profile
MANUFACTURER_ERROR = 1 << 7


class ErrorCode(IntEnum):
    """Emergency error codes that the node itself produces (CiA 301 and CiA 402)."""

    NO_ERROR = 0x0000
    HEARTBEAT_LOST = 0x8130
    PROTOCOL_ERROR = 0x8200  # RPDO with a value beyond its limits
    PDO_TOO_SHORT = 0x8210
    FOLLOWING_ERROR = 0x8611
    REFERENCE_LIMIT = 0x8612  # end switch or software position limit


def register_bits(code: int) -> int:
    """Bits of the error register 1001 for an error code; 0 for code 0."""
    if code == ErrorCode.NO_ERROR:
        return 0
    if code >= 0xFF00:
        return GENERIC_ERROR | MANUFACTURER_ERROR
    if 0x8100 <= code <= 0x82FF:
        return GENERIC_ERROR | COMMUNICATION_ERROR
    if code >> 12 in (0x7, 0x8):
        return GENERIC_ERROR | PROFILE_ERROR
    classes = {0x2: CURRENT_ERROR, 0x3: VOLTAGE_ERROR, 0x4: TEMPERATURE_ERROR}
    return GENERIC_ERROR | classes.get(code >> 12, 0)


class EmergencyProducer:
    """Set of the active errors, and the messages about their begin and end."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        """Report into the objects 1001 and 1003 of a dictionary."""
        self._dictionary = dictionary
        self._active: set[tuple[int, int]] = set()  # (code, info)
        self._messages: list[CanFrame] = []
        dictionary.add_check(ERROR_HISTORY, _check_history_write)
        dictionary.add_action(ERROR_HISTORY, self._clear_history)
        dictionary.add_read_check(ERROR_HISTORY, self._check_history_read)

    def report(self, code: int, info: int = 0) -> None:
        """Report an error with 16 bits of additional information.

        An error that is active already is not reported again.
        """
        if (code, info) in self._active:
            return
        self._active.add((code, info))
        self.update_register()
        self._store(code | info << 16)
        self._send(code, info)

    def clear(self, code: int, info: int = 0) -> None:
        """Report the end of an error; no effect if it is not active."""
        if (code, info) not in self._active:
            return
        self._active.remove((code, info))
        self.update_register()
        self._send(ErrorCode.NO_ERROR, 0)

    def reset(self) -> None:
        """Drop active errors and pending messages without a message."""
        self._active.clear()
        self._messages.clear()
        self.update_register()

    def take_messages(self) -> list[CanFrame]:
        """Remove and return the messages that wait to be sent."""
        messages = self._messages
        self._messages = []
        return messages

    def _send(self, code: int, info: int) -> None:
        cob_id = self._dictionary.get(EMERGENCY_COB_ID)
        if cob_id & NOT_VALID:
            return
        register = self._dictionary.get(ERROR_REGISTER)
        data = _MESSAGE.pack(code, register, info)
        self._messages.append(CanFrame(cob_id & CAN_ID_MASK, data))

    def update_register(self) -> None:
        """Write the bits of the active errors into the object 1001."""
        register = 0
        for code, _ in self._active:
            register |= register_bits(code)
        self._dictionary.set(ERROR_REGISTER, register)

    def _store(self, field: int) -> None:
        """Insert an error field at sub-index 1; the oldest one is dropped."""
        count = self._dictionary.get(ERROR_HISTORY)
        count = min(count + 1, HISTORY_LENGTH)
        for subindex in range(count, 1, -1):
            older = self._dictionary.get(ERROR_HISTORY, subindex - 1)
            self._dictionary.set(ERROR_HISTORY, older, subindex)
        self._dictionary.set(ERROR_HISTORY, field, 1)
        self._dictionary.set(ERROR_HISTORY, count)

    def _clear_history(self, subindex: int, value: int) -> None:
        """Empty the history after a 0 was written to its sub-index 0."""
        for field in range(1, HISTORY_LENGTH + 1):
            self._dictionary.set(ERROR_HISTORY, 0, field)

    def _check_history_read(self, subindex: int) -> None:
        if subindex > self._dictionary.get(ERROR_HISTORY):
            raise SdoAbort(AbortCode.NO_DATA, ERROR_HISTORY, subindex)


def _check_history_write(subindex: int, value: int) -> None:
    if value != 0:
        detail = f"{value}, must be 0: write 0 to clear the history"
        raise SdoAbort(AbortCode.INVALID_VALUE, ERROR_HISTORY, subindex, detail)
