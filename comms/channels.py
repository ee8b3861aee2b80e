"""Channel table: message type, sender, receiver, rate and transport of every channel."""

from __future__ import annotations

import enum
from typing import NamedTuple

from comms import messages

MS = 1_000_000  # ns


class Transport(enum.Enum):
    """Transport of a channel between processes."""

    UDP = "UDP"
    ZMQ = "ZeroMQ push/pull"
    BUS = "ZeroMQ request/reply"


class Channel(NamedTuple):
    """Row of the channel table; a channel has one sender, one receiver and one ledger row."""

    id: int  # in the header; also the order of messages that arrive at the same instant
    message: type[messages.Message]
    sender: str
    receiver: str
    transport: Transport
    rate_hz: float
    late_after_ms: float  # a message older than this when accepted counts as late
    about: str
    # False: read at the next wake, at most 50 ms later; a wake costs more than a message
    wakes: bool = True


# `platform_1`, `frame_1` and `angle_1` are those of the first camera
CHANNELS: dict[str, Channel] = {
    "command": Channel(
        1,
        messages.Command,
        "operator",
        "each task",
        Transport.BUS,
        0,
        1000,
        "arm, start, stop, status, close",
    ),
    "reply": Channel(
        2,
        messages.Reply,
        "each task",
        "operator",
        Transport.BUS,
        0,
        1000,
        "answer with the id of the command",
    ),
    "reference": Channel(
        3,
        messages.Reference,
        "streamer",
        "controller",
        Transport.UDP,
        100,
        30,
        "planned position, every 10 ms",
    ),
    "setpoint": Channel(
        4,
        messages.Setpoint,
        "controller",
        "bench",
        Transport.UDP,
        200,
        30,
        "interpolated values for the drives",
    ),
    "joint_state": Channel(
        5,
        messages.JointState,
        "bench",
        "controller",
        Transport.UDP,
        200,
        30,
        "values and rates from the encoders",
        wakes=False,
    ),
    "robot_state": Channel(
        6,
        messages.RobotState,
        "controller",
        "streamer",
        Transport.UDP,
        100,
        30,
        "commanded and actual position, phase",
        wakes=False,
    ),
    "platform_1": Channel(
        7,
        messages.RobotState,
        "controller",
        "vision",
        Transport.UDP,
        100,
        30,
        "the same message, to locate the pivot in the image",
        wakes=False,
    ),
    "frame_1": Channel(
        8, messages.Frame, "bench", "vision", Transport.ZMQ, 50, 40, "camera image of the cable"
    ),
    "angle_1": Channel(
        9,
        messages.AngleSample,
        "vision",
        "streamer",
        Transport.UDP,
        50,
        80,
        "cable angles with their time stamp",
    ),
    "truth": Channel(
        10,
        messages.Truth,
        "bench",
        "operator",
        Transport.ZMQ,
        100,
        1000,
        "state of the simulated plant; for log and analysis only",
    ),
}

# names of the wire before version 2, in experiment files and in logs
RENAMED_CHANNELS = {"platform": "platform_1", "frame": "frame_1", "angle": "angle_1"}
TASKS = ("streamer", "controller", "vision", "bench")
DATA = tuple(
    name for name, c in CHANNELS.items() if c.transport is not Transport.BUS and c.receiver in TASKS
)


def sent_by(task: str) -> tuple[str, ...]:
    """List the data channels on which a task sends."""
    return tuple(name for name in DATA if CHANNELS[name].sender == task)


def received_by(task: str) -> tuple[str, ...]:
    """List the data channels on which a task receives."""
    return tuple(name for name in DATA if CHANNELS[name].receiver == task)
