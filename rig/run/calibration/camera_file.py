"""Camera file: intrinsics, lens and pose of a camera, written by `rig calibrate camera`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from rig.errors import ConfigError
from rig.run import toml_file
from rig.run.cameras import Camera
from rig.run.config import Experiment
from rig.run.toml_file import format_value
from vision.camera_model import CameraModel, CameraParameters, Vector
from vision.chessboard import Intrinsics
from vision.errors import VisionError
from vision.marks import MeasuredPose

NO_CAMERA_FILE = "none"
Pair = tuple[float, float]
Five = tuple[float, float, float, float, float]
Count = Annotated[int, Meta(ge=0, le=100_000)]


class PoseTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """`[pose]`: turn and place, from marks.

    World: x right, y ahead, z up, in metres from the pivot of the cable with the platform at home.
    """

    rotation: Vector  # Rodrigues vector of the turn from the world to the camera
    translation_m: Vector  # home position in the camera: right, down, ahead
    sigma_rotation: Vector
    sigma_translation_m: Vector
    marks: Count
    rms_px: float  # of the reprojection


class CameraFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Contents of a camera file; without [pose] only its lens can be used."""

    made: str  # UTC
    camera: str
    plane: Literal["x", "y"]  # of the swing that it sees
    width: int
    height: int
    focal_px: Pair  # along the columns and the rows
    centre_px: Pair  # principal point
    distortion: Five  # k1, k2, p1, p2, k3 of OpenCV
    sigma_focal_px: Pair
    sigma_centre_px: Pair
    sigma_distortion: Five
    boards: Count  # poses of the chessboard
    rms_px: float  # of their reprojection
    pose: PoseTable | None = None

    def intrinsics(self) -> Intrinsics:
        """Return intrinsics and lens, to find a pose with them."""
        return Intrinsics(
            focal_px=self.focal_px,
            centre_px=self.centre_px,
            distortion=self.distortion,
            sigma_focal_px=self.sigma_focal_px,
            sigma_centre_px=self.sigma_centre_px,
            sigma_distortion=self.sigma_distortion,
            rms_px=self.rms_px,
            used=[],
            refused={},
        )

    def with_pose(self, pose: MeasuredPose, plane: str, made: str) -> CameraFile:
        """Return the same camera with another pose, from which it sees a plane."""
        table = PoseTable(
            rotation=pose.rotation,
            translation_m=pose.translation_m,
            sigma_rotation=pose.sigma_rotation,
            sigma_translation_m=pose.sigma_translation_m,
            marks=len(pose.miss_px),
            rms_px=pose.rms_px,
        )
        return msgspec.structs.replace(self, made=made, plane=plane, pose=table)


def read(path: Path) -> CameraFile:
    """Read a camera file; raises ConfigError."""
    if not path.is_file():
        raise ConfigError(
            f"camera file '{path}': no such file; make one with `rig calibrate camera`"
        )
    tables = toml_file.read_toml(path, "camera file", "make it again")
    return toml_file.convert(tables, CameraFile, "camera file")


def find(experiment: Experiment, camera: Camera) -> CameraFile | None:
    """Find the file of a camera; None where it has none, or is off.

    Raises ConfigError for a missing or damaged file, one without a pose, one of another plane or
    picture size, and for a camera that has its back to the home position.
    """
    name = camera.file
    if name == NO_CAMERA_FILE or camera.rate_hz == 0:
        return None
    found = read(Path(name))
    size = (experiment.camera.width, experiment.camera.height)
    if (found.width, found.height) != size:
        raise ConfigError(
            f"camera file '{name}' is for pictures of {(found.width, found.height)}; must be "
            f"{size} as in [camera]: calibrate the camera at this size"
        )
    if found.plane != camera.plane.value:
        raise ConfigError(
            f"camera file '{name}' is of a camera of the plane {found.plane}; must be of the plane "
            f"{camera.plane.value}: give {camera.section} its own file"
        )
    try:
        CameraModel(parameters(found, name))
    except (VisionError, ValueError) as error:
        raise ConfigError(f"camera file '{name}': {error}") from None
    return found


def parameters(camera: CameraFile, name: str = "") -> CameraParameters:
    """Return the parameters of the model; raises ConfigError without a pose.

    name: of the file, for the error.
    """
    if camera.pose is None:
        raise ConfigError(
            f"camera file '{name}' has no [pose]; must have one for a run: add it with `rig "
            "calibrate camera --lens FILE --marks PICTURE --places CSV`"
        )
    return CameraParameters(
        focal_px=camera.focal_px,
        centre_px=camera.centre_px,
        distortion=camera.distortion,
        rotation=camera.pose.rotation,
        translation_m=camera.pose.translation_m,
    )


def text(camera: CameraFile) -> str:
    """Format the file as TOML."""
    lines = ["# Made by `rig calibrate camera`: intrinsics, lens and pose of a camera."]
    tables = msgspec.structs.asdict(camera)
    pose = tables.pop("pose")
    lines += [f"{name} = {format_value(value)}" for name, value in tables.items()]
    if pose is not None:
        lines.append("\n[pose]")
        values = msgspec.structs.asdict(pose)
        lines += [f"{name} = {format_value(value)}" for name, value in values.items()]
    return "\n".join(lines) + "\n"


def save(camera: CameraFile, path: Path) -> None:
    """Write the file; its folder is made where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text(camera))
