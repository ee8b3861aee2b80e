"""Frames of a source with the angle measured in each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from vision.fit import Fit, TrackFailure
from vision.stream import PictureFault, SourceFrame
from vision.video_tracker import VideoTracker
from vision.view import Point

FAULT_REASONS = (
    (PictureFault.DAMAGED, TrackFailure.DAMAGED),
    (PictureFault.FROZEN, TrackFailure.FROZEN),
    (PictureFault.DUPLICATE, TrackFailure.DUPLICATE),
)


class TrackedFrame(NamedTuple):
    """Result of one frame; angle_rad and sigma_rad are None in a frame that is not valid."""

    frame: int
    t_s: float
    stamp: str  # origin of t_s, as in StampKind
    angle_rad: float | None
    sigma_rad: float | None
    valid: bool
    reason: str
    rows: int
    residual_px: float | None
    pivot_miss_px: float | None
    bend_px: float
    plane: str


class TrackedPicture(NamedTuple):
    """Result of one frame with its picture and all facts of the fit."""

    row: TrackedFrame
    source: SourceFrame
    fit: Fit


def tracked_frames(
    frames: Iterable[SourceFrame], tracker: VideoTracker, pivot_px: Point | None
) -> Iterator[TrackedPicture]:
    """Measure every frame; one with a fault of its source has the fault as its reason."""
    plane = "red" if tracker.look is None else tracker.look.view.plane
    for frame in frames:
        fit = tracker.measure(frame.image, pivot_px)
        reason = fit.reason
        for fault, its_reason in FAULT_REASONS:
            if fault in frame.faults:
                reason = its_reason
                break
        valid = reason is TrackFailure.NONE
        row = TrackedFrame(
            frame.number,
            frame.t_s,
            frame.stamp.value,
            fit.angle_rad if valid else None,
            fit.sigma_rad if valid else None,
            valid,
            reason.value,
            fit.rows,
            fit.residual_px,
            fit.pivot_miss_px,
            fit.bend_px,
            plane,
        )
        yield TrackedPicture(row, frame, fit)
