"""Video files: frames with the time stamps of the container."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import count as count_from
from pathlib import Path

import cv2
import numpy as np

from vision.errors import VisionError
from vision.stream import About, Finding, SourceFrame, SourceOptions, StampKind

MIN_RATE_HZ, MAX_RATE_HZ = 0.001, 10_000.0  # containers without a rate report 0, NaN or 90,000
PROBED_FRAMES = 16


class VideoFile:
    """Video file; can be read any number of times."""

    def __init__(self, path: Path, options: SourceOptions) -> None:
        """Open path; raises VisionError if it is no video that can be read."""
        self._path = path
        self._options = options
        self.findings: list[Finding] = []
        capture = open_capture(path)
        self.about = _about(path, capture)
        stamps_ms = _probed_stamps_ms(capture)
        capture.release()
        self._stamp = self._choose_stamp(stamps_ms)

    def frames(self) -> Iterator[SourceFrame]:
        """Read all frames from from_s to to_s."""
        self.findings.clear()
        capture = open_capture(self._path)
        try:
            yield from self._within(self._read(capture))
        finally:
            capture.release()

    def spread(self, count: int) -> list[SourceFrame]:
        """Read count frames, or all if there are fewer, spread over from_s to to_s.

        Grabs every frame and keeps one of each step; the step doubles when too many are kept.
        """
        kept: list[SourceFrame] = []
        step = 1
        for index, frame in enumerate(self.frames()):
            if index % step == 0:
                kept.append(frame)
            if len(kept) == 2 * count:
                kept = kept[::2]
                step *= 2
        chosen = np.linspace(0, len(kept) - 1, min(count, len(kept))).round().astype(int)
        return [kept[index] for index in chosen]

    def _choose_stamp(self, stamps_ms: list[float]) -> StampKind:
        if self._options.rate_hz is not None:
            return StampKind.RATE
        if len(set(stamps_ms)) > 1 or len(stamps_ms) < 2:
            return StampKind.CONTAINER
        if self.about.rate_hz is None:
            raise VisionError(
                f"{self._path}: no time stamps and no frame rate; need one of them: "
                "give the rate with --rate"
            )
        return StampKind.INDEX

    def _read(self, capture: cv2.VideoCapture) -> Iterator[SourceFrame]:
        first_ms = 0.0
        rate_hz = self._options.rate_hz or self.about.rate_hz or 1.0
        for number in count_from():
            if not capture.grab():
                return
            t_ms = capture.get(cv2.CAP_PROP_POS_MSEC)
            if number == 0:
                first_ms = t_ms
            t_s = number / rate_hz
            if self._stamp is StampKind.CONTAINER:
                t_s = 1e-3 * (t_ms - first_ms)
            ok, image = capture.retrieve()
            if ok:
                yield SourceFrame(number, t_s, self._stamp, np.asarray(image, np.uint8))

    def _within(self, frames: Iterator[SourceFrame]) -> Iterator[SourceFrame]:
        from_s, to_s = self._options.from_s, self._options.to_s
        for frame in frames:
            if to_s is not None and frame.t_s > to_s:
                return
            if from_s is None or frame.t_s >= from_s:
                yield frame


def open_capture(path: Path) -> cv2.VideoCapture:
    """Open a video file; raises VisionError."""
    # keep the messages of FFmpeg off stderr; the exception below says the same
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise VisionError(
            f"{path}: {path.stat().st_size} bytes, but no video that OpenCV can read: "
            "convert it to FFV1 or MJPG"
        )
    return capture


def _about(path: Path, capture: cv2.VideoCapture) -> About:
    rate_hz = capture.get(cv2.CAP_PROP_FPS)
    frames = capture.get(cv2.CAP_PROP_FRAME_COUNT)
    code = int(capture.get(cv2.CAP_PROP_FOURCC))
    return About(
        name=str(path),
        kind="video",
        width=int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
        height=int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        rate_hz=rate_hz if MIN_RATE_HZ <= rate_hz <= MAX_RATE_HZ else None,
        frames=int(frames) if frames > 0 else None,
        codec=code.to_bytes(4, "little", signed=code < 0).decode("latin1").strip("\0 "),
        is_live=False,
    )


def _probed_stamps_ms(capture: cv2.VideoCapture) -> list[float]:
    stamps_ms: list[float] = []
    while len(stamps_ms) < PROBED_FRAMES and capture.grab():
        stamps_ms.append(capture.get(cv2.CAP_PROP_POS_MSEC))
    return stamps_ms
