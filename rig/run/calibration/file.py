"""Calibration file: pivot and scale in the picture, and the offset table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from comms.channels import MAX_CAMERAS
from rig.errors import ConfigError
from rig.run import config, toml_file
from rig.run.cameras import Camera
from rig.run.vision_section import Pixel, Scale
from vision.errors import VisionError
from vision.offset_table import OffsetTable


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


def find(experiment: config.Experiment, camera: Camera) -> tuple[str, Calibration | None]:
    """Find name and contents of the calibration of a camera; contents None where it uses none.

    Raises ConfigError for a missing or damaged file, an invalid offset table, another camera, or
    another picture size.
    """
    name = camera.calibration
    if name == "none" or camera.rate_hz == 0:
        return name, None
    known = config.shipped_calibrations()
    if name == "shipped":
        if not known:
            raise ConfigError(
                f"{camera.section} calibration = 'shipped': none is shipped; "
                "make one with `rig calibrate offsets`"
            )
        name = known[-1]
        tables = config.read_shipped_calibration(name)
    elif Path(name).is_file():
        tables = toml_file.read_toml(Path(name), "calibration", "make it again")
    else:
        raise ConfigError(
            f"{camera.section} calibration = '{name}': no such file; "
            "make one with `rig calibrate offsets`, "
            f"or name 'shipped' ({', '.join(known) or 'none here'}) or 'none'"
        )
    calibration = toml_file.convert(tables, Calibration, "calibration")
    if (calibration.number, calibration.plane) != (camera.number, camera.plane.value):
        raise ConfigError(
            f"calibration '{name}' is of camera {calibration.number} in the plane "
            f"{calibration.plane}; must be of camera {camera.number} in the plane "
            f"{camera.plane.value}: give {camera.section} its own file, or calibration = 'none' "
            "with rough_pivot_px and rough_pixels_per_m"
        )
    size = (calibration.width, calibration.height)
    expected = (experiment.camera.width, experiment.camera.height)
    if size != expected:
        raise ConfigError(
            f"calibration '{name}' is for pictures of {size}; "
            f"must be {expected} as in [camera]: calibrate again"
        )
    try:
        OffsetTable(calibration.x_m, calibration.offset_rad)
    except VisionError as error:
        raise ConfigError(f"calibration '{name}': {error}") from None
    return name, calibration


def text(calibration: Calibration) -> str:
    """Format the file as TOML."""
    lines = [
        "# Made by `rig calibrate offsets`: "
        "pivot and scale in the picture, angle offset over platform position."
    ]
    for name, value in msgspec.structs.asdict(calibration).items():
        lines.append(f"{name} = {_toml(value)}")
    return "\n".join(lines) + "\n"


def save(calibration: Calibration, path: Path) -> None:
    """Write the file; its folder is made where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text(calibration))


def _toml(value: object) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)  # a JSON string is a TOML string
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return str(value)
