"""The truth about the simulated rig: what the world is, never what a planner or tracker believes.

Each struct holds exactly the keys of one section of the experiment file. Bounds are checked where the file is decoded
(msgspec.convert), which names section, key, value and bound.
"""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from comms.messages import Position


class PendulumParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """[bench.pendulum]: a point load on a massless cable; damping and frequency of the source rig (source 004, section 3.3)."""

    length_m: Annotated[float, Meta(ge=0.01, le=20.0)] = 1.0  # pivot to centre of the load
    mass_kg: Annotated[float, Meta(gt=0.0, le=100.0)] = 0.7  # the stiff servos do not feel it
    damping_ratio: Annotated[float, Meta(ge=0.0, lt=1.0)] = 0.000237
    initial_swing_rad: Annotated[float, Meta(ge=-1.5, le=1.5)] = (
        0.0  # released from rest at this angle
    )
    gravity_m_s2: Annotated[float, Meta(gt=0.0, le=30.0)] = 9.81


class RobotParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """[bench.robot]: the position loop of each Cartesian axis; the defaults rise from 10 to 90 % in 31 ms."""

    bandwidth_hz: Annotated[float, Meta(ge=0.1, le=200.0)] = 11.0  # -3 dB
    damping: Annotated[float, Meta(ge=0.05, le=5.0)] = 0.9
    start_m: Annotated[float, Meta(ge=-10.0, le=10.0)] = (
        0.0  # where along X the platform stands when the world begins
    )


class CameraParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """[bench.camera]: where the camera stands and how it sees a dark cable on a bright screen."""

    pitch_deg: Annotated[float, Meta(ge=-45.0, le=45.0)] = 1.0  # positive looks down
    noise: Annotated[float, Meta(ge=0.0, le=64.0)] = 2.5  # standard deviation, grey levels
    psf_px: Annotated[float, Meta(ge=0.2, le=20.0)] = 0.8  # standard deviation of the lens blur
    exposure_ms: Annotated[float, Meta(ge=0.0, le=1000.0)] = 10.0
    pixels_per_m: Annotated[float, Meta(ge=10.0, le=20000.0)] = (
        1000.0  # in the plane of the home position
    )
    cable_width_px: Annotated[float, Meta(ge=0.1, le=100.0)] = 2.5
    distance_m: Annotated[float, Meta(ge=0.1, le=50.0)] = (
        1.0  # from the camera's centre to the home position's plane
    )
    pivot_above_axis_m: Annotated[float, Meta(ge=-10.0, le=10.0)] = (
        0.28  # cable's upper end over the unpitched optical axis
    )
    background: Annotated[float, Meta(ge=0.0, le=255.0)] = 200.0
    contrast: Annotated[float, Meta(ge=0.0, le=255.0)] = 165.0  # how much darker a wide cable is
    name: Annotated[str, Meta(pattern=r"^[A-Za-z0-9_-]{1,16}$")] = "red_plane"


class View(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """[camera]: facts of the picture that bench and tracker share."""

    width: Annotated[int, Meta(ge=16, le=8192)] = 640
    height: Annotated[int, Meta(ge=16, le=8192)] = 480
    rate_hz: Annotated[float, Meta(ge=0.0, le=1000.0)] = 50.0  # 0 = no camera


class BenchParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The whole simulated world; raises ValueError when an exposure would outlast its frame period."""

    pendulum: PendulumParams = PendulumParams()
    robot: RobotParams = RobotParams()
    camera: CameraParams = CameraParams()
    view: View = View()
    home_m: Position = (0.0, 0.0, 0.0)  # before the camera
    seed: Annotated[int, Meta(ge=0)] = 0  # of the picture noise

    @property
    def start_m(self) -> Position:
        """Where the platform stands when the world begins."""
        return (self.home_m[0] + self.robot.start_m, self.home_m[1], self.home_m[2])

    def __post_init__(self) -> None:
        if self.view.rate_hz * self.camera.exposure_ms > 1000.0:
            raise ValueError(
                f"exposure_ms = {self.camera.exposure_ms} in [bench.camera] outlasts the frame period of "
                f"{1000.0 / self.view.rate_hz:g} ms: shorten it or lower rate_hz in [camera]"
            )
