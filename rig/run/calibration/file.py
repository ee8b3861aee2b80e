"""Calibration file: pivot and scale in the picture, and the offset table."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec

from rig.errors import ConfigError
from rig.run import config, toml_file
from vision.errors import VisionError
from vision.offset_table import OffsetTable


class Calibration(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Contents of a calibration file, written by `rig calibrate offsets`."""

    made: str  # UTC
    camera: str
    seed: int
    width: int
    height: int
    pivot_home_px: tuple[config.Pixel, config.Pixel]
    pixels_per_m: config.Positive
    x_m: list[float]
    offset_rad: list[float]
    sigma_offset_rad: list[float]


def find(experiment: config.Experiment) -> tuple[str, Calibration | None]:
    """Find name and contents of an experiment's calibration; contents None where it uses none.

    Raises ConfigError for a missing or damaged file, an invalid offset table, or another picture
    size.
    """
    name = experiment.vision.calibration
    if name == "none" or experiment.camera.rate_hz == 0:
        return name, None
    known = config.shipped_calibrations()
    if name == "shipped":
        if not known:
            raise ConfigError(
                "[vision] calibration = 'shipped': none is shipped; "
                "make one with `rig calibrate offsets`"
            )
        name = known[-1]
        tables = config.read_shipped_calibration(name)
    elif Path(name).is_file():
        tables = toml_file.read_toml(Path(name), "calibration", "make it again")
    else:
        raise ConfigError(
            f"[vision] calibration = '{name}': no such file; "
            "make one with `rig calibrate offsets`, "
            f"or name 'shipped' ({', '.join(known) or 'none here'}) or 'none'"
        )
    calibration = toml_file.convert(tables, Calibration, "calibration")
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
