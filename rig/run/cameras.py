"""Cameras of a run as the trackers believe them, and their check against those of the plant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from comms.messages import SwingPlane
from rig.errors import ConfigError
from rig.run.config import Experiment
from rig.run.vision_section import CameraBelief


class Camera(NamedTuple):
    """Belief about one camera; the values of [vision] and [camera] stand where it has none."""

    number: int  # from 1
    section: str  # of the file that describes it
    plane: SwingPlane  # of the swing that it sees
    calibration: str
    file: str  # of its lens and pose
    rough_pivot_px: tuple[float, float]
    rough_pixels_per_m: float
    rate_hz: float  # 0 = no camera
    distance_m: float | None  # to the plane of the swing; None = not known


def cameras(experiment: Experiment) -> list[Camera]:
    """List the cameras of an experiment; without [[vision.cameras]] it is one."""
    beliefs = experiment.vision.cameras
    if not beliefs:
        return [_camera(experiment, CameraBelief(), 1, "[vision]")]
    found = []
    for number, belief in enumerate(beliefs, start=1):
        section = f"[[vision.cameras]] number {number}"
        found.append(_camera(experiment, belief, number, section))
    return found


def _camera(experiment: Experiment, belief: CameraBelief, number: int, section: str) -> Camera:
    vision = experiment.vision
    rate_hz = experiment.camera.rate_hz
    if rate_hz:
        rate_hz = belief.rate_hz or rate_hz
    return Camera(
        number=number,
        section=section,
        plane=SwingPlane(belief.plane),
        calibration=vision.calibration if belief.calibration is None else belief.calibration,
        file=vision.camera if belief.camera is None else belief.camera,
        rough_pivot_px=belief.rough_pivot_px or vision.rough_pivot_px,
        rough_pixels_per_m=belief.rough_pixels_per_m or vision.rough_pixels_per_m,
        rate_hz=rate_hz,
        distance_m=belief.camera_distance_m or vision.camera_distance_m,
    )


def check_cameras(found: Sequence[Camera], planes: Sequence[str]) -> None:
    """Compare the cameras of the trackers with the planes of those of the plant.

    Raises ConfigError for another number, for another plane of one, and for a first camera that
    does not see the plane x, in which planner and analysis expect the swing.
    """
    if len(found) != len(planes):
        raise ConfigError(
            f"[bench] has {len(planes)} cameras, [vision] has {len(found)}; they must be equal: "
            "give as many [[vision.cameras]] as [[bench.cameras]], in the same order"
        )
    for camera, plane in zip(found, planes, strict=True):
        if camera.plane.value != plane:
            raise ConfigError(
                f"{camera.section}: plane = '{camera.plane.value}'; must be '{plane}', that of "
                f"camera {camera.number} of [bench]: correct one of the two"
            )
    if found[0].plane is not SwingPlane.X:
        raise ConfigError(
            f"{found[0].section}: plane = '{found[0].plane.value}'; must be 'x' for the first "
            "camera, which measures the swing along the move: list the cameras in another order"
        )
