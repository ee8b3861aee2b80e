"""Configuration of a PDO: COB-ID, transmission type and mapping, with the checks of CiA 301.

A mapping is changed in this order: set bit 31 of the COB-ID, write 0 to the count, write the
entries, write the count, clear bit 31.
"""

from __future__ import annotations

from typing import NamedTuple

from rig.drives.cia402.eds import INTEGER_TYPES
from rig.drives.cia402.errors import AbortCode, SdoAbort
from rig.drives.cia402.frames import (
    CAN_ID_MASK,
    EXTENDED_FRAME,
    MAX_FRAME_BYTES,
    NO_REMOTE_REQUEST,
    NOT_VALID,
    is_restricted,
)
from rig.drives.cia402.object_dictionary import ObjectDictionary

MAX_PDO_BITS = 8 * MAX_FRAME_BYTES
ENTRY_COUNT = 8
LAST_SYNC_TYPE = 240
EVENT_TYPES = (254, 255)  # manufacturer specific, profile specific

COB_ID = 1  # sub-indices of the communication record
TRANSMISSION_TYPE = 2
INHIBIT_TIME = 3  # [100 us]
EVENT_TIMER = 5  # [ms]

DUMMY_BITS = {index: 8 * integer.length for index, integer in INTEGER_TYPES.items()}


class PdoRecords(NamedTuple):
    """Indices of the two records of a PDO."""

    communication: int
    mapping: int
    is_receive: bool


class MappedObject(NamedTuple):
    """Object in a PDO."""

    object_index: int
    subindex: int
    length: int  # bytes
    is_dummy: bool  # bytes without meaning


