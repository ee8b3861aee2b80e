"""Objects of a node over SDO: address, data type, value as text, and what a refusal means."""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass
from typing import NamedTuple

from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from rig.drives.cia402.eds import INTEGER_TYPES, VISIBLE_STRING, ObjectEntry, parse_eds
from rig.drives.cia402.errors import AbortCode
from rig.errors import ConfigError, Refused, RunFailed
from rig.run.field_bus.exchange import ObjectClient

ADDRESS = re.compile(r"(?:0x)?([0-9a-f]{1,4})(?::(?:0x)?([0-9a-f]{1,2}))?", re.IGNORECASE)
INTEGER = re.compile(r"(u|i)(8|16|32|64)")
FLOATS = {"f32": struct.Struct("<f"), "f64": struct.Struct("<d")}
TEXT, HEX = "str", "hex"
TYPES = ("u8", "u16", "u32", "u64", "i8", "i16", "i32", "i64", *FLOATS, TEXT, HEX)
NEXT_STEPS: dict[int, str] = {
    AbortCode.TOGGLE_NOT_ALTERNATED: "ask again; another client may use the node at this time",
    AbortCode.TIMED_OUT: "ask again; look for lost frames",
    AbortCode.READ_OF_WRITE_ONLY: "write it, or read another object",
    AbortCode.WRITE_OF_READ_ONLY: "give no VALUE to read it",
    AbortCode.NO_OBJECT: "look for the index in the EDS file of the node",
    AbortCode.NOT_MAPPABLE: "take an object that the EDS file names as PDO mappable",
    AbortCode.PDO_TOO_LONG: "map at most 8 bytes",
    AbortCode.LENGTH_MISMATCH: "name the type of the object, e.g. --type u16",
    AbortCode.LENGTH_TOO_HIGH: "name a shorter type, e.g. --type u16",
    AbortCode.LENGTH_TOO_LOW: "name a longer type, e.g. --type u32",
    AbortCode.NO_SUBINDEX: "read subindex 0, which holds the highest one",
    AbortCode.INVALID_VALUE: "look for the permitted values in the EDS file of the node",
    AbortCode.VALUE_TOO_HIGH: "give a lower value",
    AbortCode.VALUE_TOO_LOW: "give a higher value",
    AbortCode.DEVICE_STATE: "bring the drive into another state, e.g. out of operation",
}


@dataclass(frozen=True)
class ObjectAddress:
    """Index and subindex of an object."""

    index: int
    subindex: int

    @property
    def name(self) -> str:
        """Index and subindex, e.g. 1018:01."""
        return f"{self.index:04X}:{self.subindex:02X}"


class ObjectValue(NamedTuple):
    """Value that was read or written: bytes of the wire, and what they mean."""

    data: bytes
    kind: str  # one of TYPES
    value: int | float | str

    @property
    def text(self) -> str:
        """Value as a line shows it, an integer in both bases."""
        if isinstance(self.value, int):
            return f"{self.value} (0x{_unsigned(self.data):0{2 * len(self.data)}X})"
        return str(self.value)


def parse_address(text: str) -> ObjectAddress:
    """Parse INDEX or INDEX:SUB, both hexadecimal; raises ConfigError."""
    found = ADDRESS.fullmatch(text.strip())
    if found is None:
        raise ConfigError(
            f"object {text!r}; must be INDEX or INDEX:SUB in hexadecimal digits, e.g. 6064 or "
            "1018:1"
        )
    return ObjectAddress(int(found[1], 16), int(found[2] or "0", 16))


def check_type(kind: str) -> None:
    """Check the name of a data type; raises ConfigError."""
    if kind not in TYPES:
        raise ConfigError(f"--type {kind}; must be one of {', '.join(TYPES)}")


def known_entry(node_id: int, address: ObjectAddress) -> ObjectEntry | None:
    """Find an object in the EDS file of the program; None where it is not described there."""
    return parse_eds(node_id).get((address.index, address.subindex))


def known_type(entry: ObjectEntry | None) -> str | None:
    """Name the data type of an entry of the EDS file."""
    if entry is None:
        return None
    if entry.data_type == VISIBLE_STRING:
        return TEXT
    integer = INTEGER_TYPES[entry.data_type]
    return f"{'i' if integer.is_signed else 'u'}{8 * integer.length}"


