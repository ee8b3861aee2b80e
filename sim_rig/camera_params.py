"""Parameters of a simulated camera: pose, optics, shutter, sensor, light, objects and faults.

Grey levels are those of the sensor at gain 1, 0 to 255. Bounds are checked at decoding.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from sim_rig.camera_objects import Knots, LoadInPicture, PictureObject, Shadow

MAX_OBJECTS = 20
DRIFTING = (Shadow, LoadInPicture, Knots)  # objects that a drifting lens moves with the cable
Coefficient = Annotated[float, Meta(ge=-5.0, le=5.0)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Shift = Annotated[float, Meta(ge=-50.0, le=50.0)]
Instant = Annotated[float, Meta(ge=0.0, le=1e5)]
Factor = Annotated[float, Meta(ge=0.0, le=10.0)]
Drift = Annotated[float, Meta(ge=-0.05, le=0.05)]
Gradient = Annotated[float, Meta(ge=-1.9, le=1.9)]


class LensParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Lens (`[bench.camera.lens]`): distortion of Brown and Conrady, with the signs of OpenCV."""

    k1: Coefficient = 0.0
    k2: Coefficient = 0.0
    k3: Coefficient = 0.0
    p1: Coefficient = 0.0
    p2: Coefficient = 0.0
    # shift of the optical axis from the centre of the image, right and down
    centre_px: tuple[
        Annotated[float, Meta(ge=-2000, le=2000)], Annotated[float, Meta(ge=-2000, le=2000)]
    ] = (0.0, 0.0)
    # focal length along the rows over the one along the columns
    aspect: Annotated[float, Meta(ge=0.5, le=2.0)] = 1.0


class SensorParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Sensor and its processing (`[bench.camera.sensor]`), in the order of the keys.

    red_plane: the red plane of a camera before a red screen, as in the source rig; grey: one plane;
    colour: three planes; bayer: a mosaic RGGB, interpolated to three planes.
    """

    kind: Literal["red_plane", "grey", "colour", "bayer"] = "red_plane"
    shot: Annotated[float, Meta(ge=0.0, le=100.0)] = 0.0  # variance of the noise per grey level
    row_noise: Annotated[float, Meta(ge=0.0, le=64.0)] = 0.0  # standard deviation, grey levels
    gain: Annotated[float, Meta(ge=0.01, le=100.0)] = 1.0
    gamma: Annotated[float, Meta(ge=0.2, le=5.0)] = 1.0  # level^(1 / gamma)
    denoise_px: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.0  # Gaussian filter in the camera
    jpeg: Annotated[int, Meta(ge=0, le=100)] = 0  # quality; 0 = not compressed


class LightStep(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Change of the light (`[[bench.camera.light.steps]]`) at an instant."""

    at_s: Instant
    level: Factor  # from then on


class LightParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Light (`[bench.camera.light]`): factors of the screen, and light from the side.

    The screen has level x (1 + gradient) x (1 + drift sin) x (1 + flicker sin).
    """

    level: Factor = 1.0
    steps: tuple[LightStep, ...] = ()
    # change from the left edge to the right, and from top to bottom, about the centre
    gradient: tuple[Gradient, Gradient] = (0.0, 0.0)
    drift: Share = 0.0
    drift_s: Annotated[float, Meta(gt=0.0, le=1e5)] = 60.0  # period
    flicker: Share = 0.0
    flicker_hz: Annotated[float, Meta(gt=0.0, le=1e4)] = 100.0
    # light on the right flank of the cable, from none at the pivot to this at the bottom of the
    # image, grey levels; does not depend on the level of the screen
    flank: Annotated[float, Meta(ge=0.0, le=255.0)] = 0.0


class Interval(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Interval of time; counted, as all times of a camera, from the start of the simulation."""

    from_s: Instant
    to_s: Instant


