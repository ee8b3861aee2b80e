"""Sources of frames: what the user names, opened as what it is."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from vision.errors import VisionError
from vision.stream import FrameSource, Image, SourceOptions
from vision.video_file import VideoFile

DEFAULT_OPTIONS = SourceOptions()
RED = 2  # OpenCV orders blue, green, red
MIN_FPS, MAX_FPS = 1.0, 10_000.0  # containers without a rate report 0, NaN, 90,000 or 1,000,000


class VideoFrame(NamedTuple):
    """Frame of a video."""

    number: int  # from 0
    t_s: float  # from the first frame
    red: Image  # red plane, (height, width) uint8


def open_source(where: str | Path, options: SourceOptions = DEFAULT_OPTIONS) -> FrameSource:
    """Open a source of frames by name.

    where: video file, folder of pictures, printf pattern of pictures, number or path of a camera,
    text of a GStreamer pipeline. Raises VisionError with what was found and the next step.
    """
    path = Path(where)
    if not path.is_file():
        raise VisionError(f"{path}: no such file; need a video file: check the path")
    return VideoFile(path, options)


def video_frames(path: Path) -> Iterator[VideoFrame]:
    """Read the frames of a video file; t_s = index / frame rate of the container.

    The time stamps of the container (CAP_PROP_POS_MSEC) are not used: they repeat the first one or
    jump with seeking, differently for each backend and version. A constant frame rate is assumed;
    a lost frame shifts those after it. A grey video gives its only plane. Raises VisionError,
    before the first frame, if path is not a readable video.
    """
    if not path.is_file():
        raise VisionError(f"{path}: no such file; need a video file: check the path")
    capture = _open(path)
    fps = _check_rate(path, capture.get(cv2.CAP_PROP_FPS))
    return _read_frames(capture, fps)


def _open(path: Path) -> cv2.VideoCapture:
    # keep the messages of FFmpeg off stderr; the exception below says the same
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise VisionError(
            f"{path}: {path.stat().st_size} bytes, but no video that OpenCV can read: "
            "convert it to FFV1 or MJPG"
        )
    return capture


def _check_rate(path: Path, fps: float) -> float:
    if not MIN_FPS <= fps <= MAX_FPS:
        raise VisionError(
            f"{path}: frame rate {fps} Hz; must be {MIN_FPS} to {MAX_FPS}: "
            "write the video with its true rate"
        )
    return fps


def _read_frames(capture: cv2.VideoCapture, fps: float) -> Iterator[VideoFrame]:
    try:
        for index in count():
            ok, image = capture.read()
            if not ok:
                return
            yield VideoFrame(index, index / fps, red_plane(np.asarray(image, np.uint8)))
    finally:
        capture.release()


def red_plane(image: Image) -> Image:
    """Extract the red plane of a blue-green-red image; a single plane is returned unchanged.

    (height, width, 3) -> contiguous (height, width).
    """
    if image.ndim == 2:
        return image
    return np.asarray(cv2.extractChannel(image, RED), np.uint8)
