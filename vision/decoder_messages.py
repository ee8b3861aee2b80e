"""Messages of FFmpeg, libjpeg and libpng about damage, which OpenCV does not pass on.

OpenCV reports a damaged picture as a good one, and hands no option for it to the decoder. The
libraries write one line to the standard error of the process; it is taken from there, for the time
of a call.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable
from typing import Self, TypeVar

Result = TypeVar("Result")

FFMPEG = re.compile(r"\[[\w, ]+ @ 0x[0-9a-f]+\] |    Last message repeated")
PICTURE = re.compile(r"Corrupt JPEG data|Premature end of JPEG|Unsupported marker|libpng |.*TIFF")
OPENCV = re.compile(r"\[ *[A-Z]+:\d+@[\d.]+\] |OpenCV")
HARMLESS = ("APP fields", "swscaler", "EXIF", "No accelerated colorspace")


class DecoderMessages:
    """Messages of decoders; each call of a decoder gives those that it wrote.

    Lines of others that come in between are passed on. A process without standard error, and one
    whose user has set OPENCV_FFMPEG_LOGLEVEL, gives none of FFmpeg.
    """

    def __init__(self) -> None:
        self.last: list[str] = []  # messages of the last call
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  closed by close()
        try:
            self._stderr = os.dup(2)
        except OSError:
            self._stderr = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def call(self, decode: Callable[..., Result], *values: object) -> Result:
        """Call decode with the values; what it writes to standard error becomes `last`."""
        if self._stderr < 0:
            return decode(*values)
        self.last = []
        os.dup2(self._file.fileno(), 2)
        try:
            return decode(*values)
        finally:
            os.dup2(self._stderr, 2)
            # the descriptors share one position: 0 unless something was written
            if os.lseek(self._file.fileno(), 0, os.SEEK_CUR):
                self._take()

    def close(self) -> None:
        """Close the file that keeps the messages."""
        self._file.close()
        if self._stderr >= 0:
            os.close(self._stderr)
            self._stderr = -1

    def _take(self) -> None:
        self._file.seek(0)
        text = self._file.read().decode("utf-8", "replace")
        self._file.seek(0)
        self._file.truncate()
        for line in text.splitlines(keepends=True):
            if FFMPEG.match(line) or PICTURE.match(line):
                if not any(word in line for word in HARMLESS):
                    self.last.append(line.strip())
            elif not OPENCV.match(line):
                os.write(self._stderr, line.encode())
