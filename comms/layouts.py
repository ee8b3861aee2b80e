"""Payload layouts and value bounds of the message types.

An absent value (None) is encoded as NaN.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec
import numpy as np

from comms.messages import (
    AngleSample,
    Frame,
    InvalidReason,
    JointState,
    Message,
    Phase,
    Reference,
    RobotState,
    Setpoint,
    Truth,
)

_PHASES = tuple(Phase)
_REASONS = tuple(InvalidReason)
_PHASE_CODE = {phase: code for code, phase in enumerate(_PHASES)}
_REASON_CODE = {reason: code for code, reason in enumerate(_REASONS)}
_NO_PIXELS = np.empty((0, 0), dtype=np.uint8)
_MAX_FLOAT = sys.float_info.max


class Layout(NamedTuple):
    """Payload layout of a message type; to_message is the inverse of to_values."""

    format: str  # of the struct module
    to_values: Callable[[Any], tuple[Any, ...]]
    to_message: Callable[[int, int, tuple[Any, ...]], Message]  # of seq, t_ns, values


def _absent(value: float | None) -> float:
    return math.nan if value is None else value


def _present(value: float) -> float | None:
    return None if value != value else value


def _text(data: bytes) -> str:
    return data.rstrip(b"\0").decode("ascii", "replace")


LAYOUTS: dict[type[Message], Layout] = {
    Reference: Layout(
        "q3d",
        lambda m: (m.t_target_ns, *m.position_m),
        lambda seq, t, v: Reference(seq=seq, t_ns=t, t_target_ns=v[0], position_m=v[1:4]),
    ),
    Setpoint: Layout(
        "3d", lambda m: m.position_m, lambda seq, t, v: Setpoint(seq=seq, t_ns=t, position_m=v)
    ),
    JointState: Layout(
        "3d3d",
        lambda m: m.position_m + m.velocity_m_s,
        lambda seq, t, v: JointState(seq=seq, t_ns=t, position_m=v[0:3], velocity_m_s=v[3:6]),
    ),
    RobotState: Layout(
        "q3d3d3dB",
        lambda m: (
            m.t_actual_ns,
            *m.commanded_m,
            *m.actual_m,
            *m.actual_velocity_m_s,
            _PHASE_CODE[m.phase],
        ),
        lambda seq, t, v: RobotState(
            seq=seq,
            t_ns=t,
            t_actual_ns=v[0],
            commanded_m=v[1:4],
            actual_m=v[4:7],
            actual_velocity_m_s=v[7:10],
            phase=_PHASES[v[10]],
        ),
    ),
    AngleSample: Layout(
        "qdd?BdddHdddd",
        lambda m: (
            m.t_valid_ns,
            _absent(m.angle_rad),
            _absent(m.sigma_rad),
            m.valid,
            _REASON_CODE[m.reason],
            _absent(m.raw_rad),
            _absent(m.offset_rad),
            _absent(m.platform_m),
            m.rows,
            _absent(m.residual_px),
            _absent(m.pivot_miss_px),
            m.background,
            m.saturation,
        ),
        lambda seq, t, v: AngleSample(
            seq=seq,
            t_ns=t,
            t_valid_ns=v[0],
            angle_rad=_present(v[1]),
            sigma_rad=_present(v[2]),
            valid=v[3],
            reason=_REASONS[v[4]],
            raw_rad=_present(v[5]),
            offset_rad=_present(v[6]),
            platform_m=_present(v[7]),
            rows=v[8],
            residual_px=_present(v[9]),
            pivot_miss_px=_present(v[10]),
            background=v[11],
            saturation=v[12],
        ),
    ),
    Truth: Layout(
        "dd3d3d",
        lambda m: (m.angle_rad, m.angular_velocity_rad_s, *m.position_m, *m.velocity_m_s),
        lambda seq, t, v: Truth(
            seq=seq,
            t_ns=t,
            angle_rad=v[0],
            angular_velocity_rad_s=v[1],
            position_m=v[2:5],
            velocity_m_s=v[5:8],
        ),
    ),
    Frame: Layout(
        "qqq16s8sHH",
        lambda m: (
            m.t_exposure_start_ns,
            m.exposure_ns,
            m.row_ns,
            m.camera.encode()[:16],
            m.encoding.encode()[:8],
            m.height,
            m.width,
        ),
        lambda seq, t, v: Frame(
            seq=seq,
            t_ns=t,
            t_exposure_start_ns=v[0],
            exposure_ns=v[1],
            row_ns=v[2],
            camera=_text(v[3]),
            encoding=_text(v[4]),
            height=v[5],
            width=v[6],
            pixels=_NO_PIXELS,
        ),
    ),
}


class Bound(NamedTuple):
    """Smallest and largest value of a field on the wire."""

    name: str
    low: float
    high: float
    optional: bool  # the value may be absent (NaN)


def bounds(message: type[Message]) -> tuple[Bound, ...]:
    """Read the bounds from the field types of a message, one for each value of the payload."""
    found: list[Bound] = []
    for field in msgspec.inspect.type_info(message).fields[2:]:  # type: ignore[attr-defined]
        if field.name != "pixels":
            found += _field_bounds(field.name, field.type)
    return tuple(found)


def _field_bounds(name: str, kind: Any, optional: bool = False) -> list[Bound]:
    inspect = msgspec.inspect
    if isinstance(kind, inspect.UnionType):
        inner = next(t for t in kind.types if not isinstance(t, inspect.NoneType))
        return _field_bounds(name, inner, optional=True)
    if isinstance(kind, inspect.TupleType):
        return [b for item in kind.item_types for b in _field_bounds(name, item)]
    if isinstance(kind, inspect.EnumType):
        return [Bound(name, 0, len(kind.cls) - 1, False)]
    low = getattr(kind, "ge", None)
    high = getattr(kind, "le", None)
    if low is None:
        low = -_MAX_FLOAT
    if high is None:
        high = _MAX_FLOAT
    return [Bound(name, low, high, optional)]
