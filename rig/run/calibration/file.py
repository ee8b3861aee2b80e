"""Calibration file: pivot and scale in the picture, and the offset table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from comms.channels import MAX_CAMERAS
from rig.errors import ConfigError
from rig.run import config, toml_file
from rig.run.cameras import Camera
from rig.run.toml_file import format_value
from rig.run.vision_section import Pixel, Scale
from vision.errors import VisionError
from vision.geometry import PitchedCamera, PivotModel, pitched_camera
from vision.offset_table import LightOffsets, OffsetTable

Level = Annotated[float, Meta(ge=0.0, le=255.0)]
MAX_APART_M = 1e-3  # between the positions of two tours


class LightRow(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Offsets in another light (`[[lights]]`), at the positions of the file."""

    background: Level
    offset_rad: list[float]
    sigma_offset_rad: list[float]


class Calibration(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Contents of a calibration file, written by `rig calibrate offsets`."""

    made: str  # UTC
    camera: str
    seed: int
    width: int
    height: int
    pivot_home_px: tuple[Pixel, Pixel]
    pixels_per_m: Scale
    x_m: list[float]  # on the axis of the plane
    offset_rad: list[float]
    sigma_offset_rad: list[float]
    number: Annotated[int, Meta(ge=1, le=MAX_CAMERAS)] = 1  # of the camera
    plane: Literal["x", "y"] = "x"  # of the swing that it sees
    background: Level | None = None  # level of the screen in the pictures, 0 to 255
    camera_made: str | None = None  # `made` of the camera file with which it was measured
    # picture of what never moves, without the cable: a PNG in the folder of this file
    static_scene: Annotated[str, Meta(pattern=r"^[^/\\]+\.png$")] | None = None
    lights: tuple[LightRow, ...] = ()

    def light_offsets(self) -> list[LightOffsets]:
        """List the offsets in the other lights."""
        return [LightOffsets(light.background, light.offset_rad) for light in self.lights]


def find(
    experiment: config.Experiment, camera: Camera, camera_made: str | None = None
) -> tuple[str, Calibration | None]:
    """Find name and contents of the calibration of a camera; contents None where it uses none.

    camera_made: date of its camera file, None without one; no shipped calibration goes with one.
    Raises ConfigError for a missing or damaged file, an invalid offset table, another camera,
    another picture size or another camera file, or a slope of the table that no camera has.
    """
    name = camera.calibration
    if name == "none" or camera.rate_hz == 0:
        return name, None
    if name == "shipped" and camera_made:
        return "none", None
    name, tables = _tables(name, camera)
    calibration = toml_file.convert(tables, Calibration, "calibration")
    _check_camera(calibration, name, camera, camera_made)
    size = (calibration.width, calibration.height)
    expected = (experiment.camera.width, experiment.camera.height)
    if size != expected:
        raise ConfigError(
            f"calibration '{name}' is for pictures of {size}; "
            f"must be {expected} as in [camera]: calibrate again"
        )
    try:
        _table(calibration)
        if not camera_made:
            _pitch(calibration, camera)
    except VisionError as error:
        raise ConfigError(f"calibration '{name}': {error}") from None
    return name, calibration


def _tables(name: str, camera: Camera) -> tuple[str, dict[str, Any]]:
    """Read name and tables of a file, or of the newest shipped calibration."""
    known = config.shipped_calibrations()
    if name == "shipped":
        if not known:
            raise ConfigError(
                f"{camera.section} calibration = 'shipped': none is shipped; "
                "make one with `rig calibrate offsets`"
            )
        return known[-1], config.read_shipped_calibration(known[-1])
    if Path(name).is_file():
        return name, toml_file.read_toml(Path(name), "calibration", "make it again")
    raise ConfigError(
        f"{camera.section} calibration = '{name}': no such file; "
        "make one with `rig calibrate offsets`, "
        f"or name 'shipped' ({', '.join(known) or 'none here'}) or 'none'"
    )


def _check_camera(
    calibration: Calibration, name: str, camera: Camera, camera_made: str | None
) -> None:
    """Raise ConfigError for the calibration of another camera, or with another camera file."""
    if (calibration.number, calibration.plane) != (camera.number, camera.plane.value):
        raise ConfigError(
            f"calibration '{name}' is of camera {calibration.number} in the plane "
            f"{calibration.plane}; must be of camera {camera.number} in the plane "
            f"{camera.plane.value}: give {camera.section} its own file, or calibration = 'none' "
            "with rough_pivot_px and rough_pixels_per_m"
        )
    if calibration.camera_made != camera_made:
        raise ConfigError(
            f"calibration '{name}' was made with the camera file of "
            f"'{calibration.camera_made or 'none'}'; must be with that of '{camera_made or 'none'}'"
            f", as {camera.section} camera = '{camera.file}' is: make it again with this one"
        )


def _pitch(calibration: Calibration, camera: Camera) -> PitchedCamera:
    """Find the pitch that the offsets of a file show; raises VisionError."""
    c = calibration
    pivot = PivotModel(home_px=c.pivot_home_px, pixels_per_m=c.pixels_per_m)
    return pitched_camera(c.x_m, c.offset_rad, pivot, (c.width, c.height), camera.distance_m)


def _table(calibration: Calibration) -> OffsetTable:
    """Make the table of a file; raises VisionError."""
    c = calibration
    return OffsetTable(c.x_m, c.offset_rad, c.background, c.light_offsets())


def read(path: Path) -> Calibration:
    """Read a calibration file; raises ConfigError."""
    if not path.is_file():
        raise ConfigError(
            f"calibration '{path}': no such file; make one with `rig calibrate offsets`"
        )
    tables = toml_file.read_toml(path, "calibration", "make it again")
    return toml_file.convert(tables, Calibration, "calibration")


def with_light(old: Calibration, new: Calibration, name: str) -> Calibration:
    """Add the offsets of a new calibration, made in another light, to an old one.

    Pivot and scale stay those of the old one. Raises ConfigError for a calibration of another
    camera or at other positions, for one without its light, and for a light that is there already.
    """
    for key in ("camera", "number", "plane", "width", "height", "camera_made"):
        if getattr(old, key) != getattr(new, key):
            raise ConfigError(
                f"calibration '{name}' is for {key} = {getattr(old, key)!r}; must be for "
                f"{getattr(new, key)!r} as in this run: write another file with --out"
            )
    apart_m = [abs(a - b) for a, b in zip(old.x_m, new.x_m, strict=False)]
    if len(old.x_m) != len(new.x_m) or max(apart_m) > MAX_APART_M:
        raise ConfigError(
            f"calibration '{name}' has positions {old.x_m}; must be {new.x_m} to "
            f"{MAX_APART_M * 1e3:g} mm as in this run: write another file with --out"
        )
    row = LightRow(
        background=new.background or 0.0,
        offset_rad=new.offset_rad,
        sigma_offset_rad=new.sigma_offset_rad,
    )
    added = msgspec.structs.replace(old, made=new.made, lights=(*old.lights, row))
    try:
        _table(added)
    except VisionError as error:
        raise ConfigError(f"calibration '{name}': {error}") from None
    return added


def text(calibration: Calibration) -> str:
    """Format the file as TOML."""
    lines = [
        "# Made by `rig calibrate offsets`: "
        "pivot and scale in the picture, angle offset over platform position."
    ]
    tables = msgspec.structs.asdict(calibration)
    lights = tables.pop("lights")
    present = {name: value for name, value in tables.items() if value is not None}
    lines += [f"{name} = {format_value(value)}" for name, value in present.items()]
    for light in lights:
        lines.append("\n[[lights]]")
        row = msgspec.structs.asdict(light)
        lines += [f"{name} = {format_value(value)}" for name, value in row.items()]
    return "\n".join(lines) + "\n"


def save(calibration: Calibration, path: Path) -> None:
    """Write the file; its folder is made where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text(calibration))