class CameraFaults(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Faults of single frames (`[bench.camera.faults]`): shares of the frames, by chance."""

    dropped: Share = 0.0  # not sent
    duplicated: Share = 0.0  # the picture before, with the time of this one
    damaged: Share = 0.0  # a band of rows shifted and overwritten
    frozen: tuple[Interval, ...] = ()  # `[[bench.camera.faults.frozen]]`: one picture throughout


class CameraParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Camera before a screen (`[bench.camera]`, or `[[bench.cameras]]` for one to three).

    Without shift it stands distance_m before the home position and pivot_above_axis_m below the
    pivot. Raises ValueError for a camera behind the screen, and for a drift of its gain with
    objects that do not follow the cable.
    """

    # plane of the swing that it sees: x from the front, +x right; y from the right side, +y right
    plane: Literal["x", "y"] = "x"
    pitch_deg: Annotated[float, Meta(ge=-45.0, le=45.0)] = 1.0  # positive looks down
    yaw_deg: Annotated[float, Meta(ge=-60.0, le=60.0)] = 0.0  # positive looks to the right
    roll_deg: Annotated[float, Meta(ge=-180.0, le=180.0)] = 0.0  # positive turns clockwise
    shift_m: tuple[Shift, Shift, Shift] = (0.0, 0.0, 0.0)  # right, ahead, up; before it is turned
    noise: Annotated[float, Meta(ge=0.0, le=64.0)] = 2.5  # standard deviation, grey levels
    psf_px: Annotated[float, Meta(ge=0.2, le=20.0)] = 0.8  # standard deviation of the lens blur
    exposure_ms: Annotated[float, Meta(ge=0.0, le=1000.0)] = 10.0
    # in the plane of the home position
    pixels_per_m: Annotated[float, Meta(ge=10.0, le=20000.0)] = 1000.0
    cable_width_px: Annotated[float, Meta(ge=0.1, le=100.0)] = 2.5
    # change of the horizontal magnification, linear in time: by this share of that at the start
    # over each 24 s from the start of the simulation, about the column of the optical axis
    gain_drift_rel: Drift = 0.0
    # from the centre of the camera to the plane of the home position
    distance_m: Annotated[float, Meta(ge=0.1, le=50.0)] = 1.0
    # height of the pivot over the optical axis of the camera that is not turned
    pivot_above_axis_m: Annotated[float, Meta(ge=-10.0, le=10.0)] = 0.28
    screen_m: Annotated[float, Meta(gt=0.0, le=50.0)] = 1.0  # from that plane on to the screen
    background: Annotated[float, Meta(ge=0.0, le=255.0)] = 200.0
    # background minus grey level of a wide cable; negative: a bright cable
    contrast: Annotated[float, Meta(ge=-255.0, le=255.0)] = 165.0
    # blue, green and red of the screen over background, and of the cable over its grey level
    screen_colour: tuple[Share, Share, Share] = (0.2, 0.2, 1.0)
    cable_colour: tuple[Factor, Factor, Factor] = (1.0, 1.0, 1.0)
    name: Annotated[str, Meta(pattern=r"^[A-Za-z0-9_-]{1,16}\Z")] = "red_plane"
    rate_hz: Annotated[float, Meta(ge=0.0, le=1000.0)] = 0.0  # 0 = that of [camera]
    row_us: Annotated[float, Meta(ge=0.0, le=1e5)] = 0.0  # rolling shutter: from row to row
    jitter_us: Annotated[float, Meta(ge=0.0, le=1e5)] = 0.0  # of the trigger, not in the stamp
    lens: LensParams = LensParams()
    sensor: SensorParams = SensorParams()
    light: LightParams = LightParams()
    objects: Annotated[tuple[PictureObject, ...], Meta(max_length=MAX_OBJECTS)] = ()
    faults: CameraFaults = CameraFaults()

    @property
    def focal_px(self) -> float:
        """Focal length along the columns."""
        return self.pixels_per_m * self.distance_m

    def __post_init__(self) -> None:
        ahead_m = self.shift_m[1]
        bound_m = self.distance_m + self.screen_m
        if ahead_m >= bound_m:
            raise ValueError(
                f"shift_m = {list(self.shift_m)} puts the camera behind the screen; the second "
                f"value must be < {bound_m:g} m, distance_m + screen_m: move the camera back"
            )
        if self.gain_drift_rel and not all(isinstance(item, DRIFTING) for item in self.objects):
            raise ValueError(
                f"gain_drift_rel = {self.gain_drift_rel:g} with objects that do not follow the "
                "cable; must be 0 with others than shadow, load and knots, as they would stay "
                "where they are: remove them, or the drift"
            )
