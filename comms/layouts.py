"""Payload layouts and value bounds of the message types.

An absent value (None) is encoded as NaN. A message with links has one group of values for each of
them behind its other values; their number follows from the length of the datagram.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import msgspec
import numpy as np

from comms.messages import (
    MAX_ANGLES,
    MAX_LINKS,
    AngleSample,
    CanMessage,
    Frame,
    InvalidReason,
    JointState,
    LinkAngle,
    LinkMotion,
    Message,
    Phase,
    Reference,
    RobotState,
    Setpoint,
    Space,
    SwingPlane,
    Truth,
)

Values = tuple[Any, ...]
_PHASES = tuple(Phase)
_REASONS = tuple(InvalidReason)
_SPACES = tuple(Space)
_PLANES = tuple(SwingPlane)
_PHASE_CODE = {phase: code for code, phase in enumerate(_PHASES)}
_REASON_CODE = {reason: code for code, reason in enumerate(_REASONS)}
_SPACE_CODE = {space: code for code, space in enumerate(_SPACES)}
_PLANE_CODE = {plane: code for code, plane in enumerate(_PLANES)}
_NO_PIXELS = np.empty((0, 0), dtype=np.uint8)
_MAX_FLOAT = sys.float_info.max
_MAX_POSITION_M = 10.0
MAX_BASE_ID = 0x7FF  # identifier of 11 bits
_MAX_VELOCITY_M_S = 100.0


class Group(NamedTuple):
    """Values of one link."""

    kind: type[msgspec.Struct]
    format: str  # of the struct module
    most: int  # links in a message


class Layout(NamedTuple):
    """Payload layout of a message type; to_message is the inverse of to_values.

    is_consistent checks what the bounds of single values cannot.
    """

    format: str  # of the struct module, without the links
    to_values: Callable[[Any], Values]
    to_message: Callable[[int, int, Values], Message]  # of seq, t_ns, values
    group: Group | None = None
    is_consistent: Callable[[Values], bool] | None = None


def _absent(value: float | None) -> float:
    return math.nan if value is None else value


def _present(value: float) -> float | None:
    return None if value != value else value


def _text(data: bytes) -> str:
    return data.rstrip(b"\0").decode("ascii", "replace")


def _joints_are_consistent(v: Values) -> bool:
    """Check that unused values are 0, and positions and velocities in metres are in range."""
    code, count = v[:2]
    groups = [(v[k : k + 6], _MAX_VELOCITY_M_S if k > 2 else _MAX_POSITION_M) for k in (2, 8)]
    for values, bound in groups:
        if any(values[count:]):
            return False
        if _SPACES[code] is Space.METRES and any(abs(value) > bound for value in values):
            return False
    return True


def _angle_values(m: AngleSample) -> Iterator[Any]:
    yield from (m.t_valid_ns, _PLANE_CODE[m.swing_plane], m.valid, _REASON_CODE[m.reason])
    yield from (_absent(m.platform_m), m.rows, _absent(m.residual_px), _absent(m.pivot_miss_px))
    yield from (m.background, m.saturation)
    for link in m.links:
        yield from (link.angle_rad, link.sigma_rad, link.raw_rad, link.offset_rad)
        yield from link.joint_px or (math.nan, math.nan)


def _link_angle(v: Values) -> LinkAngle:
    joint_px = None if math.isnan(v[4]) else (v[4], v[5])
    return LinkAngle(
        angle_rad=v[0], sigma_rad=v[1], raw_rad=v[2], offset_rad=v[3], joint_px=joint_px
    )


def _angle_is_consistent(v: Values) -> bool:
    """Check that a sample with links is valid, one without is not, and joints are whole."""
    links = [v[k : k + 6] for k in range(10, len(v), 6)]
    return v[2] == bool(links) and all(math.isnan(u) == math.isnan(w) for *_, u, w in links)


def _angle_sample(seq: int, t_ns: int, v: Values) -> AngleSample:
    return AngleSample(
        seq=seq,
        t_ns=t_ns,
        t_valid_ns=v[0],
        swing_plane=_PLANES[v[1]],
        valid=v[2],
        reason=_REASONS[v[3]],
        platform_m=_present(v[4]),
        rows=v[5],
        residual_px=_present(v[6]),
        pivot_miss_px=_present(v[7]),
        background=v[8],
        saturation=v[9],
        links=tuple(_link_angle(v[k : k + 6]) for k in range(10, len(v), 6)),
    )


def _can_is_consistent(v: Values) -> bool:
    """Check that the identifier fits its format, and that unused bytes are 0."""
    can_id, is_extended, is_remote, length, data = v
    used = 0 if is_remote else length
    return (is_extended or can_id <= MAX_BASE_ID) and not any(data[used:])


def _truth_values(m: Truth) -> Iterator[float]:
    yield from (*m.position_m, *m.velocity_m_s)
    for link in m.links:
        yield from (link.angle_x_rad, link.angle_y_rad, link.rate_x_rad_s, link.rate_y_rad_s)


def _link_motion(v: Values) -> LinkMotion:
    return LinkMotion(angle_x_rad=v[0], angle_y_rad=v[1], rate_x_rad_s=v[2], rate_y_rad_s=v[3])


def _truth(seq: int, t_ns: int, v: Values) -> Truth:
    links = tuple(_link_motion(v[k : k + 4]) for k in range(6, len(v), 4))
    return Truth(seq=seq, t_ns=t_ns, position_m=v[0:3], velocity_m_s=v[3:6], links=links)


LAYOUTS: dict[type[Message], Layout] = {
    Reference: Layout(
        "q3d",
        lambda m: (m.t_target_ns, *m.position_m),
        lambda seq, t, v: Reference(seq=seq, t_ns=t, t_target_ns=v[0], position_m=v[1:4]),
    ),
    Setpoint: Layout(
        "BB6d",
        lambda m: (_SPACE_CODE[m.space], m.count, *m.values),
        lambda seq, t, v: Setpoint(seq=seq, t_ns=t, space=_SPACES[v[0]], count=v[1], values=v[2:8]),
        is_consistent=_joints_are_consistent,
    ),
    JointState: Layout(
        "BB6d6d",
        lambda m: (_SPACE_CODE[m.space], m.count, *m.values, *m.rates),
        lambda seq, t, v: JointState(
            seq=seq, t_ns=t, space=_SPACES[v[0]], count=v[1], values=v[2:8], rates=v[8:14]
        ),
        is_consistent=_joints_are_consistent,
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
        "qB?BdHdddd",
        lambda m: tuple(_angle_values(m)),
        _angle_sample,
        group=Group(LinkAngle, "dddd2d", MAX_ANGLES),
        is_consistent=_angle_is_consistent,
    ),
    CanMessage: Layout(
        "I??B8s",
        lambda m: (m.can_id, m.is_extended, m.is_remote, m.length, m.data),
        lambda seq, t, v: CanMessage(
            seq=seq,
            t_ns=t,
            can_id=v[0],
            is_extended=v[1],
            is_remote=v[2],
            length=v[3],
            data=b"" if v[2] else v[4][: v[3]],
        ),
        is_consistent=_can_is_consistent,
    ),
    Truth: Layout(
        "3d3d",
        lambda m: tuple(_truth_values(m)),
        _truth,
        group=Group(LinkMotion, "dddd", MAX_LINKS),
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
    """Read the bounds from the field types of a message: one a value of the payload, no links."""
    return _bounds(message, skip=2)


def group_bounds(message: type[Message]) -> tuple[Bound, ...]:
    """Read the bounds of the values of one link; () for a message without links."""
    group = LAYOUTS[message].group
    return _bounds(group.kind, skip=0) if group else ()


def _bounds(kind: type[msgspec.Struct], skip: int) -> tuple[Bound, ...]:
    found: list[Bound] = []
    for field in msgspec.inspect.type_info(kind).fields[skip:]:  # type: ignore[attr-defined]
        if field.name not in ("pixels", "links"):
            found += _field_bounds(field.name, field.type)
    return tuple(found)


def _field_bounds(name: str, kind: Any, optional: bool = False) -> list[Bound]:
    inspect = msgspec.inspect
    if isinstance(kind, inspect.UnionType):
        inner = next(t for t in kind.types if not isinstance(t, inspect.NoneType))
        return _field_bounds(name, inner, optional=True)
    if isinstance(kind, inspect.TupleType):
        return [b for item in kind.item_types for b in _field_bounds(name, item, optional)]
    if isinstance(kind, inspect.EnumType):
        return [Bound(name, 0, len(kind.cls) - 1, False)]
    low = getattr(kind, "ge", None)
    high = getattr(kind, "le", None)
    if low is None:
        low = -_MAX_FLOAT
    if high is None:
        high = _MAX_FLOAT
    return [Bound(name, low, high, optional)]
