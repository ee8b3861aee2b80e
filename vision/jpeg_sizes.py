"""Sizes of the pictures in a video of JPEG pictures; OpenCV scales all to the first one."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2

Size = tuple[int, int]  # width, height
FRAME_HEADERS = (0xC0, 0xC1, 0xC2)  # baseline, extended, progressive (ITU-T T.81, table B.1)


class JpegSizes:
    """Sizes of the pictures of a file, one after the other, without decoding."""

    def __init__(self, path: Path) -> None:
        settings = [cv2.CAP_PROP_FORMAT, -1]
        self._capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, settings)
        self._last: Size | None = None

    def step(self) -> tuple[Size | None, Size | None]:
        """Return the sizes of the picture before and of the next one; None if unknown."""
        before = self._last
        ok, packet = self._capture.read()
        self._last = jpeg_size(packet[0, :4096].tobytes()) if ok else None
        return before, self._last

    def close(self) -> None:
        """Close the file."""
        self._capture.release()


def jpeg_size(data: bytes) -> Size | None:
    """Read width and height from the header of a JPEG picture; None if there is none in data."""
    place = 2  # after the start of the image
    while place + 9 <= len(data) and data[place] == 0xFF:
        marker = data[place + 1]
        length, _, height, width = struct.unpack_from(">HBHH", data, place + 2)
        if marker in FRAME_HEADERS:
            return width, height
        place += 2 + length
    return None
