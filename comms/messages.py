"""Message types: frozen values, SI units in the names, times in ns of the run clock (integer)."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

Seq = Annotated[int, Meta(ge=0, le=2**32 - 1)]
TimeNs = Annotated[int, Meta(ge=0, le=2**62)]
Metres = Annotated[float, Meta(ge=-10.0, le=10.0)]
MetresPerSecond = Annotated[float, Meta(ge=-100.0, le=100.0)]
Radians = Annotated[float, Meta(ge=-1.6, le=1.6)]
JointValue = Annotated[float, Meta(ge=-1e3, le=1e3)]  # m or rad
JointRate = Annotated[float, Meta(ge=-1e4, le=1e4)]  # m/s or rad/s
Pixels = Annotated[float, Meta(ge=-1e5, le=1e5)]
Position = tuple[Metres, Metres, Metres]  # x right, y depth, z up
Velocity = tuple[MetresPerSecond, MetresPerSecond, MetresPerSecond]
JointValues = tuple[JointValue, JointValue, JointValue, JointValue, JointValue, JointValue]
JointRates = tuple[JointRate, JointRate, JointRate, JointRate, JointRate, JointRate]
JointCount = Annotated[int, Meta(ge=1, le=6)]
AXES = 3  # of a robot whose joints are the axes x, y, z
MAX_ANGLES = 3  # link angles in an AngleSample
MAX_LINKS = 256  # in a Truth


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
    STATIC = "static"  # a line that never moves
    DUPLICATE = "duplicate"  # the picture before once more
    FROZEN = "frozen"  # the same picture for a while
    DAMAGED = "damaged"  # rows of the picture are wrong
    SCENE_MOVED = "scene_moved"  # what never moves is not where the calibration has it


class Space(enum.Enum):
    """Unit of the values of the joints."""

    METRES = "m"
    RADIANS = "rad"


class SwingPlane(enum.Enum):
    """Vertical plane of a swing, named by its horizontal axis."""

    X = "x"
    Y = "y"


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
    """Interpolated values for the drives of the robot; those beyond `count` are 0."""

    space: Space
    count: JointCount  # of the joints
    values: JointValues

    @property
    def position_m(self) -> Position | None:
        """Position where the joints are the axes x, y, z; else None."""
        return _axes(self, self.values)


class JointState(Message, frozen=True, gc=False, kw_only=True):
    """Values and rates from the encoders of the robot at t_ns; those beyond `count` are 0."""

    space: Space
    count: JointCount  # of the joints
    values: JointValues
    rates: JointRates

    @property
    def position_m(self) -> Position | None:
        """Position where the joints are the axes x, y, z; else None."""
        return _axes(self, self.values)

    @property
    def velocity_m_s(self) -> Velocity | None:
        """Velocity where the joints are the axes x, y, z; else None."""
        return _axes(self, self.rates)


def _axes(message: Setpoint | JointState, values: JointValues) -> Position | None:
    is_position = message.space is Space.METRES and message.count == AXES
    return (values[0], values[1], values[2]) if is_position else None


def axis_setpoint(seq: int, t_ns: int, position_m: Position) -> Setpoint:
    """Make the setpoint of a robot whose joints are the axes x, y, z."""
    values = (*position_m, 0.0, 0.0, 0.0)
    return Setpoint(seq=seq, t_ns=t_ns, space=Space.METRES, count=AXES, values=values)


def axis_state(seq: int, t_ns: int, position_m: Position, velocity_m_s: Velocity) -> JointState:
    """Make the joint state of a robot whose joints are the axes x, y, z."""
    return JointState(
        seq=seq,
        t_ns=t_ns,
        space=Space.METRES,
        count=AXES,
        values=(*position_m, 0.0, 0.0, 0.0),
        rates=(*velocity_m_s, 0.0, 0.0, 0.0),
    )


def joint_setpoint(seq: int, t_ns: int, joints_rad: Sequence[float]) -> Setpoint:
    """Make the setpoint of a robot with up to six joints that turn."""
    values, count = _six(joints_rad), len(joints_rad)
    return Setpoint(seq=seq, t_ns=t_ns, space=Space.RADIANS, count=count, values=values)


def joint_state(
    seq: int, t_ns: int, joints_rad: Sequence[float], rates_rad_s: Sequence[float]
) -> JointState:
    """Make the joint state of a robot with up to six joints that turn."""
    return JointState(
        seq=seq,
        t_ns=t_ns,
        space=Space.RADIANS,
        count=len(joints_rad),
        values=_six(joints_rad),
        rates=_six(rates_rad_s),
    )


def _six(values: Sequence[float]) -> JointValues:
    a, b, c, d, e, f = (*values, *([0.0] * (6 - len(values))))
    return a, b, c, d, e, f


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


class LinkAngle(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    """Angle of a link in a swing plane: 0 = hanging, positive = lower end ahead on the axis."""

    angle_rad: Radians  # against the vertical, moving average applied
    sigma_rad: Annotated[float, Meta(ge=0.0, le=1.6)]
    raw_rad: Radians  # slope angle in the newest frame alone
    # raw_rad less the angle against the vertical in that frame: offset and perspective
    offset_rad: Radians
    joint_px: tuple[Pixels, Pixels] | None  # column and row of the upper end of the link


class AngleSample(Message, frozen=True, gc=False, kw_only=True):
    """Cable angles from a camera at t_valid_ns, from the platform down.

    platform_m, rows, residual_px, pivot_miss_px, background and saturation are of the newest
    frame alone. A missing value is None. Valid samples have at least one link, others none.
    """

    t_valid_ns: TimeNs
    swing_plane: SwingPlane
    valid: bool
    reason: InvalidReason
    platform_m: Metres | None  # on the axis of the swing plane
    rows: Annotated[int, Meta(ge=0, le=65535)]
    residual_px: Annotated[float, Meta(ge=0.0, le=1e4)] | None
    pivot_miss_px: Pixels | None  # fitted line minus predicted pivot, in x, at the pivot's row
    background: Annotated[float, Meta(ge=0.0, le=255.0)]
    saturation: Annotated[float, Meta(ge=0.0, le=1.0)]  # share of pixels at full scale
    links: tuple[LinkAngle, ...] = ()

    @property
    def cable(self) -> LinkAngle | None:
        """Link at the platform; None in a sample that is not valid."""
        return self.links[0] if self.valid and self.links else None


class LinkMotion(msgspec.Struct, frozen=True, gc=False, kw_only=True):
    """Angles of a link in the planes x and y, as seen along y and x, and their rates.

    tan(angle) = horizontal component over downward component of the link, lower end ahead positive.
    """

    angle_x_rad: float
    angle_y_rad: float
    rate_x_rad_s: float
    rate_y_rad_s: float


class Truth(Message, frozen=True, gc=False, kw_only=True):
    """State of the simulated plant at t_ns; for log and analysis, not for control."""

    position_m: Position
    velocity_m_s: Velocity
    links: tuple[LinkMotion, ...]  # from the platform down


class CanMessage(Message, frozen=True, gc=False, kw_only=True):
    """Frame on the field bus of the drives; seq and t_ns are those of its sender."""

    can_id: Annotated[int, Meta(ge=0, le=2**29 - 1)]
    is_extended: bool  # an identifier of 29 bits
    is_remote: bool
    length: Annotated[int, Meta(ge=0, le=8)]  # data length code; bytes of data unless is_remote
    data: bytes


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
