"""Reasons why a file is no video that can be read, from its first bytes."""

from __future__ import annotations

import re
import struct
from pathlib import Path

HEAD_BYTES = 1 << 16
CONVERT = "convert it, for example to FFV1 or MJPG in a .avi or .mkv file"


def unreadable(path: Path) -> str:
    """Word the message on a file that OpenCV does not open: what it is, and the next step."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    return f"{path}: {size} bytes, {_cause(path, head)}"


def _cause(path: Path, head: bytes) -> str:
    if not head:
        return "an empty file; need a video: copy it again from the camera"
    if head[4:8] == b"ftyp":
        return _cause_in_mp4(path)
    if head.startswith(b"RIFF") and head[8:12] == b"AVI ":
        return _cause_by_stream(_avi_codec(head))
    if head.startswith(b"\x1a\x45\xdf\xa3"):
        return _cause_by_stream(_matroska_codec(head))
    if head.startswith(b"RIFF") or head[:3] in (b"ID3", b"Ogg", b"fLa"):
        return "sound alone; need a video: name the file that has the pictures"
    if _is_text(head):
        return "a text file, not a video: check the path"
    return f"not a video file that OpenCV can read: {CONVERT}"


def _cause_in_mp4(path: Path) -> str:
    """Look for the index, and for a video track in it."""
    index = _mp4_index(path)
    if index is None:
        return (
            "an mp4 file without its index (box moov), which is written last: the recording was "
            "cut short; record it again, or repair the file with a tool that rebuilds the index "
            "from another file of the same camera"
        )
    place = index.find(b"vide")
    if place < 0:
        return _cause_by_stream(None)
    description = index.find(b"stsd", place)
    codec = index[description + 16 : description + 20] if description >= 0 else b"?"
    return _cause_by_stream(codec.decode("latin1"))


def _cause_by_stream(codec: str | None) -> str:
    if codec is None:
        return "sound without pictures; need a video: name the file that has the pictures"
    return f"a video of codec '{codec}', which this OpenCV cannot decode: {CONVERT}"


def _mp4_index(path: Path) -> bytes | None:
    """Read the box moov; None if it is not there."""
    with path.open("rb") as file:
        while len(header := file.read(8)) == 8:
            length, kind = struct.unpack(">I4s", header)
            taken = 8
            if length == 1:
                length = int.from_bytes(file.read(8))
                taken = 16
            if kind == b"moov":
                return file.read(max(0, length - taken))
            if length < taken:
                return None
            file.seek(length - taken, 1)
    return None


def _avi_codec(head: bytes) -> str | None:
    place = head.find(b"vids")
    return None if place < 0 else head[place + 4 : place + 8].decode("latin1")


def _matroska_codec(head: bytes) -> str | None:
    place = head.find(b"V_")
    if place < 0:
        return None
    found = re.match(rb"[\w/]+", head[place : place + 32])
    return found.group().decode("ascii") if found else None


def _is_text(head: bytes) -> bool:
    try:
        head[:1024].decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start > 1000  # a character cut at the end
    return b"\0" not in head[:1024]
