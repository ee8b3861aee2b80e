"""The table `[vision]` of an experiment: what the trackers believe of their cameras."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from comms.channels import MAX_CAMERAS
from rig.run.toml_file import Section

Pixel = Annotated[float, Meta(ge=-1e5, le=1e5)]
Scale = Annotated[float, Meta(gt=0, le=1e6)]  # pixels per metre
Distance = Annotated[float, Meta(ge=0.01, le=1000)]


class CameraBelief(Section, frozen=True, kw_only=True):
    """`[[vision.cameras]]`: one camera; what is left out is that of [vision] and [camera]."""

    plane: Literal["x", "y"] = "x"  # of the swing that it sees
    calibration: str | None = None
    camera: str | None = None
    rough_pivot_px: tuple[Pixel, Pixel] | None = None
    rough_pixels_per_m: Scale | None = None
    rate_hz: Annotated[float, Meta(ge=0, le=200)] = 0.0  # 0 = that of [camera]
    camera_distance_m: Distance | None = None


class VisionSection(Section, frozen=True, kw_only=True):
    """`[vision]`: settings of the tracker.

    camera: a file of `rig calibrate camera`, or "none". calibration: a file, "shipped" (with a
    camera file: no offsets), or "none" (rough_* are used then). camera_distance_m: from the camera
    to the plane of the swing; with it the pitch that the calibration shows is corrected to the
    second order. rows: of the picture that are used, from the top, 0 for all: those above a joint
    of the load. cameras: in the order of [[bench.cameras]]; without them there is one camera, in
    the plane x.
    """

    camera: str = "none"
    calibration: str = "shipped"
    rows: Annotated[int, Meta(ge=0, le=4096)] = 0
    average_frames: Annotated[int, Meta(ge=1, le=50)] = 3
    processing_ms: Annotated[float, Meta(ge=0, le=1000)] = 2.0
    rough_pivot_px: tuple[Pixel, Pixel] = (321.0, -38.0)  # estimated without calibration
    rough_pixels_per_m: Scale = 1005.0
    camera_distance_m: Distance | None = None
    cameras: Annotated[list[CameraBelief], Meta(max_length=MAX_CAMERAS)] = []
