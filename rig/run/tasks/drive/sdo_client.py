"""SDO client: expedited reads and writes of one node, one after the other (CiA 301, 7.2.4)."""

from __future__ import annotations

import struct
from collections import deque
from typing import NamedTuple

from comms.channels import MS

REQUEST, RESPONSE = 0x600, 0x580  # COB-IDs, plus the node-ID
TIMEOUT_NS = 100 * MS
MAX_ATTEMPTS = 5  # a request or its answer may be lost
DOWNLOAD, DOWNLOADED = 0x23, 0x60
UPLOAD, UPLOADED = 0x40, 0x42  # expedited
SIZE_MASK = 0x0D  # size indicated, number of bytes without data
ABORT = 0x80
NO_SUCH_OBJECT = 0x0602_0000
ABORT_TEXTS = {
    0x0503_0000: "toggle bit not alternated",
    0x0504_0000: "time-out",
    0x0601_0000: "unsupported access",
    0x0601_0001: "write only",
    0x0601_0002: "read only",
    NO_SUCH_OBJECT: "no such object",
    0x0604_0041: "object cannot be mapped to a PDO",
    0x0604_0042: "PDO too long",
    0x0607_0010: "wrong length",
    0x0609_0011: "no such subindex",
    0x0609_0030: "value out of range",
    0x0609_0031: "value too high",
    0x0609_0032: "value too low",
    0x0800_0022: "not in this state",
}


class Access(NamedTuple):
    """Write of a value, or read that must give it where it is expected; size in bytes.

    is_optional: of an object that a node need not have; it goes on without it.
    """

    object_index: int
    subindex: int
    size: int
    value: int
    is_read: bool = False
    is_optional: bool = False

    @property
    def name(self) -> str:
        """Index and subindex, e.g. 1018:01."""
        return f"{self.object_index:04X}:{self.subindex:02X}"


class SdoClient:
    """Queue of accesses; `error` tells what failed, after which nothing more is sent."""

    def __init__(self, node_id: int) -> None:
        self.error = ""
        self._request_id = REQUEST + node_id
        self.response_id = RESPONSE + node_id
        self._waiting: deque[Access] = deque()
        self._sent_ns: int | None = None
        self._attempts = 0  # requests of the access that waits

    @property
    def is_done(self) -> bool:
        """True when every access was confirmed."""
        return not self._waiting and not self.error

    def start(self, accesses: list[Access]) -> None:
        """Take a list of accesses in place of what was left."""
        self.error = ""
        self._waiting = deque(accesses)
        self._sent_ns = None
        self._attempts = 0

    def next(self, t_ns: int) -> tuple[int, bytes] | None:
        """Return the request to send now as CAN-ID and data; None while an answer is awaited."""
        if not self._waiting or self.error:
            return None
        access = self._waiting[0]
        if self._sent_ns is not None:
            if t_ns - self._sent_ns <= TIMEOUT_NS:
                return None
            if self._attempts == MAX_ATTEMPTS:
                text = f"no answer to {MAX_ATTEMPTS} requests within {TIMEOUT_NS / MS:.0f} ms each"
                self.error = f"object {access.name}: {text}"
                return None
        self._attempts += 1
        self._sent_ns = t_ns
        return self._request_id, _request(access)

    def take(self, data: bytes) -> None:
        """Take the answer of the node to the request that waits."""
        if not self._waiting or self._sent_ns is None or len(data) != 8:
            return
        access = self._waiting[0]
        command, index, subindex = struct.unpack_from("<BHB", data)
        if (index, subindex) != (access.object_index, access.subindex):
            return
        if command == ABORT:
            code = int.from_bytes(data[4:8], "little")
            if access.is_optional and code == NO_SUCH_OBJECT:
                self._confirm()
                return
            text = ABORT_TEXTS.get(code, "see CiA 301")
            self.error = f"object {access.name}: the node refuses, 0x{code:08X} ({text})"
            return
        if command & ~SIZE_MASK != (UPLOADED if access.is_read else DOWNLOADED):
            return
        self._confirm()
        if access.is_read:
            self._compare(access, int.from_bytes(data[4 : 4 + access.size], "little"))

    def _confirm(self) -> None:
        self._waiting.popleft()
        self._sent_ns = None
        self._attempts = 0

    def _compare(self, access: Access, value: int) -> None:
        if value != access.value:
            self.error = f"object {access.name} = 0x{value:X}; must be 0x{access.value:X}"


def _request(access: Access) -> bytes:
    if access.is_read:
        return struct.pack("<BHBI", UPLOAD, access.object_index, access.subindex, 0)
    unused = 4 - access.size
    value = access.value & (256**access.size - 1)
    return struct.pack("<BHBI", DOWNLOAD | unused << 2, access.object_index, access.subindex, value)