def encode(text: str, kind: str) -> bytes:
    """Encode a value that was typed; raises ConfigError for one that the type cannot hold."""
    try:
        if kind == TEXT:
            return text.encode("ascii")
        if kind == HEX:
            return bytes.fromhex(text.removeprefix("0x"))
        if kind in FLOATS:
            return FLOATS[kind].pack(_finite(float(text)))
        value = int(text, 0)
    except (ValueError, OverflowError):
        raise ConfigError(f"value {text!r} is no {kind}; {_example(kind)}") from None
    signed, bits = kind[0] == "i", int(kind[1:])
    low = -(2 ** (bits - 1)) if signed else 0
    high = low + 2**bits - 1
    if not low <= value <= high:
        raise ConfigError(f"value {text} for {kind}; must be {low} to {high}")
    return value.to_bytes(bits // 8, "little", signed=signed)


def decode(data: bytes, kind: str) -> ObjectValue:
    """Decode bytes as a type; where their number is not that of the type, as hexadecimal."""
    integer = INTEGER.fullmatch(kind)
    if integer is not None and len(data) == int(integer[2]) // 8:
        number = int.from_bytes(data, "little", signed=integer[1] == "i")
        return ObjectValue(data, kind, number)
    if kind in FLOATS and len(data) == FLOATS[kind].size:
        (real,) = FLOATS[kind].unpack(data)
        return ObjectValue(data, kind, float(real))
    if kind == TEXT:
        return ObjectValue(data, kind, data.rstrip(b"\0").decode("latin-1"))
    return ObjectValue(data, HEX, data.hex(" "))


def read_object(client: ObjectClient, address: ObjectAddress, kind: str | None) -> ObjectValue:
    """Read an object of a node, as kind or as the EDS file describes it.

    Raises Refused for an abort of the node, and RunFailed where it does not answer.
    """
    try:
        data = client.upload(address.index, address.subindex)
    except SdoError as error:
        raise _explained(client, address, error) from error
    node_id = _node_id(client)
    return decode(data, kind or known_type(known_entry(node_id, address)) or HEX)


def write_object(
    client: ObjectClient, address: ObjectAddress, text: str, kind: str | None
) -> ObjectValue:
    """Write a value that was typed; raises ConfigError, and Refused and RunFailed as a read."""
    chosen = kind or known_type(known_entry(_node_id(client), address))
    if chosen is None:
        raise ConfigError(
            f"object {address.name} is not in the EDS file of this program; its type is not known: "
            "name it, e.g. --type u16"
        )
    data = encode(text, chosen)
    try:
        client.download(address.index, address.subindex, data)
    except SdoError as error:
        raise _explained(client, address, error) from error
    return decode(data, chosen)


def _node_id(client: ObjectClient) -> int:
    return int(client.rx_cobid) & 0x7F


def _explained(client: ObjectClient, address: ObjectAddress, error: SdoError) -> Exception:
    node = f"node {_node_id(client)}"
    if isinstance(error, SdoAbortedError):
        text = SdoAbortedError.CODES.get(error.code, "not a code of CiA 301").lower()
        step = NEXT_STEPS.get(error.code, "look for the code in the manual of the node")
        return Refused(
            f"{node} refuses {address.name}: {text} (abort code 0x{error.code:08X}): {step}"
        )
    if isinstance(error, SdoCommunicationError) and "No SDO response" in str(error):
        return RunFailed(
            f"{node} did not answer within {client.timeout_s:g} s to {address.name}: look for its "
            "power, node-ID and bit rate; `rig can scan` lists the nodes"
        )
    return RunFailed(f"{node}, object {address.name}: {error}: ask again")


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError("must be finite")
    return value


def _unsigned(data: bytes) -> int:
    return int.from_bytes(data, "little")


def _example(kind: str) -> str:
    if kind == TEXT:
        return "must be ASCII text"
    if kind == HEX:
        return "must be pairs of hexadecimal digits, e.g. 0aff"
    if kind in FLOATS:
        return "must be a number, e.g. 1.5"
    return "must be an integer, e.g. 100 or 0x64"
