"""Static scene of a calibration: the picture without the cable, from the pictures of the tour."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np

from comms.messages import AngleSample
from rig.errors import ConfigError
from rig.run.calibration.file import Calibration
from vision.cable_lines import cable_lines, static_scene
from vision.errors import VisionError
from vision.log_source import LogSource
from vision.sources import red_plane
from vision.static_scene import StaticScene
from vision.stream import SourceOptions

PICTURES = 40  # of the tour
MIN_PICTURES = 10
MIN_CLEAR_SHARE = 0.8  # of the rows of a cable
SUFFIX = "_static"  # of the name of the picture


def scene_of_tour(log: Path) -> StaticScene | None:
    """Compute what never moves in the pictures in the log of a tour; None of too few pictures.

    The log keeps JPEG: the median over pictures with the cable at different places is right
    to 0.6 grey levels rms beside lines, too. Noise is smoothed, edges are kept.
    """
    try:
        frames = LogSource(log, SourceOptions()).spread(PICTURES)
    except VisionError:
        return None  # a log without pictures
    pictures = [red_plane(frame.image) for frame in frames]
    if len(pictures) < MIN_PICTURES:
        return None
    found = cable_lines(pictures)
    return static_scene(found.median, found.reach_px)


def is_before_structure(sample: AngleSample, scene: StaticScene) -> bool:
    """Tell if the cable of an angle hangs before something static in many of its rows."""
    if sample.cable is None or sample.cable.joint_px is None:
        return False
    height, width = scene.picture.shape
    column_px, row_px = sample.cable.joint_px
    rows = np.arange(max(0, math.ceil(row_px)), height)
    columns = column_px + math.tan(sample.cable.raw_rad) * (rows - row_px)
    seen = (columns >= 0.0) & (columns < width - 1)
    if not seen.any():
        return False
    free = scene.is_free(rows[seen], columns[seen])
    return bool(free.mean() < MIN_CLEAR_SHARE)


def save(scene: StaticScene, calibration: Path) -> str:
    """Write the picture beside a calibration file; return its name."""
    path = calibration.with_name(f"{calibration.stem}{SUFFIX}.png")
    path.parent.mkdir(parents=True, exist_ok=True)
    _, data = cv2.imencode(".png", scene.picture)
    path.write_bytes(data.tobytes())
    return path.name


def find(name: str, calibration: Calibration | None) -> bytes | None:
    """Read the picture, as PNG, of the calibration file of that name; None where it has none.

    Raises ConfigError for a missing or damaged one, and for one of another size.
    """
    if calibration is None or calibration.static_scene is None:
        return None
    path = Path(name).parent / calibration.static_scene
    what = f"static_scene = '{path}' of calibration '{name}'"
    again = "calibrate again, or remove the key static_scene"
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(
            f"{what}: {error.strerror}; must be the picture that `rig calibrate offsets` wrote: "
            f"copy it to the calibration file, {again}"
        ) from None
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if picture is None or picture.ndim != 2 or picture.dtype != np.uint8:
        raise ConfigError(f"{what} is not a grey picture of 8 bits; must be a whole PNG: {again}")
    size = (picture.shape[1], picture.shape[0])
    expected = (calibration.width, calibration.height)
    if size != expected:
        raise ConfigError(
            f"{what} is a picture of {size}; must be {expected} as the calibration: {again}"
        )
    return data
