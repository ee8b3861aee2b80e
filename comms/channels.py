"""The one table of the wire: who tells whom what, how often, over which transport."""

from __future__ import annotations

import enum
from typing import NamedTuple

from comms import messages

MS = 1_000_000  # ns


class Transport(enum.Enum):
    """How a channel travels between processes."""

    UDP = "UDP"
    ZMQ = "ZeroMQ push/pull"
    BUS = "ZeroMQ request/reply"


class Channel(NamedTuple):
    """One channel has one sender, one receiver and one row in the ledger."""

    id: int  # on the wire; also the order of messages that arrive at the same instant
    message: type[messages.Message]
    sender: str
    receiver: str
    transport: Transport
    rate_hz: float
    late_after_ms: float  # older than this when accepted counts as late
    about: str
    wakes: bool = True  # False: read at the receiver's next wake, which is never far; a wake costs more than a message


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
        "the answer, with the command's id",
    ),
    "reference": Channel(
        3,
        messages.Reference,
        "streamer",
        "controller",
        Transport.UDP,
        100,
        30,
        "the plan, a position every 10 ms",
    ),
    "setpoint": Channel(
        4,
        messages.Setpoint,
        "controller",
        "bench",
        Transport.UDP,
        200,
        30,
        "interpolated position for the servos",
    ),
    "joint_state": Channel(
        5,
        messages.JointState,
        "bench",
        "controller",
        Transport.UDP,
        200,
        30,
        "what the encoders read",
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
    "platform": Channel(
        7,
        messages.RobotState,
        "controller",
        "vision",
        Transport.UDP,
        100,
        30,
        "the same, for the picture moves with it",
        wakes=False,
    ),
    "frame": Channel(
        8, messages.Frame, "bench", "vision", Transport.ZMQ, 50, 40, "a picture of the cable"
    ),
    "angle": Channel(
        9,
        messages.AngleSample,
        "vision",
        "streamer",
        Transport.UDP,
        50,
        80,
        "cable angle, with its instant",
    ),
    "truth": Channel(
        10,
        messages.Truth,
        "bench",
        "operator",
        Transport.ZMQ,
        100,
        1000,
        "simulated bench only; nothing that acts reads it",
    ),
}

TASKS = ("streamer", "controller", "vision", "bench")
DATA = tuple(
    name for name, c in CHANNELS.items() if c.transport is not Transport.BUS and c.receiver in TASKS
)


def sent_by(task: str) -> tuple[str, ...]:
    """Names of the data channels a task sends on."""
    return tuple(name for name in DATA if CHANNELS[name].sender == task)


def received_by(task: str) -> tuple[str, ...]:
    """Names of the data channels a task receives on."""
    return tuple(name for name in DATA if CHANNELS[name].receiver == task)
