"""Errors of rig/drives/cia402/: what, value, bound and next step."""

from __future__ import annotations

from enum import IntEnum


class Cia402Error(Exception):
    """Root of all errors of rig/drives/cia402/.

    E.g. `node_id = 200; must be 1 to 127: set the address of the drive`.
    """


class AbortCode(IntEnum):
    """Abort codes of the SDO protocol (CiA 301, SDO abort transfer)."""

    TOGGLE_NOT_ALTERNATED = 0x05030000
    TIMED_OUT = 0x05040000
    UNKNOWN_COMMAND = 0x05040001
    READ_OF_WRITE_ONLY = 0x06010001
    WRITE_OF_READ_ONLY = 0x06010002
    NO_OBJECT = 0x06020000
    NOT_MAPPABLE = 0x06040041
    PDO_TOO_LONG = 0x06040042
    LENGTH_MISMATCH = 0x06070010
    LENGTH_TOO_HIGH = 0x06070012
    LENGTH_TOO_LOW = 0x06070013
    NO_SUBINDEX = 0x06090011
    INVALID_VALUE = 0x06090030
    VALUE_TOO_HIGH = 0x06090031
    VALUE_TOO_LOW = 0x06090032
    DEVICE_STATE = 0x08000022
    NO_DATA = 0x08000024


class SdoAbort(Cia402Error):
    """Refused access to an object, with the abort code that goes to the SDO client."""

    def __init__(self, code: AbortCode, index: int, subindex: int = 0, detail: str = "") -> None:
        """Keep the code and the address; detail states value, bound and next step."""
        words = code.name.lower().replace("_", " ")
        text = f"object {index:04X}:{subindex:02X}: {words} (abort code 0x{code:08X})"
        super().__init__(f"{text}; {detail}" if detail else text)
        self.code = code
        self.index = index
        self.subindex = subindex
