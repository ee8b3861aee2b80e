"""Files of `rig track`: table, log and overlay video."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from comms.mcap_log import LogWriter
from comms.messages import AngleSample, InvalidReason, LinkAngle, SwingPlane
from rig.errors import ConfigError
from rig.ui.plots.picture_file import check_folder
from vision.first_look import Look
from vision.tracked import TrackedFrame, TrackedPicture
from vision.view import Point

NS_PER_S = 1e9
MAX_MISS_PX = 1e4  # of the wire
OVERLAY_CODECS = {".avi": "MJPG", ".mkv": "MJPG", ".mp4": "mp4v"}
DEFAULT_RATE_HZ = 25.0
AXIS_COLOUR, REFUSED_COLOUR, PIVOT_COLOUR = (60, 180, 60), (60, 60, 220), (220, 120, 30)
ANGLE_TOPIC = "/angle_1"  # as in the log of a run


def write_table(path: Path, rows: Sequence[TrackedFrame], more: dict[str, list[Any]]) -> None:
    """Write a CSV file, one row a frame; more: further columns by name."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*TrackedFrame._fields, *more])
        for index, row in enumerate(rows):
            added = [column[index] for column in more.values()]
            writer.writerow([_cell(value) for value in (*row, *added)])


def _cell(value: object) -> object:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else value


def write_log(
    path: Path, tracked: Sequence[tuple[TrackedFrame, Point | None]], about: dict[str, str]
) -> None:
    """Write an MCAP file of angle samples, as in the log of a run.

    tracked: frames with the upper end of the cable in the view. Run time 0 is the first frame of
    the file.
    """
    writer = LogWriter(path, about, 0)
    for seq, (row, joint_px) in enumerate(tracked):
        t_ns = round(max(row.t_s, 0.0) * NS_PER_S)
        writer.write(ANGLE_TOPIC, _sample(seq, t_ns, row, joint_px), t_ns, t_ns, seq)
    writer.close({})


def _sample(seq: int, t_ns: int, row: TrackedFrame, joint_px: Point | None) -> AngleSample:
    links: tuple[LinkAngle, ...] = ()
    raw_rad = row.raw_rad
    if row.angle_rad is not None and row.sigma_rad is not None and raw_rad is not None:
        link = LinkAngle(
            angle_rad=row.angle_rad,
            sigma_rad=row.sigma_rad,
            raw_rad=raw_rad,
            offset_rad=raw_rad - row.angle_rad,
            joint_px=joint_px,
        )
        links = (link,)
    if links and row.lower_rad is not None and row.lower_sigma_rad is not None:
        lower = LinkAngle(
            angle_rad=row.lower_rad,
            sigma_rad=row.lower_sigma_rad,
            raw_rad=row.lower_rad,
            offset_rad=0.0,
            joint_px=_joint(row),
        )
        links = (*links, lower)
    miss_px = row.pivot_miss_px
    return AngleSample(
        seq=seq,
        t_ns=t_ns,
        t_valid_ns=t_ns,
        swing_plane=SwingPlane.X,
        valid=bool(links),
        reason=InvalidReason(row.reason),
        platform_m=None,
        rows=row.rows,
        residual_px=row.residual_px,
        pivot_miss_px=miss_px if miss_px is None or abs(miss_px) < MAX_MISS_PX else None,
        background=0.0,
        saturation=0.0,
        links=links,
    )


def _joint(row: TrackedFrame) -> Point | None:
    if row.joint_x_px is None or row.joint_y_px is None:
        return None
    return row.joint_x_px, row.joint_y_px


class OverlayVideo:
    """Video of the pictures with the axis found drawn over them."""

    def __init__(self, path: Path, look: Look, rate_hz: float | None) -> None:
        """rate_hz: of the source; None where it states none."""
        self._path = path
        self._look = look
        self._rate_hz = rate_hz or DEFAULT_RATE_HZ
        self._writer: cv2.VideoWriter | None = None

    def add(self, tracked: TrackedPicture) -> None:
        """Draw a frame and write it."""
        image = tracked.source.image
        picture = np.ascontiguousarray(image)
        if image.ndim == 2:
            picture = np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8)
        else:
            picture = picture.copy()
        self._draw(picture, tracked)
        if self._writer is None:
            self._writer = self._open(picture.shape[1], picture.shape[0])
        self._writer.write(picture)

    def close(self) -> None:
        """Complete the file."""
        if self._writer is not None:
            self._writer.release()

    def _open(self, width: int, height: int) -> cv2.VideoWriter:
        codec = cv2.VideoWriter.fourcc(*OVERLAY_CODECS[self._path.suffix])
        writer = cv2.VideoWriter(str(self._path), codec, self._rate_hz, (width, height))
        if not writer.isOpened():
            raise ConfigError(
                f"--overlay {str(self._path)!r}: OpenCV cannot write it; must be a file in one of "
                f"{', '.join(OVERLAY_CODECS)}: try another ending"
            )
        return writer

    def _draw(self, picture: np.ndarray[Any, np.dtype[np.uint8]], tracked: TrackedPicture) -> None:
        fit, row = tracked.fit, tracked.row
        colour = AXIS_COLOUR if row.valid else REFUSED_COLOUR
        if fit.line_px is not None:
            intercept, slope = fit.line_px
            first, last = (
                self._place((intercept + slope * v, v)) for v in (fit.first_row, fit.last_row)
            )
            cv2.line(picture, first, last, colour, 1, cv2.LINE_AA)
        if self._look.pivot is not None:
            place = self._place(self._look.pivot.at_px)
            cv2.drawMarker(picture, place, PIVOT_COLOUR, cv2.MARKER_CROSS, 15, 1)
        text = f"{row.frame}  {row.t_s:.3f} s  {row.reason}"
        if row.angle_rad is not None:
            text = f"{row.frame}  {row.t_s:.3f} s  {1e3 * row.angle_rad:+.2f} mrad"
        cv2.putText(picture, text, (8, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv2.LINE_AA)

    def _place(self, point: Point) -> tuple[int, int]:
        x, y = self._look.view.to_picture(point, self._look.size)
        limit = 30_000.0  # of the drawing functions
        return round(min(max(x, -limit), limit)), round(min(max(y, -limit), limit))


def check_overlay(path: Path) -> None:
    """Check ending and folder of an overlay video; raises ConfigError."""
    check_folder("--overlay", path)
    if path.suffix not in OVERLAY_CODECS:
        raise ConfigError(
            f"--overlay {str(path)!r}; must end in one of {', '.join(OVERLAY_CODECS)}: rename it"
        )


def check_log(path: Path) -> None:
    """Check the name of a log; raises ConfigError."""
    check_folder("--mcap", path)
    if path.suffix != ".mcap":
        raise ConfigError(f"--mcap {str(path)!r}; must end in .mcap: rename it")
