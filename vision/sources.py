"""Pictures out of a video file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from vision.errors import VisionError

Picture = np.ndarray[Any, np.dtype[np.uint8]]

RED = 2  # OpenCV orders blue, green, red
MIN_FPS, MAX_FPS = 1.0, 10_000.0  # containers without a rate report 0, NaN, 90,000 or 1,000,000


class VideoFrame(NamedTuple):
    """One picture: its number (0 first), its time from the first, and its red plane (height, width) uint8."""

    number: int
    t_s: float
    red: Picture


def video_frames(path: Path) -> Iterator[VideoFrame]:
    """Every picture of a video file; t_s = index / frame rate of the container.

    The container's own stamps (CAP_PROP_POS_MSEC) are not used: they repeat the first stamp or jump with seeking,
    differently for each backend and version. A camera at a constant rate is assumed; a lost frame shifts what follows.
    A colourless video gives its only plane. Raises VisionError, before the first picture, if path is not a readable video.
    """
    if not path.is_file():
        raise VisionError(f"{path}: no such file; need a video file: check the path")
    capture = _opened(path)
    return _pictures(capture, _checked_rate(path, capture.get(cv2.CAP_PROP_FPS)))


def _opened(path: Path) -> cv2.VideoCapture:
    os.environ.setdefault(
        "OPENCV_FFMPEG_LOGLEVEL", "-8"
    )  # FFmpeg would tell stderr what the exception below says
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise VisionError(
            f"{path}: {path.stat().st_size} bytes, but no video OpenCV can read: convert it to FFV1 or MJPG"
        )
    return capture


def _checked_rate(path: Path, fps: float) -> float:
    if not MIN_FPS <= fps <= MAX_FPS:
        raise VisionError(
            f"{path}: frame rate {fps} Hz; must be {MIN_FPS} to {MAX_FPS}: write the video with its true rate"
        )
    return fps


def _pictures(capture: cv2.VideoCapture, fps: float) -> Iterator[VideoFrame]:
    try:
        for index in count():
            ok, picture = capture.read()
            if not ok:
                return
            yield VideoFrame(index, index / fps, red_plane(np.asarray(picture, np.uint8)))
    finally:
        capture.release()


def red_plane(picture: Picture) -> Picture:
    """Red of a (height, width, 3) blue-green-red picture as contiguous (height, width); a single plane as it is."""
    if picture.ndim == 2:
        return picture
    return np.asarray(cv2.extractChannel(picture, RED), np.uint8)
