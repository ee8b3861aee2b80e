"""Object dictionary of the drive: typed values with access rights and limits, from the EDS file.

Integers of objects are in the units of the wire: increments, units of velocity and acceleration as
DriveUnits defines them, permille of the rated torque.
"""

from __future__ import annotations

from collections.abc import Callable

from rig.drives.cia402.eds import INTEGER_TYPES, ObjectEntry, Value, parse_eds
from rig.drives.cia402.errors import AbortCode, Cia402Error, SdoAbort
from rig.drives.cia402.frames import MAX_NODE_ID, MIN_NODE_ID

MAX_STRING_BYTES = 255
COMMUNICATION_AREA = (0x1000, 0x1FFF)
WHOLE_DICTIONARY = (0x0001, 0xFFFF)

Check = Callable[[int, int], None]  # (subindex, value); raises SdoAbort
Action = Callable[[int, int], None]  # (subindex, value), after the write
ReadCheck = Callable[[int], None]  # (subindex); raises SdoAbort


class ObjectDictionary:
    """Values of all objects of one node.

    `read` and `write` serve the bus: bytes, with access rights, limits and checks; they raise
    SdoAbort. `get` and `set` serve the device itself: integers, without access rights.
    """

    def __init__(self, node_id: int) -> None:
        """Load the defaults for a node-ID of 1 to 127; raises Cia402Error for another one."""
        if not MIN_NODE_ID <= node_id <= MAX_NODE_ID:
            raise Cia402Error(
                f"node_id = {node_id}; must be {MIN_NODE_ID} to {MAX_NODE_ID}: "
                "set the address of the drive"
            )
        self.node_id = node_id
        self._entries = parse_eds(node_id)
        self._indices = {index for index, _ in self._entries}
        self._checks: dict[int, Check] = {}
        self._actions: dict[int, Action] = {}
        self._read_checks: dict[int, ReadCheck] = {}
        self._values = {key: entry.default for key, entry in self._entries.items()}

    def entry(self, index: int, subindex: int = 0) -> ObjectEntry:
        """Find an entry; raises SdoAbort for an unknown object or sub-index."""
        found = self._entries.get((index, subindex))
        if found:
            return found
        if index in self._indices:
            raise SdoAbort(AbortCode.NO_SUBINDEX, index, subindex)
        raise SdoAbort(AbortCode.NO_OBJECT, index, subindex)

    def entries(self) -> list[ObjectEntry]:
        """List all entries in the order of the EDS file."""
        return list(self._entries.values())

    def get(self, index: int, subindex: int = 0) -> int:
        """Value of an integer object; raises KeyError for an unknown one."""
        value = self._values[index, subindex]
        assert isinstance(value, int)
        return value

    def set(self, index: int, value: int, subindex: int = 0) -> None:
        """Set the value of an integer object, limited to the range of its data type."""
        low, high = _type_range(self._entries[index, subindex])
        self._values[index, subindex] = min(max(value, low), high)

    def read(self, index: int, subindex: int = 0) -> bytes:
        """Encode a value for the bus; raises SdoAbort."""
        entry = self.entry(index, subindex)
        if not entry.is_readable:
            raise SdoAbort(AbortCode.READ_OF_WRITE_ONLY, index, subindex)
        check = self._read_checks.get(index)
        if check:
            check(subindex)
        value = self._values[index, subindex]
        if isinstance(value, bytes):
            return value
        integer = INTEGER_TYPES[entry.data_type]
        return value.to_bytes(integer.length, "little", signed=integer.is_signed)

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Decode, check and store a value from the bus; raises SdoAbort and then stores nothing."""
        value = self.decode(index, subindex, data)
        self._values[index, subindex] = value
        action = self._actions.get(index)
        if action and isinstance(value, int):
            action(subindex, value)

    def decode(self, index: int, subindex: int, data: bytes) -> Value:
        """Decode and check a value from the bus without storing it; raises SdoAbort."""
        entry = self.writable_entry(index, subindex)
        check_length(entry, len(data))
        if entry.length is None:
            return bytes(data)
        signed = INTEGER_TYPES[entry.data_type].is_signed
        value = int.from_bytes(data, "little", signed=signed)
        _check_limits(entry, value)
        check = self._checks.get(index)
        if check:
            check(subindex, value)
        return value

    def writable_entry(self, index: int, subindex: int) -> ObjectEntry:
        """Find an entry that the bus may write; raises SdoAbort."""
        entry = self.entry(index, subindex)
        if not entry.is_writable:
            raise SdoAbort(AbortCode.WRITE_OF_READ_ONLY, index, subindex)
        return entry

    def add_check(self, index: int, check: Check) -> None:
        """Register a check of every value that the bus writes to an object."""
        self._checks[index] = check

    def add_action(self, index: int, action: Action) -> None:
        """Register an action after every write of the bus to an object."""
        self._actions[index] = action

    def add_read_check(self, index: int, check: ReadCheck) -> None:
        """Register a check of every read of the bus from an object."""
        self._read_checks[index] = check

    def reset(self, area: tuple[int, int] = WHOLE_DICTIONARY) -> None:
        """Set the objects of an area (first and last index) to their defaults."""
        first, last = area
        for (index, subindex), entry in self._entries.items():
            if first <= index <= last:
                self._values[index, subindex] = entry.default


def check_length(entry: ObjectEntry, length: int) -> None:
    """Check the length [bytes] of a value to write; raises SdoAbort."""
    lowest = entry.length if entry.length is not None else 0
    highest = entry.length if entry.length is not None else MAX_STRING_BYTES
    detail = f"{length} bytes, must be {lowest} to {highest}: see the data type in the EDS file"
    if length > highest:
        raise SdoAbort(AbortCode.LENGTH_TOO_HIGH, entry.index, entry.subindex, detail)
    if length < lowest:
        raise SdoAbort(AbortCode.LENGTH_TOO_LOW, entry.index, entry.subindex, detail)


def _check_limits(entry: ObjectEntry, value: int) -> None:
    bounds = f"{value}, must be {entry.low} to {entry.high}: see the limits in the EDS file"
    if entry.high is not None and value > entry.high:
        raise SdoAbort(AbortCode.VALUE_TOO_HIGH, entry.index, entry.subindex, bounds)
    if entry.low is not None and value < entry.low:
        raise SdoAbort(AbortCode.VALUE_TOO_LOW, entry.index, entry.subindex, bounds)


def _type_range(entry: ObjectEntry) -> tuple[int, int]:
    integer = INTEGER_TYPES[entry.data_type]
    bits = 8 * integer.length
    if integer.is_signed:
        return -(1 << (bits - 1)), (1 << (bits - 1)) - 1
    return 0, (1 << bits) - 1
