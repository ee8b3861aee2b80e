"""Message types: frozen values, SI units in the names, times in ns of the run clock (integer)."""

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
    """Phase of the controller; transition function in rig/run/tasks/controller/phase.py."""

    IDLE = "idle"
    ARMED = "armed"
    RUNNING = "running"
    STOPPED = "stopped"
    FAULT = "fault"


class InvalidReason(enum.Enum):
    """Reason why a frame gives no angle; `none` if it gives one."""

    NONE = "none"
    NO_CABLE = "no_cable"  # no thin dark line above the noise
    FEW_ROWS = "few_rows"  # a line, but on too few rows
    PIVOT_MISSED = "pivot_missed"  # a line, but not through the predicted pivot
    AMBIGUOUS = "ambiguous"  # two lines through the predicted pivot
    POOR_FIT = "poor_fit"  # rows scatter more than the noise explains
    OUT_OF_RANGE = "out_of_range"  # platform outside the offset table
    NO_PLATFORM = "no_platform"  # platform position unknown at mid-exposure
    BAD_IMAGE = "bad_image"  # saturated, empty, or not of the expected size


class Verb(enum.Enum):
    """Command of the operator to a task."""

    ARM = "arm"
    START = "start"
    STOP = "stop"
    ESTOP = "estop"
    STATUS = "status"
    CLOSE = "close"  # to the runner: stop the task, drain, send the ledger, exit


class Message(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    """Base of all messages: sequence number and time stamp of the sender."""

    seq: Seq
    t_ns: TimeNs


class Reference(Message, frozen=True, gc=False, kw_only=True):
    """Planned position of the platform at t_target_ns."""

    t_target_ns: TimeNs
    position_m: Position


class RobotState(Message, frozen=True, gc=False, kw_only=True):
    """Commanded and actual state of the robot; t_actual_ns is the time of the measurement."""

    t_actual_ns: TimeNs
    commanded_m: Position
    actual_m: Position
    actual_velocity_m_s: Velocity
    phase: Phase


class Setpoint(Message, frozen=True, gc=False, kw_only=True):
    """Interpolated position for the drives of the robot."""

    position_m: Position


class JointState(Message, frozen=True, gc=False, kw_only=True):
    """Position and velocity from the encoders of the robot at t_ns."""

    position_m: Position
    velocity_m_s: Velocity


class Frame(Message, frozen=True, gc=False, kw_only=True):
    """Camera frame; t_ns is the end of the exposure.

    pixels: (height, width) or (height, width, 3), uint8.
    """

    t_exposure_start_ns: TimeNs
    exposure_ns: TimeNs
    row_ns: TimeNs  # read-out time per row, 0 = global shutter
    camera: str
    encoding: str  # "mono8" (red plane) or "bgr8"
    height: int
    width: int
    pixels: np.ndarray[Any, np.dtype[np.uint8]]


class AngleSample(Message, frozen=True, gc=False, kw_only=True):
    """Cable angle from the camera: 0 = hanging, positive = load ahead in +X (image right).

    angle_rad holds at t_valid_ns (offset removed, moving average applied). raw_rad, offset_rad,
    platform_m, rows, residual_px, pivot_miss_px, background and saturation are of the newest
    frame alone. A missing value is None, and valid is False.
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
    pivot_miss_px: Pixels | None  # fitted line minus predicted pivot, in x, at the pivot's row
    background: Annotated[float, Meta(ge=0.0, le=255.0)]
    saturation: Annotated[float, Meta(ge=0.0, le=1.0)]  # share of pixels at full scale


class Truth(Message, frozen=True, gc=False, kw_only=True):
    """State of the simulated plant at t_ns; for log and analysis, not for control."""

    angle_rad: float
    angular_velocity_rad_s: float
    position_m: Position
    velocity_m_s: Velocity


class Command(Message, frozen=True, gc=False, kw_only=True):
    """Command of the operator; the Reply has the same id."""

    id: int
    to: str
    verb: Verb
    t_start_ns: TimeNs = 0  # START only


class Reply(Message, frozen=True, gc=False, kw_only=True):
    """Answer of a task: result, phase and reason; id 0 = unsolicited."""

    id: int
    sender: str
    ok: bool
    phase: Phase
    text: str = ""
    exit: int | None = None  # exit code with which the task requests the end of the run
