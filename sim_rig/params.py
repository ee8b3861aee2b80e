"""Parameters of the simulated plant, separate from the model of planner and tracker.

Each struct holds exactly the keys of one section of the experiment file. Bounds are checked where
the file is decoded (msgspec.convert), which names section, key, value and bound.
"""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from comms.messages import Position
from sim_rig.ball_screw_params import BallScrewParams
from sim_rig.drive_faults import DriveFault
from sim_rig.input_check import InputBounds
from sim_rig.joint_params import Joint
from sim_rig.load_params import MAX_LINKS, CableParams, LengthChange, LinkParams, LoadParams, Push
from sim_rig.quattro_params import QuattroParams


class PendulumParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Point load on a massless cable (`[bench.pendulum]`).

    Defaults: damping and frequency of the source rig (source 004, section 3.3).
    """

    length_m: Annotated[float, Meta(ge=0.01, le=20.0)] = 1.0  # pivot to centre of the load
    mass_kg: Annotated[float, Meta(gt=0.0, le=100.0)] = 0.7  # no effect on the stiff drives
    damping_ratio: Annotated[float, Meta(ge=0.0, lt=1.0)] = 0.000237
    # the load is released from rest at this angle
    initial_swing_rad: Annotated[float, Meta(ge=-1.5, le=1.5)] = 0.0
    gravity_m_s2: Annotated[float, Meta(gt=0.0, le=30.0)] = 9.81


class RobotParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Position loop of each Cartesian axis (`[bench.robot]`); rise time 31 ms by default."""

    bandwidth_hz: Annotated[float, Meta(ge=0.1, le=200.0)] = 11.0  # -3 dB
    damping: Annotated[float, Meta(ge=0.05, le=5.0)] = 0.9  # damping ratio
    start_m: Annotated[float, Meta(ge=-10.0, le=10.0)] = 0.0  # start position along X, from home


class CameraParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Pose and imaging of the camera, for a dark cable on a bright screen (`[bench.camera]`)."""

    pitch_deg: Annotated[float, Meta(ge=-45.0, le=45.0)] = 1.0  # positive looks down
    noise: Annotated[float, Meta(ge=0.0, le=64.0)] = 2.5  # standard deviation, grey levels
    psf_px: Annotated[float, Meta(ge=0.2, le=20.0)] = 0.8  # standard deviation of the lens blur
    exposure_ms: Annotated[float, Meta(ge=0.0, le=1000.0)] = 10.0
    # in the plane of the home position
    pixels_per_m: Annotated[float, Meta(ge=10.0, le=20000.0)] = 1000.0
    cable_width_px: Annotated[float, Meta(ge=0.1, le=100.0)] = 2.5
    # from the centre of the camera to the plane of the home position
    distance_m: Annotated[float, Meta(ge=0.1, le=50.0)] = 1.0
    # height of the pivot over the unpitched optical axis
    pivot_above_axis_m: Annotated[float, Meta(ge=-10.0, le=10.0)] = 0.28
    background: Annotated[float, Meta(ge=0.0, le=255.0)] = 200.0
    # background minus grey level of a wide cable
    contrast: Annotated[float, Meta(ge=0.0, le=255.0)] = 165.0
    name: Annotated[str, Meta(pattern=r"^[A-Za-z0-9_-]{1,16}\Z")] = "red_plane"


class View(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Image size and frame rate, common to bench and tracker (`[camera]`)."""

    width: Annotated[int, Meta(ge=16, le=8192)] = 640
    height: Annotated[int, Meta(ge=16, le=8192)] = 480
    rate_hz: Annotated[float, Meta(ge=0.0, le=1000.0)] = 50.0  # 0 = no camera


class BenchParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Parameters of the whole plant; raises ValueError if the exposure exceeds the frame period."""

    pendulum: PendulumParams = PendulumParams()
    # in place of the pendulum, from the platform down
    links: Annotated[tuple[LinkParams, ...], Meta(max_length=MAX_LINKS)] = ()
    load: LoadParams = LoadParams()  # of the links
    pushes: tuple[Push, ...] = ()
    cable: CableParams | None = None  # vibration of the cable itself
    length_changes: tuple[LengthChange, ...] = ()
    robot: RobotParams = RobotParams()
    camera: CameraParams = CameraParams()
    view: View = View()
    axis: BallScrewParams | None = None  # along X, in place of the robot
    quattro: QuattroParams | None = None  # in place of the robot
    joint: Joint | None = None  # in place of robot and load
    drive_faults: tuple[DriveFault, ...] = ()  # of its drive
    home_m: Position = (0.0, 0.0, 0.0)  # home position, before the camera
    seed: Annotated[int, Meta(ge=0)] = 0  # of the image noise
    input: InputBounds | None = None  # bounds on setpoints; None = no check

    @property
    def start_m(self) -> Position:
        """Position of the platform at the start of the simulation."""
        return (self.home_m[0] + self.robot.start_m, self.home_m[1], self.home_m[2])

    def __post_init__(self) -> None:
        if self.view.rate_hz * self.camera.exposure_ms > 1000.0:
            raise ValueError(
                f"exposure_ms = {self.camera.exposure_ms} in [bench.camera]; must be <= "
                f"{1000.0 / self.view.rate_hz:g} ms, the frame period: "
                "shorten it or lower rate_hz in [camera]"
            )
