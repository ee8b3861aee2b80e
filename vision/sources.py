"""Sources of frames: what the user names, opened as what it is."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from vision.errors import VisionError
from vision.live import open_camera, open_pipeline
from vision.pictures import ENDINGS, Pictures
from vision.stream import FrameStream, Image, SourceOptions
from vision.video_file import VideoFile

MAX_RATE_HZ = 1e6
PIPELINE_LINK = " ! "  # between the elements of a GStreamer pipeline
DEFAULT_OPTIONS = SourceOptions()
RED = 2  # OpenCV orders blue, green, red


def open_source(where: str | Path, options: SourceOptions = DEFAULT_OPTIONS) -> FrameStream:
    """Open a source of frames by name.

    where: video file, folder of pictures, printf pattern of pictures, number or path of a camera,
    text of a GStreamer pipeline, folder or log of a run. Raises VisionError with what was found
    and the next step.
    """
    _check(options)
    text = str(where)
    path = Path(where)
    if text.isdigit() or text.startswith("/dev/"):
        return open_camera(text, options)
    if PIPELINE_LINK in text:
        return open_pipeline(text, options)
    if path.suffix == ".mcap" or (path / "run.mcap").is_file():
        # only a log needs comms, which reading pixels does without
        from vision.log_source import LogSource

        return LogSource(path, options)
    if path.is_dir() or "%" in path.name or path.suffix.lower() in ENDINGS:
        return Pictures(path, options)
    if not path.is_file():
        raise VisionError(
            f"{path}: no such file; need a video file, a folder or printf pattern of pictures, a "
            "camera (0 or /dev/video0) or the log of a run: check the path"
        )
    return VideoFile(path, options)


def _check(options: SourceOptions) -> None:
    rate_hz, from_s, to_s = options.rate_hz, options.from_s, options.to_s
    if rate_hz is not None and not 0.0 < rate_hz <= MAX_RATE_HZ:
        raise VisionError(
            f"rate {rate_hz:g} Hz; must be more than 0 and at most {MAX_RATE_HZ:g}: give the rate "
            "at which the frames were taken"
        )
    if from_s is not None and to_s is not None and not from_s < to_s:
        raise VisionError(f"from {from_s:g} s to {to_s:g} s; must be a range: exchange the two")


def red_plane(image: Image) -> Image:
    """Extract the red plane of a blue-green-red image; a single plane is returned unchanged.

    (height, width, 3) -> contiguous (height, width).
    """
    if image.ndim == 2:
        return image
    return np.asarray(cv2.extractChannel(image, RED), np.uint8)
