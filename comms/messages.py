"""The words of the wire: frozen values, SI units in the names, integer nanoseconds of the run clock."""

from __future__ import annotations

import enum
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

Seq = Annotated[int, Meta(ge=0, le=2**32 - 1)]
TimeNs = Annotated[int, Meta(ge=0, le=2**62)]
Metres = Annotated[float, Meta(ge=-10.0, le=10.0)]
MetresPerSecond = Annotated[float, Meta(ge=-100.0, le=100.0)]
Radians = Annotated[float, Meta(ge=-1.6, le=1.6)]
Pixels = Annotated[float, Meta(ge=-1e5, le=1e5)]
Position = tuple[Metres, Metres, Metres]  # x right, y depth, z up
Velocity = tuple[MetresPerSecond, MetresPerSecond, MetresPerSecond]


class Phase(enum.Enum):
    """Where the controller stands; rig/run/tasks/controller/phase.py holds the one transition function."""

    IDLE = "idle"
    ARMED = "armed"
    RUNNING = "running"
    STOPPED = "stopped"
    FAULT = "fault"


class InvalidReason(enum.Enum):
    """Why a frame gave no angle; `none` when it did."""

    NONE = "none"
    NO_CABLE = "no_cable"  # nothing thin and dark stands out of the noise
    FEW_ROWS = "few_rows"  # a candidate, but on too few rows to trust
    PIVOT_MISSED = "pivot_missed"  # a line, but not through the predicted pivot
    AMBIGUOUS = "ambiguous"  # two lines claim the pivot
    POOR_FIT = "poor_fit"  # rows scatter more than the noise explains
    OUT_OF_RANGE = "out_of_range"  # platform outside the offset table
    NO_PLATFORM = "no_platform"  # platform position unknown at mid-exposure
    BAD_IMAGE = "bad_image"  # saturated, empty, or not of the expected size


class Verb(enum.Enum):
    """What the operator can ask of a task."""

    ARM = "arm"
    START = "start"
    STOP = "stop"
    ESTOP = "estop"
    STATUS = "status"
    CLOSE = "close"  # to the runner: stop the task, drain, report the ledger, exit


class Message(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    """Every message carries its sender's count and stamp."""

    seq: Seq
    t_ns: TimeNs


class Reference(Message, frozen=True, gc=False, kw_only=True):
    """Where the plan wants the platform at t_target_ns."""

    t_target_ns: TimeNs
    position_m: Position


class RobotState(Message, frozen=True, gc=False, kw_only=True):
    """What the controller commands and what the robot does; t_actual_ns stamps the measurement."""

    t_actual_ns: TimeNs
    commanded_m: Position
    actual_m: Position
    actual_velocity_m_s: Velocity
    phase: Phase


class Setpoint(Message, frozen=True, gc=False, kw_only=True):
    """Interpolated position for the robot's servos."""

    position_m: Position


class JointState(Message, frozen=True, gc=False, kw_only=True):
    """What the robot's encoders read at t_ns."""

    position_m: Position
    velocity_m_s: Velocity


class Frame(Message, frozen=True, gc=False, kw_only=True):
    """A picture; t_ns is the end of the exposure. pixels: (height, width) or (height, width, 3) uint8."""

    t_exposure_start_ns: TimeNs
    exposure_ns: TimeNs
    row_ns: TimeNs  # read-out time a row, 0 = global shutter
    camera: str
    encoding: str  # "mono8" (red plane) or "bgr8"
    height: int
    width: int
    pixels: np.ndarray[Any, np.dtype[np.uint8]]


class AngleSample(Message, frozen=True, gc=False, kw_only=True):
    """Cable angle seen by the camera: 0 = hanging, positive = load ahead in +X (image right).

    angle_rad is true for t_valid_ns (offset removed, moving average applied). raw_rad, offset_rad, platform_m,
    rows, residual_px, pivot_miss_px, background and saturation belong to the newest frame alone.
    A value that is not there is None, and valid is False.
    """

    t_valid_ns: TimeNs
    angle_rad: Radians | None
    sigma_rad: Annotated[float, Meta(ge=0.0, le=1.6)] | None
    valid: bool
    reason: InvalidReason
    raw_rad: Radians | None
    offset_rad: Radians | None
    platform_m: Metres | None
    rows: Annotated[int, Meta(ge=0, le=65535)]
    residual_px: Annotated[float, Meta(ge=0.0, le=1e4)] | None
    pivot_miss_px: (
        Pixels | None
    )  # fitted line minus predicted pivot, along image x, at the pivot's row
    background: Annotated[float, Meta(ge=0.0, le=255.0)]
    saturation: Annotated[float, Meta(ge=0.0, le=1.0)]  # share of pixels at full scale


class Truth(Message, frozen=True, gc=False, kw_only=True):
    """What the simulated world really does at t_ns; read by nothing that acts."""

    angle_rad: float
    angular_velocity_rad_s: float
    position_m: Position
    velocity_m_s: Velocity


class Command(Message, frozen=True, gc=False, kw_only=True):
    """An order from the operator; a Reply carries the same id."""

    id: int
    to: str
    verb: Verb
    t_start_ns: TimeNs = 0  # START only


class Reply(Message, frozen=True, gc=False, kw_only=True):
    """A task's answer: done or not, where it stands, and why. id 0 is news nobody asked for."""

    id: int
    sender: str
    ok: bool
    phase: Phase
    text: str = ""
    exit: int | None = None  # the task wants the run to end with this exit code
