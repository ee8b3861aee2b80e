"""Parameters of the simulated plant, separate from the model of planner and tracker.

Each struct holds exactly the keys of one section of the experiment file. Bounds are checked where
the file is decoded (msgspec.convert), which names section, key, value and bound.
"""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from comms.channels import MAX_CAMERAS
from comms.messages import Position
from sim_rig.ball_screw_params import BallScrewParams
from sim_rig.camera_params import CameraParams
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


class View(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Image size and frame rate, common to bench and tracker (`[camera]`)."""

    width: Annotated[int, Meta(ge=16, le=8192)] = 640
    height: Annotated[int, Meta(ge=16, le=8192)] = 480
    rate_hz: Annotated[float, Meta(ge=0.0, le=1000.0)] = 50.0  # 0 = no camera


class BenchParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Parameters of the whole plant.

    Raises ValueError if the exposure exceeds the frame period, and for a clock error of a joint.
    """

    pendulum: PendulumParams = PendulumParams()
    # in place of the pendulum, from the platform down
    links: Annotated[tuple[LinkParams, ...], Meta(max_length=MAX_LINKS)] = ()
    load: LoadParams = LoadParams()  # of the links
    pushes: tuple[Push, ...] = ()
    cable: CableParams | None = None  # vibration of the cable itself
    length_changes: tuple[LengthChange, ...] = ()
    robot: RobotParams = RobotParams()
    cameras: Annotated[tuple[CameraParams, ...], Meta(min_length=1, max_length=MAX_CAMERAS)] = (
        CameraParams(),
    )
    view: View = View()
    axis: BallScrewParams | None = None  # along X, in place of the robot
    quattro: QuattroParams | None = None  # in place of the robot
    joint: Joint | None = None  # in place of robot and load
    drive_faults: tuple[DriveFault, ...] = ()  # of its drive
    home_m: Position = (0.0, 0.0, 0.0)  # home position, before the camera
    # by how much every clock of the rig runs fast against true time, in which the load swings
    clock_ppm: Annotated[float, Meta(ge=-1000.0, le=1000.0)] = 0.0
    seed: Annotated[int, Meta(ge=0)] = 0  # of the image noise
    input: InputBounds | None = None  # bounds on setpoints; None = no check

    @property
    def start_m(self) -> Position:
        """Position of the platform at the start of the simulation."""
        return (self.home_m[0] + self.robot.start_m, self.home_m[1], self.home_m[2])

    @property
    def clock_rate(self) -> float:
        """Run time over true time."""
        return 1.0 + 1e-6 * self.clock_ppm

    def rate_hz(self, camera: CameraParams) -> float:
        """Frame rate of a camera; 0 where there is none."""
        return camera.rate_hz or self.view.rate_hz if self.view.rate_hz else 0.0

    def __post_init__(self) -> None:
        if self.clock_ppm and self.joint is not None:
            raise ValueError(
                f"clock_ppm = {self.clock_ppm:g} in [bench] of an elastic joint; must be 0, it "
                "acts on a load that swings: remove it"
            )
        for number, camera in enumerate(self.cameras, start=1):
            self._check_times(camera, self.rate_hz(camera), number)

    def _check_times(self, camera: CameraParams, rate_hz: float, number: int) -> None:
        name = "[bench.camera]" if len(self.cameras) == 1 else f"[[bench.cameras]] number {number}"
        if rate_hz * camera.exposure_ms > 1000.0:
            raise ValueError(
                f"exposure_ms = {camera.exposure_ms} in {name}; must be <= "
                f"{1000.0 / rate_hz:g} ms, the frame period: "
                "shorten it or lower rate_hz in [camera]"
            )
        readout_us = self.view.height * camera.row_us
        if rate_hz * readout_us > 1e6:
            raise ValueError(
                f"row_us = {camera.row_us} in {name}: {self.view.height} rows take "
                f"{readout_us / 1000.0:g} ms; must be <= {1000.0 / rate_hz:g} ms, the frame "
                "period: shorten it or lower rate_hz"
            )
