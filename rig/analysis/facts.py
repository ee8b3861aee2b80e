"""Keys of a logged experiment that the analysis needs; all other keys are ignored.

The experiment file is strict and changes with the program. A log of another version stays readable
as long as it has these keys.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import msgspec

from comms.errors import LogError


class AnalysisFacts(msgspec.Struct, frozen=True):
    """Standard deviations of `[analysis]`; older logs have no such section."""

    angle_scale_rel: float | None = None  # None: that of the calibration
    clock_ppm: float = 20.0
    gain_drift_rel: float = 1e-3
    gravity_sigma_m_s2: float = 0.01
    settling_band_rad: float = 1e-3


class RunFacts(msgspec.Struct, frozen=True, kw_only=True):
    """Keys of `experiment.json` that the analysis uses."""

    rates_hz: tuple[float, ...]  # of the cameras, 0 = run without a camera
    average_frames: int  # of the moving average of the angle
    gravity_m_s2: float  # of [model]
    cable_length_m: float  # of [model]; 1 m where the load is a chain
    reference_delay_ms: float  # largest delay that the link fault model adds to a reference
    damping_ratio: float = 0.0  # of [model]
    is_chain: bool = False  # the load of [model] has links
    analysis: AnalysisFacts = AnalysisFacts()

    @property
    def rate_hz(self) -> float:
        """Rate of the first camera, 0 in a run without a camera."""
        return self.rates_hz[0]

    def rate_of(self, camera: int) -> float:
        """Rate of a camera, counted from 1."""
        return self.rates_hz[camera - 1] if camera <= len(self.rates_hz) else self.rate_hz


class EnvelopeFacts(msgspec.Struct, frozen=True):
    """Bounds on the motion; infinite where the log has none."""

    speed_m_s: float = math.inf
    acceleration_m_s2: float = math.inf


class RobotFacts(msgspec.Struct, frozen=True):
    """Kinematics of the controller; that of older logs is of axes."""

    kinematics: str = "axes"
    home_z_m: float = -0.90


class ControllerFacts(msgspec.Struct, frozen=True):
    """Keys of `controller.json` that the analysis uses; older logs have no such file."""

    policy: str = ""
    envelope: EnvelopeFacts = EnvelopeFacts()
    playout_ns: int = 0
    servo_lag_ns: int = 20_000_000
    following_error_m: float = math.inf
    robot: RobotFacts = RobotFacts()

    @property
    def delay_s(self) -> float:
        """Delay of the setpoints that the policy adds."""
        return self.playout_ns * 1e-9 if self.policy == "buffer" else 0.0


def read_facts(data: bytes, path: Path) -> RunFacts:
    """Read the facts from the `experiment.json` of the log at path.

    Raises LogError naming the key that is missing or is not a number, and msgspec.DecodeError for
    bytes that are not JSON.
    """
    tables = msgspec.json.decode(data)
    length_m = number_at(tables, "model", "length_m")
    delay_ms = number_at(tables, "links", "reference", "delay_ms")
    jitter_ms = number_at(tables, "links", "reference", "jitter_ms")
    return RunFacts(
        rates_hz=_rates_hz(tables, _number(tables, path, "camera", "rate_hz")),
        average_frames=int(_number(tables, path, "vision", "average_frames")),
        gravity_m_s2=_number(tables, path, "model", "gravity_m_s2"),
        cable_length_m=1.0 if length_m is None else length_m,
        reference_delay_ms=(delay_ms or 0.0) + (jitter_ms or 0.0),
        damping_ratio=number_at(tables, "model", "damping_ratio") or 0.0,
        is_chain=bool(value_at(tables, "model", "links")),
        analysis=_analysis(tables),
    )


def _analysis(tables: Any) -> AnalysisFacts:
    default = AnalysisFacts()
    found: dict[str, float] = {}
    for name in AnalysisFacts.__struct_fields__:
        value = number_at(tables, "analysis", name)
        if value is not None:
            found[name] = value
    return msgspec.structs.replace(default, **found)


def _rates_hz(tables: Any, rate_hz: float) -> tuple[float, ...]:
    """List the rates of the cameras: that of [camera] where one has none of its own."""
    cameras = value_at(tables, "vision", "cameras")
    if not isinstance(cameras, list) or not cameras or not rate_hz:
        return (rate_hz,)
    return tuple(number_at(camera, "rate_hz") or rate_hz for camera in cameras)


def value_at(tables: Any, *keys: str) -> Any:
    """Look up a key of nested tables; None where a table or the key is missing."""
    value = tables
    for key in keys:
        if not isinstance(value, dict):
            return None
        value = value.get(key)
    return value


def _number(tables: Any, path: Path, *keys: str) -> float:
    value = number_at(tables, *keys)
    if value is None:
        key = ".".join(keys)
        raise LogError(
            f"{path}: experiment.json has no number {key}, which the analysis needs; "
            "analyse this log with the version that wrote it (see run.start in its metadata)"
        )
    return value


def number_at(tables: Any, *keys: str) -> float | None:
    """Look up a number in nested tables; None where it is missing or is none."""
    value = value_at(tables, *keys)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number else None
