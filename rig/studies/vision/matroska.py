"""Matroska files of JPEG pictures at irregular stamps; cv2.VideoWriter knows constant rates only.

Ids of elements: RFC 9559, section 5; sizes: RFC 8794, section 6. Defaults are left out.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Self

from rig.errors import ConfigError

Content = bytes | int | float | dict[str, "Content"]  # dict: child elements by id
TICK_NS = 1000  # resolution of the stamps
MAX_STAMP_MS = 1e13  # a double resolves 2 us here; Unix time is 2e12 ms
UNKNOWN_BYTES = 2**56 - 1  # size of a segment that is still being written
SEGMENT_PREFIX_BYTES = 12  # id and size
BLOCK_PREFIX = b"\x81\x00\x00\x80"  # track 1, 0 ticks after its cluster, key frame
APP = b"swayless"  # multiplexer and writer
DOCUMENT: Content = {"4282": b"matroska", "4287": 4, "4285": 2}  # type, version, needed version


class MatroskaWriter:
    """Writer of one Motion JPEG track; each picture is a cluster with a stamp of its own.

    The file holds the stamps of add(), rounded to 1 us, in their order: they may have holes and
    step back. cv2.VideoCapture reports them less the first one. An existing file is replaced.
    Raises OSError for a place that cannot be written.
    """

    def __init__(self, path: Path, width: int, height: int) -> None:
        """Open path for pictures of width x height pixels."""
        self._tracks = _tracks(width, height)
        self._ticks: list[int] = []  # stamps
        self._file = path.open("wb")
        self._file.write(_element("1A45DFA3", DOCUMENT))
        self._segment_start = self._file.tell()
        self._write_segment_head(UNKNOWN_BYTES)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def add(self, t_ms: float, jpeg: bytes) -> None:
        """Append a picture at t_ms; raises ConfigError for a stamp or bytes it cannot store."""
        if not 0 <= t_ms <= MAX_STAMP_MS:
            raise ConfigError(
                f"t_ms = {t_ms} of frame {len(self._ticks)}; must be 0 to {MAX_STAMP_MS:g}: "
                "add one offset to all stamps"
            )
        if not jpeg.startswith(b"\xff\xd8"):
            raise ConfigError(
                f"jpeg of frame {len(self._ticks)}: {len(jpeg)} bytes, the first two "
                f"'{jpeg[:2].hex()}'; must start with 'ffd8': encode the picture as JPEG"
            )
        ticks = round(t_ms * 1e6 / TICK_NS)
        cluster: Content = {"E7": ticks, "A3": BLOCK_PREFIX + jpeg}
        self._file.write(_element("1F43B675", cluster))
        self._ticks.append(ticks)

    def close(self) -> None:
        """Write size and duration of the segment; the file is then complete."""
        if not self._file.closed:
            segment_bytes = self._file.tell() - self._segment_start - SEGMENT_PREFIX_BYTES
            self._file.seek(self._segment_start)
            self._write_segment_head(segment_bytes)
            self._file.close()

    def _write_segment_head(self, segment_bytes: int) -> None:
        span = max(self._ticks, default=0) - min(self._ticks, default=0)
        last = span / max(len(self._ticks) - 1, 1) or 1.0  # mean interval, or a tick
        duration = span + last
        info: Content = {"2AD7B1": TICK_NS, "4489": duration, "4D80": APP, "5741": APP}
        self._file.write(bytes.fromhex("18538067") + _size(segment_bytes))
        self._file.write(_element("1549A966", info) + self._tracks)


def _tracks(width: int, height: int) -> bytes:
    video: Content = {"B0": width, "BA": height}
    # number as in BLOCK_PREFIX, unique id, type video, no lacing, codec
    track: Content = {"D7": 1, "73C5": 1, "83": 1, "9C": 0, "86": b"V_MJPEG", "E0": video}
    return _element("1654AE6B", {"AE": track})


def _element(element: str, content: Content) -> bytes:
    if isinstance(content, dict):
        parts = [_element(child, value) for child, value in content.items()]
        content = b"".join(parts)
    elif isinstance(content, int):
        content = content.to_bytes(8)
    elif isinstance(content, float):
        content = struct.pack(">d", content)
    return bytes.fromhex(element) + _size(len(content)) + content


def _size(content_bytes: int) -> bytes:
    return b"\x01" + content_bytes.to_bytes(7)  # the first byte marks a size of 8 bytes
