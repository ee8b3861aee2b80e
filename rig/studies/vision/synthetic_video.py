"""Synthetic video and its true angles as files: both complete, or neither."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import cv2

from rig.errors import ConfigError
from rig.run.config import Experiment
from rig.studies.vision import bench

CODECS = {".avi": "FFV1", ".mkv": "FFV1", ".mp4": "mp4v"}  # FFV1 is lossless


def write_video(
    experiment: Experiment,
    seconds: float,
    video: Path,
    truth: Path,
    progress: Callable[[int], None],
) -> int:
    """Render a load swinging freely at home; return the number of frames.

    Columns of truth: frame, t_s (time of the video, frame / rate), angle_rad at mid-exposure of
    that frame. Existing files are replaced only at the end. Raises ConfigError for an ending
    without codec, a camera without frame rate, a place that cannot be written.
    """
    if video.suffix not in CODECS:
        raise ConfigError(
            f"--video {video}: ending '{video.suffix}' is not known; use one of {', '.join(CODECS)}"
        )
    rate_hz = experiment.camera.rate_hz
    if rate_hz == 0:
        raise ConfigError("[camera] rate_hz = 0: no pictures to write; set it to 50")
    size = (experiment.camera.width, experiment.camera.height)
    codec = cv2.VideoWriter.fourcc(*CODECS[video.suffix])
    new_video = video.with_name(f".new-{video.name}")
    new_truth = truth.with_name(f".new-{truth.name}")
    frames = 0
    with new_truth.open("w", newline="") as file:
        writer = cv2.VideoWriter(str(new_video), codec, rate_hz, size)
        if not writer.isOpened():
            new_truth.unlink()
            raise ConfigError(
                f"--video {video}: cannot be written; is the folder there and writable?"
            )
        rows = csv.writer(file)
        rows.writerow(["frame", "t_s", "angle_rad"])
        for frame, _, angle_rad, picture in bench.synthetic_video(experiment, seconds):
            writer.write(picture)
            rows.writerow([frame, f"{frame / rate_hz:.9f}", f"{angle_rad:.12g}"])
            frames = frame + 1
            progress(frames)
        writer.release()
    new_video.replace(video)
    new_truth.replace(truth)
    return frames
