"""Frames of a source with the angle measured in each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from vision.cable_geometry import CableGeometry
from vision.camera_model import SeenLine, Vector
from vision.fit import Fit, LowerLink, TrackFailure
from vision.fitted_line import readout_bend_px, readout_rows, seen_line
from vision.offset_table import OffsetTable
from vision.stream import PictureFault, SourceFrame
from vision.video_tracker import VideoTracker
from vision.view import Point

FAULT_REASONS = (
    (PictureFault.DAMAGED, TrackFailure.DAMAGED),
    (PictureFault.FROZEN, TrackFailure.FROZEN),
    (PictureFault.DUPLICATE, TrackFailure.DUPLICATE),
)
REPEATED = (TrackFailure.FROZEN, TrackFailure.DUPLICATE)


class CameraPlacement(NamedTuple):
    """Calibrated camera, and where the platform stands while it is filmed."""

    geometry: CableGeometry
    position_m: Vector
    axis: int  # of the swing plane: 0 for x, 1 for y
    offsets: OffsetTable | None = None

    def pivot_px(self) -> Point:
        """Predict the pivot in the picture."""
        return self.geometry.pivot_px(self.position_m)


class MeasureOptions(NamedTuple):
    """Choices for the measurement of a video."""

    pivot_px: Point | None = None  # None: that of the first look
    placement: CameraPlacement | None = None  # None: the angles are those in the picture
    row_s: float = 0.0  # between the rows of a rolling shutter
    at_rest: bool = False  # a picture may equal the one before: the cable hangs still


class TrackedFrame(NamedTuple):
    """Result of one frame; angles and sigmas are None in a frame that is not valid."""

    frame: int
    t_s: float
    stamp: str  # origin of t_s, as in StampKind
    angle_rad: float | None  # of the cable with a calibration, else that in the picture
    sigma_rad: float | None
    valid: bool
    reason: str
    rows: int
    first_row: int
    last_row: int
    residual_px: float | None
    pivot_miss_px: float | None
    bend_px: float
    sigma_bend_px: float
    plane: str
    raw_rad: float | None  # angle in the picture
    lower_rad: float | None  # of a second link
    lower_sigma_rad: float | None
    joint_x_px: float | None  # between the two links
    joint_y_px: float | None


class TrackedPicture(NamedTuple):
    """Result of one frame with its picture and all facts of the fit."""

    row: TrackedFrame
    source: SourceFrame
    fit: Fit
    line: SeenLine | None  # in the whole picture, of a valid frame


class _Angles(NamedTuple):
    angle_rad: float | None = None
    sigma_rad: float | None = None
    raw_rad: float | None = None
    lower_rad: float | None = None
    lower_sigma_rad: float | None = None
    joint_px: Point | None = None


def tracked_frames(
    frames: Iterable[SourceFrame], tracker: VideoTracker, chosen: MeasureOptions
) -> Iterator[TrackedPicture]:
    """Measure every frame; one with a fault of its source has the fault as its reason.

    A source that knows the pivot of each frame is asked first.
    """
    plane = "red" if tracker.look is None else tracker.look.view.plane
    for frame in frames:
        pivot_px = chosen.pivot_px if frame.pivot_px is None else frame.pivot_px
        fit = tracker.measure(frame.image, pivot_px)
        reason = _reason(fit, frame, chosen.at_rest)
        valid = reason is TrackFailure.NONE
        line = _line(fit, tracker, pivot_px) if valid else None
        angles = _Angles() if line is None else _angles(fit, line, tracker, chosen.placement)
        delay_s = 0.0 if line is None else chosen.row_s * readout_rows(line)
        row = TrackedFrame(
            frame=frame.number,
            t_s=frame.t_s + delay_s,
            stamp=frame.stamp.value,
            angle_rad=angles.angle_rad,
            sigma_rad=angles.sigma_rad,
            valid=valid,
            reason=reason.value,
            rows=fit.rows,
            first_row=fit.first_row,
            last_row=fit.last_row,
            residual_px=fit.residual_px,
            pivot_miss_px=fit.pivot_miss_px,
            bend_px=float(fit.bend_px),
            sigma_bend_px=float(fit.sigma_bend_px),
            plane=plane,
            raw_rad=angles.raw_rad,
            lower_rad=angles.lower_rad,
            lower_sigma_rad=angles.lower_sigma_rad,
            joint_x_px=None if angles.joint_px is None else angles.joint_px[0],
            joint_y_px=None if angles.joint_px is None else angles.joint_px[1],
        )
        yield TrackedPicture(row, frame, fit, line)


def without_readout_bend(rows: Sequence[TrackedFrame], row_s: float) -> list[TrackedFrame]:
    """Subtract the bend of a rolling shutter; what is left is that of the cable.

    The rate of the slope is that of the neighbours. A frame without a valid one on each side keeps
    its bend.
    """
    found = list(rows)
    for index in range(1, len(rows) - 1):
        before, row, after = rows[index - 1], rows[index], rows[index + 1]
        if before.raw_rad is None or row.raw_rad is None or after.raw_rad is None:
            continue
        interval_s = after.t_s - before.t_s
        if interval_s <= 0.0:
            continue
        rate_1_s = (math.tan(after.raw_rad) - math.tan(before.raw_rad)) / interval_s
        line = SeenLine(0.0, 0.0, row.raw_rad, row.first_row, row.last_row)
        bend_px = row.bend_px - readout_bend_px(line, rate_1_s, row_s)
        found[index] = row._replace(bend_px=bend_px)
    return found


def _reason(fit: Fit, frame: SourceFrame, at_rest: bool) -> TrackFailure:
    for fault, its_reason in FAULT_REASONS:
        if fault in frame.faults and not (at_rest and its_reason in REPEATED):
            return its_reason
    return fit.reason


def _line(fit: Fit, tracker: VideoTracker, pivot_px: Point | None) -> SeenLine | None:
    """Compose the fitted line in the pixels of the whole picture; the view is not turned."""
    gate_px = tracker.gate_px(pivot_px)
    if fit.angle_rad is None or gate_px is None:
        return None
    return _moved(seen_line(fit, fit.angle_rad, gate_px, tracker.height), tracker)


def _lower_line(lower: LowerLink, tracker: VideoTracker) -> SeenLine:
    x, y = lower.joint_px
    return _moved(SeenLine(x, y, lower.angle_rad, y, tracker.height - 1.0), tracker)


def _moved(line: SeenLine, tracker: VideoTracker) -> SeenLine:
    """Convert a line of the view to one of the whole picture."""
    region = None if tracker.look is None else tracker.look.view.region
    if region is None:
        return line
    return line._replace(
        column_px=line.column_px + region.x,
        row_px=line.row_px + region.y,
        first_row=line.first_row + region.y,
        last_row=line.last_row + region.y,
    )


def _angles(
    fit: Fit, line: SeenLine, tracker: VideoTracker, placement: CameraPlacement | None
) -> _Angles:
    raw_rad, sigma_rad, lower = fit.angle_rad, fit.sigma_rad, fit.lower
    if raw_rad is None or sigma_rad is None:
        return _Angles()
    found = _Angles(raw_rad, sigma_rad, raw_rad)
    offset_rad = 0.0
    if placement is not None:
        if placement.offsets is not None:
            place_m = placement.position_m[placement.axis]
            offset_rad = placement.offsets.at(place_m, fit.background).offset_rad
        true = placement.geometry.true_angle(line, offset_rad, placement.position_m)
        found = _Angles(true.angle_rad, true.gain * sigma_rad, raw_rad)
    if lower is None:
        return found
    joint = _lower_line(lower, tracker)
    found = found._replace(joint_px=(joint.column_px, joint.row_px))
    if placement is None:
        return found._replace(lower_rad=lower.angle_rad, lower_sigma_rad=lower.sigma_rad)
    below = placement.geometry.lower_angle(joint, offset_rad, placement.position_m)
    return found._replace(lower_rad=below.angle_rad, lower_sigma_rad=below.gain * lower.sigma_rad)
