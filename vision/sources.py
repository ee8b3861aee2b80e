"""Sources of frames: what the user names, opened as what it is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from vision.errors import VisionError
from vision.stream import FrameSource, Image, SourceOptions
from vision.video_file import VideoFile

DEFAULT_OPTIONS = SourceOptions()
RED = 2  # OpenCV orders blue, green, red


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
    """Read the red planes of a video file; raises VisionError before the first frame."""
    source = open_source(path)
    return (VideoFrame(f.number, f.t_s, red_plane(f.image)) for f in source.frames())


def red_plane(image: Image) -> Image:
    """Extract the red plane of a blue-green-red image; a single plane is returned unchanged.

    (height, width, 3) -> contiguous (height, width).
    """
    if image.ndim == 2:
        return image
    return np.asarray(cv2.extractChannel(image, RED), np.uint8)