class PdoParameters:
    """Parameters of one PDO, read from the dictionary; guards every write to them."""

    def __init__(self, dictionary: ObjectDictionary, records: PdoRecords) -> None:
        """Register the checks of both records."""
        self.dictionary = dictionary
        self.records = records
        self._mapping: tuple[MappedObject, ...] | None = None
        dictionary.add_check(records.communication, self._check_communication)
        dictionary.add_check(records.mapping, self._check_mapping)
        dictionary.add_action(records.mapping, self._forget_mapping)

    def reset(self) -> None:
        """Read the mapping anew after the dictionary was reset."""
        self._mapping = None

    @property
    def is_valid(self) -> bool:
        """True unless bit 31 of the COB-ID is set."""
        return not self._cob_id() & NOT_VALID

    @property
    def allows_remote_request(self) -> bool:
        """True unless bit 30 of the COB-ID is set."""
        return not self._cob_id() & NO_REMOTE_REQUEST

    @property
    def can_id(self) -> int:
        """CAN-ID of the PDO."""
        return self._cob_id() & CAN_ID_MASK

    @property
    def transmission_type(self) -> int:
        """Transmission type: 0 to 240 synchronous, 254 and 255 event."""
        return self.dictionary.get(self.records.communication, TRANSMISSION_TYPE)

    @property
    def is_synchronous(self) -> bool:
        """True if the PDO is tied to the SYNC."""
        return self.transmission_type <= LAST_SYNC_TYPE

    @property
    def mapping(self) -> tuple[MappedObject, ...]:
        """Mapped objects in the order of the bytes."""
        if self._mapping is None:
            count = self.dictionary.get(self.records.mapping)
            fields = [
                self.dictionary.get(self.records.mapping, subindex)
                for subindex in range(1, count + 1)
            ]
            self._mapping = tuple(_mapped_object(field) for field in fields)
        return self._mapping

    @property
    def length(self) -> int:
        """Length of the PDO [bytes]."""
        return sum(mapped.length for mapped in self.mapping)

    def _cob_id(self) -> int:
        return self.dictionary.get(self.records.communication, COB_ID)

    def _forget_mapping(self, subindex: int, value: int) -> None:
        self._mapping = None

    def _check_communication(self, subindex: int, value: int) -> None:
        if subindex == COB_ID:
            self._check_cob_id(value)
        elif subindex == TRANSMISSION_TYPE:
            if LAST_SYNC_TYPE < value < EVENT_TYPES[0]:
                detail = f"{value}, must be 0 to {LAST_SYNC_TYPE}, 254 or 255"
                raise self._abort(AbortCode.INVALID_VALUE, subindex, detail)
        elif subindex == INHIBIT_TIME:
            self._check_disabled(self.records.communication, subindex)

    def _check_cob_id(self, value: int) -> None:
        """Check the frame format, the CAN-ID, and that a valid PDO keeps its CAN-ID."""
        if value & EXTENDED_FRAME:
            detail = f"0x{value:08X}, bit 29 must be 0: use an 11-bit CAN-ID"
            raise self._abort(AbortCode.INVALID_VALUE, COB_ID, detail)
        if value & NOT_VALID:
            return
        can_id = value & CAN_ID_MASK
        if is_restricted(can_id):
            detail = f"CAN-ID 0x{can_id:03X} is reserved: use one of 0x181 to 0x57F"
            raise self._abort(AbortCode.INVALID_VALUE, COB_ID, detail)
        if can_id != self.can_id:
            self._check_disabled(self.records.communication, COB_ID)

    def _check_mapping(self, subindex: int, value: int) -> None:
        self._check_disabled(self.records.mapping, subindex)
        if subindex == 0:
            self._check_count(value)
            return
        if self.dictionary.get(self.records.mapping) != 0:
            detail = "the mapping is active: write 0 to sub-index 0 first"
            raise SdoAbort(AbortCode.DEVICE_STATE, self.records.mapping, subindex, detail)
        self._check_field(subindex, value)

    def _check_disabled(self, index: int, subindex: int) -> None:
        if self.is_valid:
            detail = "the PDO is valid: set bit 31 of its COB-ID first"
            raise SdoAbort(AbortCode.DEVICE_STATE, index, subindex, detail)

    def _check_count(self, count: int) -> None:
        """Check that the first entries exist and fit into one frame."""
        bits = 0
        for subindex in range(1, count + 1):
            field = self.dictionary.get(self.records.mapping, subindex)
            if field == 0:
                detail = f"entry {subindex} of {count} is empty: write all entries first"
                raise SdoAbort(AbortCode.NO_OBJECT, self.records.mapping, 0, detail)
            bits += field & 0xFF
        if bits > MAX_PDO_BITS:
            detail = f"{bits} bits, must be <= {MAX_PDO_BITS}: map fewer objects"
            raise SdoAbort(AbortCode.PDO_TOO_LONG, self.records.mapping, 0, detail)

    def _check_field(self, subindex: int, field: int) -> None:
        """Check that a mapping entry names an object that fits into this PDO."""
        if field == 0:
            return
        mapped_index = field >> 16
        mapped_subindex = field >> 8 & 0xFF
        bits = field & 0xFF
        if self.records.is_receive and DUMMY_BITS.get(mapped_index) == bits:
            return
        entry = self.dictionary.entry(mapped_index, mapped_subindex)
        has_right = entry.is_writable if self.records.is_receive else entry.is_readable
        length = entry.length
        if entry.is_mappable and has_right and length is not None and bits == 8 * length:
            return
        detail = f"0x{field:08X}: see PDOMapping, AccessType and DataType in the EDS file"
        raise SdoAbort(AbortCode.NOT_MAPPABLE, self.records.mapping, subindex, detail)

    def _abort(self, code: AbortCode, subindex: int, detail: str) -> SdoAbort:
        return SdoAbort(code, self.records.communication, subindex, detail)


def _mapped_object(field: int) -> MappedObject:
    index = field >> 16
    return MappedObject(
        object_index=index,
        subindex=field >> 8 & 0xFF,
        length=(field & 0xFF) // 8,
        is_dummy=index in DUMMY_BITS,
    )
