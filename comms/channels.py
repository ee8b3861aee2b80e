"""Channel table: message type, sender, receiver, rate and transport of every channel."""

from __future__ import annotations

import enum
from collections.abc import Collection
from typing import NamedTuple

from comms import messages

MS = 1_000_000  # ns


class Transport(enum.Enum):
    """Transport of a channel between processes."""

    UDP = "UDP"
    ZMQ = "ZeroMQ push/pull"
    CAN = "CAN"
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


MAX_CAMERAS = 3


def vision_task(camera: int) -> str:
    """Name the vision task of a camera, counted from 1."""
    return "vision" if camera == 1 else f"vision_{camera}"


def _camera_channels(first_id: int, camera: int) -> dict[str, Channel]:
    """List the channels of a camera, counted from 1."""
    task = vision_task(camera)
    return {
        f"platform_{camera}": Channel(
            first_id,
            messages.RobotState,
            "controller",
            task,
            Transport.UDP,
            100,
            30,
            "the same message, to locate the pivot in the image",
            wakes=False,
        ),
        f"frame_{camera}": Channel(
            first_id + 1,
            messages.Frame,
            "bench",
            task,
            Transport.ZMQ,
            50,
            40,
            "camera image of the cable",
        ),
        f"angle_{camera}": Channel(
            first_id + 2,
            messages.AngleSample,
            task,
            "streamer",
            Transport.UDP,
            50,
            80,
            "cable angles with their time stamp",
        ),
    }


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
    **_camera_channels(7, camera=1),
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
    "can_down": Channel(
        11,
        messages.CanMessage,
        "drive",
        "bench",
        Transport.CAN,
        400,
        10,
        "frames of the master to the nodes of the field bus",
    ),
    "can_up": Channel(
        12,
        messages.CanMessage,
        "bench",
        "drive",
        Transport.CAN,
        600,
        10,
        "frames of the nodes to the master",
    ),
    **_camera_channels(13, camera=2),
    **_camera_channels(16, camera=3),
}

# a run with a drive on the field bus has this task between controller and bench
DRIVE = "drive"
BEHIND_DRIVE = {"setpoint": ("controller", DRIVE), "joint_state": (DRIVE, "controller")}
# names of the wire before version 2, in experiment files and in logs
RENAMED_CHANNELS = {"platform": "platform_1", "frame": "frame_1", "angle": "angle_1"}
OPERATOR = "operator"
TASKS = ("streamer", "controller", "vision", "bench")
VISION_TASKS = tuple(vision_task(camera) for camera in range(1, MAX_CAMERAS + 1))
ALL_TASKS = (*TASKS, *VISION_TASKS[1:], DRIVE)


def ends(channel: str, tasks: Collection[str]) -> tuple[str, str]:
    """Return sender and receiver of a channel in a run with these tasks."""
    row = CHANNELS[channel]
    if DRIVE in tasks and channel in BEHIND_DRIVE:
        return BEHIND_DRIVE[channel]
    return row.sender, row.receiver


def data_channels(tasks: Collection[str]) -> tuple[str, ...]:
    """List the channels between tasks of a run."""
    found = []
    for name, row in CHANNELS.items():
        is_between = all(end in tasks and end != OPERATOR for end in ends(name, tasks))
        if row.transport is not Transport.BUS and is_between:
            found.append(name)
    return tuple(found)


DATA = data_channels(ALL_TASKS)  # of any run


def sent_by(task: str, tasks: Collection[str]) -> tuple[str, ...]:
    """List the data channels on which a task sends."""
    return tuple(name for name in data_channels(tasks) if ends(name, tasks)[0] == task)


def received_by(task: str, tasks: Collection[str]) -> tuple[str, ...]:
    """List the data channels on which a task receives."""
    return tuple(name for name in data_channels(tasks) if ends(name, tasks)[1] == task)
