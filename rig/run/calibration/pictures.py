"""Pictures for a calibration of the camera, and the places of the marks in them."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from rig.errors import ConfigError
from rig.run.toml_file import read_text
from vision.errors import VisionError
from vision.line_fit import Grey
from vision.sources import open_source, red_plane

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".webp")
PLACE_COLUMNS = ["x_m", "y_m", "z_m"]


def read_pictures(paths: Sequence[Path]) -> Iterator[tuple[str, Grey]]:
    """Read the red planes of pictures, of all pictures of folders, and of videos, with names.

    The tracker measures in the red plane. Raises ConfigError for a file that is neither.
    """
    for path in paths:
        if path.is_dir():
            found = sorted(one for one in path.iterdir() if one.suffix.lower() in PICTURES)
            if not found:
                raise ConfigError(
                    f"'{path}': a folder without pictures; must have {', '.join(PICTURES)}: name "
                    "another folder, a video or pictures"
                )
            for one in found:
                yield one.name, _read_picture(one)
        elif path.suffix.lower() in PICTURES:
            yield path.name, _read_picture(path)
        else:
            yield from _read_video(path)


def _read_picture(path: Path) -> Grey:
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR) if path.is_file() else None
    if picture is None:
        raise ConfigError(
            f"'{path}': no picture that OpenCV can read; must be {', '.join(PICTURES)} or a video: "
            "check the path"
        )
    return red_plane(np.asarray(picture, np.uint8))


def _read_video(path: Path) -> Iterator[tuple[str, Grey]]:
    try:
        for frame in open_source(path).frames():
            yield f"frame {frame.number}", red_plane(frame.image)
    except VisionError as error:
        raise ConfigError(str(error)) from None


def mean_picture(pictures: Iterator[tuple[str, Grey]]) -> Grey:
    """Average pictures of a scene at rest, against noise. Raises ConfigError for other sizes."""
    total: NDArray[np.float64] | None = None
    count = 0
    for name, picture in pictures:
        if total is None:
            total = np.zeros(picture.shape)
        if picture.shape != total.shape:
            raise ConfigError(
                f"{name}: {picture.shape[1]} x {picture.shape[0]} px; must be "
                f"{total.shape[1]} x {total.shape[0]} as those before: name pictures of one size"
            )
        total += picture
        count += 1
    if total is None:
        raise ConfigError("no picture of the marks; must be one at least: name another file")
    return np.asarray(np.rint(total / count), np.uint8)


def read_places(path: Path) -> NDArray[np.float64]:
    """Read the places (N, 3) of the marks: a header x_m,y_m,z_m and a line for each mark.

    Raises ConfigError naming file, line and entry.
    """
    lines = read_text(path, "places of the marks").splitlines()
    kept = [k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(lines[k] for k in kept))
    header = [name.strip() for name in rows[0]] if rows else []
    if header != PLACE_COLUMNS:
        raise ConfigError(
            f"places of the marks '{path}': header {','.join(header)}; must be "
            f"{','.join(PLACE_COLUMNS)}: x right, y ahead, z up from the pivot at home"
        )
    places = []
    for k, row in zip(kept[1:], rows[1:], strict=True):
        places.append(_place(path, k + 1, row))
    return np.array(places, dtype=np.float64).reshape(-1, 3)


def _place(path: Path, line: int, row: Sequence[str]) -> list[float]:
    try:
        numbers = [float(word) for word in row]
    except ValueError:
        numbers = []
    if len(numbers) != len(PLACE_COLUMNS) or not all(map(math.isfinite, numbers)):
        raise ConfigError(
            f"places of the marks '{path}', line {line}: {','.join(row)}; must be three finite "
            f"numbers {','.join(PLACE_COLUMNS)} in metres: correct that line"
        )
    return numbers
