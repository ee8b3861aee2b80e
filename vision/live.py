"""Cameras by number or path, and GStreamer pipelines: streams that pass once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vision.decoder_messages import DecoderMessages
from vision.errors import VisionError
from vision.stream import About, Image, SourceFrame, SourceOptions, StampKind, StreamFinding
from vision.stream_check import checked, within

MAX_RATE_HZ = 10_000.0


def open_camera(name: str, options: SourceOptions) -> LiveSource:
    """Open a camera by its number or path, with the stamps of its driver; raises VisionError."""
    path = Path(f"/dev/video{name}") if name.isdigit() else Path(name)
    if not path.exists():
        present = ", ".join(sorted(str(found) for found in Path("/dev").glob("video*")))
        known = present or "none, as there is no camera"
        raise VisionError(
            f"camera {name}: {path} does not exist; must be one of {known}: "
            "plug the camera in, or name a file"
        )
    capture = _open(str(path), cv2.CAP_V4L2)
    if not capture.isOpened():
        raise VisionError(
            f"camera {name}: {path} cannot be opened for pictures; another program may hold it, or "
            "you may not read it: close that program, or join the group of the device (video)"
        )
    if options.rate_hz is not None:
        capture.set(cv2.CAP_PROP_FPS, options.rate_hz)
    return LiveSource(capture, f"camera {name}", "camera", options)


def open_pipeline(text: str, options: SourceOptions) -> LiveSource:
    """Open a GStreamer pipeline that ends in an appsink; raises VisionError."""
    if not has_gstreamer():
        raise VisionError(
            f"pipeline '{text}': this OpenCV {cv2.__version__} is built without GStreamer, as its "
            "wheels are; name the camera by its path (/dev/video0), or install an OpenCV that is "
            "built with it, for example that of the Linux distribution (python3-opencv)"
        )
    capture = _open(text, cv2.CAP_GSTREAMER)
    if not capture.isOpened():
        raise VisionError(
            f"pipeline '{text}': does not start; must end in appsink: try it with gst-launch-1.0"
        )
    return LiveSource(capture, text, "pipeline", options)


def has_gstreamer() -> bool:
    """Tell if OpenCV was built with GStreamer."""
    for line in cv2.getBuildInformation().splitlines():
        name, _, value = line.partition(":")
        if name.strip() == "GStreamer":
            return value.strip().startswith("YES")
    return False


class LiveSource:
    """Stream of a camera; ends when it gives no more pictures or the reader stops."""

    def __init__(
        self,
        capture: Any,
        name: str,
        kind: str,
        options: SourceOptions,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """capture: like cv2.VideoCapture, opened; clock_s: where the driver gives no stamps."""
        self._capture = capture
        self._options = options
        self._clock_s = clock_s
        self.findings: list[StreamFinding] = []
        rate_hz = capture.get(cv2.CAP_PROP_FPS)
        code = int(capture.get(cv2.CAP_PROP_FOURCC))
        self.about = About(
            name=name,
            kind=kind,
            width=int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
            height=int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
            rate_hz=rate_hz if 0.0 < rate_hz <= MAX_RATE_HZ else None,
            frames=None,
            codec=code.to_bytes(4, "little", signed=code < 0).decode("latin1").strip("\0 "),
            is_live=True,
        )
        self._frames = self._read()
        self._kept: list[SourceFrame] = []  # read by spread(), given again by frames()

    def frames(self) -> Iterator[SourceFrame]:
        """Read from where the stream stands, after the frames that spread() has read."""
        yield from checked(within(self._all(), self._options), self.findings)

    def spread(self, count: int) -> list[SourceFrame]:
        """Read the next count frames; frames() gives them again."""
        for frame in self._frames:
            self._kept.append(frame)
            if len(self._kept) >= count:
                break
        return list(self._kept)

    def close(self) -> None:
        """Stop the camera."""
        self._capture.release()

    def _all(self) -> Iterator[SourceFrame]:
        while self._kept:
            yield self._kept.pop(0)
        yield from self._frames

    def _read(self) -> Iterator[SourceFrame]:
        """Stamp each frame by the driver, or all by the clock if its first two stamps do not rise.

        The first frame is given with the second, which tells.
        """
        first: tuple[float, float, Image] | None = None
        stamp = StampKind.DEVICE
        first_s = 0.0
        for number, (device_s, arrival_s, image) in enumerate(self._taken()):
            if first is None:
                first = (device_s, arrival_s, image)
                continue
            if number == 1:
                if not device_s > first[0]:
                    stamp = StampKind.ARRIVAL
                first_s = first[0] if stamp is StampKind.DEVICE else first[1]
                yield SourceFrame(0, 0.0, stamp, first[2])
            t_s = device_s if stamp is StampKind.DEVICE else arrival_s
            yield SourceFrame(number, t_s - first_s, stamp, image)

    def _taken(self) -> Iterator[tuple[float, float, Image]]:
        """Take pictures with the stamp of the driver and the time of arrival [s]."""
        while self._capture.grab():
            arrival_s = self._clock_s()
            device_s = 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC)
            ok, image = self._capture.retrieve()
            if ok:
                yield device_s, arrival_s, np.asarray(image, np.uint8)


def _open(name: str, backend: int) -> cv2.VideoCapture:
    with DecoderMessages() as messages:  # keeps the complaints of OpenCV off the terminal
        return messages.call(cv2.VideoCapture, name, backend)
