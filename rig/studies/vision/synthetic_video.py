"""Synthetic video and what is true in it, as files: both complete, or neither."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import cv2

from rig.errors import ConfigError
from rig.run.config import Experiment
from rig.studies.vision import bench
from rig.studies.vision.matroska import MatroskaWriter
from rig.studies.vision.scene import (
    Scene,
    SceneFrame,
    SceneSection,
    colour_planes,
    picture_size,
    scene_frames,
)
from rig.studies.vision.stamps import Stamps, is_kept, stamp_s

CODECS = {".avi": "FFV1", ".mkv": "FFV1", ".mp4": "mp4v"}  # FFV1 is lossless
JPEG = (cv2.IMWRITE_JPEG_QUALITY, 97, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x111111)  # 4:4:4
COLUMNS = (
    "frame",
    "t_s",
    "angle_rad",
    "picture_rad",
    "bound_rad",
    "pivot_x_px",
    "pivot_y_px",
    "true_s",
)
Progress = Callable[[int], None]


class VideoWriter(Protocol):
    """Writer of the frames of a video."""

    def add(self, t_s: float, colour: Any) -> None:
        """Write a picture (height, width, 3) with its time stamp."""

    def close(self) -> None:
        """Complete the file."""


class VideoFiles(NamedTuple):
    """Files of a synthetic video, and the kind of its time stamps."""

    video: Path
    truth: Path
    stamps: Stamps = "cfr"


def scene_of(experiment: Experiment) -> Scene:
    """Make a scene of an experiment: its load swings freely at home before its first camera."""
    plant = bench.read_plant(experiment, 0)
    return Scene(experiment.experiment.name, SceneSection(about=""), plant)


def write_video(scene: Scene, frames: int, files: VideoFiles, progress: Progress) -> int:
    """Render the first frames of a scene; return the number of frames in the video.

    Columns of the truth: number of the frame in the video, its time stamp, true angle of the cable
    in the middle of the exposure, angle in the picture with its Cramer-Rao bound, pivot, and the
    time from the release of the load. Existing files are replaced only at the end. Raises
    ConfigError for an ending without codec and for a place that cannot be written.
    """
    _check_files(files)
    new_video = files.video.with_name(f".new-{files.video.name}")
    new_truth = files.truth.with_name(f".new-{files.truth.name}")
    written = 0
    try:
        writer = _open_writer(files, new_video, scene)
        try:
            with new_truth.open("w", newline="") as file:
                rows = csv.writer(file)
                rows.writerow(COLUMNS)
                planes = colour_planes(scene)
                for frame, t_s in _stamped_frames(scene, frames, files.stamps):
                    writer.add(t_s, planes.colour(frame.picture, frame.number))
                    rows.writerow(_row(written, t_s, frame))
                    written += 1
                    progress(frame.number + 1)
        finally:
            writer.close()
        new_video.replace(files.video)
        new_truth.replace(files.truth)
    finally:
        new_video.unlink(missing_ok=True)
        new_truth.unlink(missing_ok=True)
    return written


def _stamped_frames(
    scene: Scene, frames: int, stamps: Stamps
) -> Iterator[tuple[SceneFrame, float]]:
    """Generate the frames that are in the video, with their time stamps."""
    period_s = 1.0 / scene.rate_hz
    written = 0
    for frame in scene_frames(scene, frames):
        if not is_kept(stamps, frame.number):
            continue
        # a file of constant rate closes up over the frames that the camera dropped
        number = written if stamps == "cfr" else frame.number
        yield frame, stamp_s(stamps, number, period_s, frames)
        written += 1


def _row(number: int, t_s: float, frame: SceneFrame) -> list[object]:
    x, y = frame.pivot_px
    return [
        number,
        f"{t_s:.9f}",
        f"{frame.cable_rad:.12g}",
        _cell(frame.angle_rad, ".12g"),
        _cell(frame.bound_rad, ".6g"),
        f"{x:.4f}",
        f"{y:.4f}",
        f"{frame.t_s:.9f}",
    ]


def _cell(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def _check_files(files: VideoFiles) -> None:
    """Raise ConfigError for an ending without codec, or a folder that cannot be written."""
    known = [".mkv"] if files.stamps != "cfr" else list(CODECS)
    if files.video.suffix not in known:
        reason = "is not known" if files.stamps == "cfr" else f"with stamps '{files.stamps}'"
        raise ConfigError(
            f"--video {files.video}: ending '{files.video.suffix}' {reason}; "
            f"must be one of {', '.join(known)}: rename the file"
        )
    for option, path in (("--video", files.video), ("--truth", files.truth)):
        if not os.access(path.parent, os.W_OK):
            found = "is not writable" if path.parent.is_dir() else "does not exist"
            raise ConfigError(
                f"{option} {path}: folder '{path.parent}' {found}; must be a folder you can write "
                "to: make it or choose another"
            )


def _open_writer(files: VideoFiles, path: Path, scene: Scene) -> VideoWriter:
    width, height = picture_size(scene)
    if files.stamps != "cfr":
        return _JpegVideo(MatroskaWriter(path, width, height))
    name = CODECS[files.video.suffix]
    codec = cv2.VideoWriter.fourcc(*name)
    writer = cv2.VideoWriter(str(path), codec, scene.rate_hz, (width, height))
    if not writer.isOpened():
        raise ConfigError(
            f"--video {files.video}: this OpenCV has no encoder {name} for '{files.video.suffix}'; "
            f"must be one that it has: try one of {', '.join(CODECS)}, or --stamps vfr with .mkv"
        )
    return _CodecVideo(writer)


class _CodecVideo:
    """Video of constant rate by a codec of OpenCV."""

    def __init__(self, writer: cv2.VideoWriter) -> None:
        self._writer = writer

    def add(self, t_s: float, colour: Any) -> None:
        self._writer.write(colour)

    def close(self) -> None:
        self._writer.release()


class _JpegVideo:
    """Video of JPEG pictures with any time stamps."""

    def __init__(self, writer: MatroskaWriter) -> None:
        self._writer = writer

    def add(self, t_s: float, colour: Any) -> None:
        _, data = cv2.imencode(".jpg", colour, JPEG)
        self._writer.add(1e3 * t_s, data.tobytes())

    def close(self) -> None:
        self._writer.close()
