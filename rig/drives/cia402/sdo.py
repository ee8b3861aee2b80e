"""SDO server: expedited and segmented upload and download (CiA 301).

Block transfer is refused with "unknown command". Requests that are not 8 bytes long are ignored.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace

from rig.drives.cia402.errors import AbortCode, Cia402Error, SdoAbort
from rig.drives.cia402.object_dictionary import ObjectDictionary, check_length

SDO_BYTES = 8
SEGMENT_BYTES = 7
EXPEDITED_BYTES = 4
DEFAULT_TIMEOUT_NS = 1_000_000_000

_HEADER = struct.Struct("<BHB")  # command, index, subindex
_LENGTH = struct.Struct("<I")

# command specifiers, bits 5 to 7 of the first byte
_DOWNLOAD_SEGMENT_REQUEST = 0 << 5
_DOWNLOAD_REQUEST = 1 << 5
_UPLOAD_REQUEST = 2 << 5
_UPLOAD_SEGMENT_REQUEST = 3 << 5
_ABORT = 4 << 5
_UPLOAD_SEGMENT_RESPONSE = 0 << 5
_DOWNLOAD_SEGMENT_RESPONSE = 1 << 5
_UPLOAD_RESPONSE = 2 << 5
_DOWNLOAD_RESPONSE = 3 << 5

_SPECIFIER_MASK = 0xE0
_TOGGLE = 0x10
_EXPEDITED = 0x02
_SIZE_INDICATED = 0x01
_LAST_SEGMENT = 0x01


@dataclass(frozen=True, slots=True, kw_only=True)
class _Transfer:
    """Segmented transfer in progress."""

    is_upload: bool
    index: int
    subindex: int
    data: bytes  # upload: still to send; download: received so far
    announced: int | None  # length [bytes] that a download announced
    toggle: int  # of the next segment
    deadline_ns: int


class SdoServer:
    """SDO server of one node with one transfer at a time.

    A new initiate request replaces a transfer in progress.
    """

    def __init__(self, dictionary: ObjectDictionary, timeout_ns: int = DEFAULT_TIMEOUT_NS) -> None:
        """Serve a dictionary.

        timeout_ns [ns] is the longest time between two requests of a segmented transfer; raises
        Cia402Error unless it is > 0.
        """
        if timeout_ns <= 0:
            raise Cia402Error(
                f"timeout_ns = {timeout_ns}; must be > 0: "
                "give the longest time between two SDO requests"
            )
        self._dictionary = dictionary
        self._timeout_ns = timeout_ns
        self._transfer: _Transfer | None = None

    def reset(self) -> None:
        """Drop a transfer in progress without a message."""
        self._transfer = None

    def on_request(self, request: bytes, t_ns: int) -> bytes | None:
        """Answer one request received at t_ns [ns]; None if no answer is due."""
        if len(request) != SDO_BYTES:
            return None
        try:
            return self._answer(request, t_ns)
        except SdoAbort as abort:
            self._transfer = None
            return _abort(abort.code, abort.index, abort.subindex)

    def on_time(self, t_ns: int) -> bytes | None:
        """Abort a transfer whose next request is overdue at t_ns [ns]."""
        transfer = self._transfer
        if transfer is None or t_ns < transfer.deadline_ns:
            return None
        self._transfer = None
        return _abort(AbortCode.TIMED_OUT, transfer.index, transfer.subindex)

    def _answer(self, request: bytes, t_ns: int) -> bytes | None:
        specifier = request[0] & _SPECIFIER_MASK
        if specifier == _UPLOAD_REQUEST:
            return self._start_upload(request, t_ns)
        if specifier == _DOWNLOAD_REQUEST:
            return self._start_download(request, t_ns)
        if specifier == _UPLOAD_SEGMENT_REQUEST:
            return self._send_segment(request, t_ns)
        if specifier == _DOWNLOAD_SEGMENT_REQUEST:
            return self._receive_segment(request, t_ns)
        if specifier == _ABORT:
            self._transfer = None
            return None
        _, index, subindex = _HEADER.unpack_from(request)
        raise SdoAbort(AbortCode.UNKNOWN_COMMAND, index, subindex)

    def _start_upload(self, request: bytes, t_ns: int) -> bytes:
        _, index, subindex = _HEADER.unpack_from(request)
        self._transfer = None
        data = self._dictionary.read(index, subindex)
        if 0 < len(data) <= EXPEDITED_BYTES:
            unused = EXPEDITED_BYTES - len(data)
            command = _UPLOAD_RESPONSE | unused << 2 | _EXPEDITED | _SIZE_INDICATED
            return _HEADER.pack(command, index, subindex) + data + bytes(unused)
        self._transfer = _Transfer(
            is_upload=True,
            index=index,
            subindex=subindex,
            data=data,
            announced=None,
            toggle=0,
            deadline_ns=t_ns + self._timeout_ns,
        )
        header = _HEADER.pack(_UPLOAD_RESPONSE | _SIZE_INDICATED, index, subindex)
        return header + _LENGTH.pack(len(data))

    def _start_download(self, request: bytes, t_ns: int) -> bytes:
        command, index, subindex = _HEADER.unpack_from(request)
        self._transfer = None
        response = _HEADER.pack(_DOWNLOAD_RESPONSE, index, subindex) + bytes(EXPEDITED_BYTES)
        if command & _EXPEDITED:
            length = self._expedited_length(command, index, subindex)
            self._dictionary.write(index, subindex, request[4 : 4 + length])
            return response
        entry = self._dictionary.writable_entry(index, subindex)
        announced = None
        if command & _SIZE_INDICATED:
            (announced,) = _LENGTH.unpack_from(request, 4)
            check_length(entry, announced)
        self._transfer = _Transfer(
            is_upload=False,
            index=index,
            subindex=subindex,
            data=b"",
            announced=announced,
            toggle=0,
            deadline_ns=t_ns + self._timeout_ns,
        )
        return response

    def _expedited_length(self, command: int, index: int, subindex: int) -> int:
        """Length of expedited data [bytes]; without indication it is that of the object."""
        if command & _SIZE_INDICATED:
            return EXPEDITED_BYTES - (command >> 2 & 0x3)
        length = self._dictionary.writable_entry(index, subindex).length
        return EXPEDITED_BYTES if length is None else length

    def _send_segment(self, request: bytes, t_ns: int) -> bytes:
        transfer = self._active(request, is_upload=True)
        segment = transfer.data[:SEGMENT_BYTES]
        rest = transfer.data[SEGMENT_BYTES:]
        unused = SEGMENT_BYTES - len(segment)
        command = _UPLOAD_SEGMENT_RESPONSE | transfer.toggle | unused << 1
        if not rest:
            command |= _LAST_SEGMENT
        self._advance(transfer, rest, is_last=not rest, t_ns=t_ns)
        return bytes([command]) + segment + bytes(unused)

    def _receive_segment(self, request: bytes, t_ns: int) -> bytes:
        transfer = self._active(request, is_upload=False)
        used = SEGMENT_BYTES - (request[0] >> 1 & 0x7)
        data = transfer.data + request[1 : 1 + used]
        is_last = bool(request[0] & _LAST_SEGMENT)
        self._check_received(transfer, len(data), is_last=is_last)
        if is_last:
            self._dictionary.write(transfer.index, transfer.subindex, data)
        self._advance(transfer, data, is_last=is_last, t_ns=t_ns)
        return bytes([_DOWNLOAD_SEGMENT_RESPONSE | transfer.toggle]) + bytes(SEGMENT_BYTES)

    def _check_received(self, transfer: _Transfer, length: int, *, is_last: bool) -> None:
        """Check the received length [bytes] against the object and against the announcement."""
        index = transfer.index
        subindex = transfer.subindex
        entry = self._dictionary.writable_entry(index, subindex)
        if is_last and transfer.announced not in (None, length):
            detail = f"{length} bytes, announced {transfer.announced}: send the announced length"
            raise SdoAbort(AbortCode.LENGTH_MISMATCH, index, subindex, detail)
        if is_last or length > (entry.length or 0):
            check_length(entry, length)

    def _active(self, request: bytes, *, is_upload: bool) -> _Transfer:
        """Transfer that a segment belongs to, with the toggle bit checked."""
        transfer = self._transfer
        if transfer is None or transfer.is_upload != is_upload:
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND, 0)
        if request[0] & _TOGGLE != transfer.toggle:
            raise SdoAbort(AbortCode.TOGGLE_NOT_ALTERNATED, transfer.index, transfer.subindex)
        return transfer

    def _advance(self, transfer: _Transfer, data: bytes, *, is_last: bool, t_ns: int) -> None:
        if is_last:
            self._transfer = None
            return
        self._transfer = replace(
            transfer,
            data=data,
            toggle=transfer.toggle ^ _TOGGLE,
            deadline_ns=t_ns + self._timeout_ns,
        )


def _abort(code: AbortCode, index: int, subindex: int) -> bytes:
    return _HEADER.pack(_ABORT, index, subindex) + _LENGTH.pack(code)
