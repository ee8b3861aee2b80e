"""Frames of a bus from the log of a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import can
import msgspec

from comms.errors import LogError
from comms.mcap_log import EPOCH_KEY, Log, read_log
from comms.messages import CanMessage
from rig.analysis.readers.can_trace import KINDS, is_trace
from rig.errors import ConfigError, RigError
from rig.run.drive_section import AxisDriveSection, CanSection, DriveSection, JointNodeSection
from rig.run.runs import find_log

DOWN, UP = "/can_down", "/can_up"  # topics: of the master, of the nodes


class JointTable(msgspec.Struct, frozen=True, kw_only=True):
    """Keys of `[joint]` that the field bus needs."""

    drive: JointNodeSection = JointNodeSection()


class RunBus(msgspec.Struct, frozen=True, kw_only=True):
    """Field bus of a logged run: `[can]`, and `[drive]` or `[joint]` of its experiment."""

    can: CanSection = CanSection()
    drive: AxisDriveSection = AxisDriveSection()
    joint: JointTable | None = None

    @property
    def node(self) -> DriveSection:
        """Drive of the run."""
        return self.drive if self.joint is None else self.joint.drive


class Traffic(NamedTuple):
    """Frames of a logged run in the order of their instants, and its bus."""

    log: Log
    bus: RunBus
    frames: list[can.Message]  # time stamps: run clock [s]

    @property
    def epoch_s(self) -> float:
        """Wall-clock time of run time 0 [s since 1970]."""
        return int(self.log.metadata["run.start"].get(EPOCH_KEY, "0")) * 1e-9


def read_traffic(name: str, runs: Path) -> Traffic:
    """Read the frames of a logged run; raises RigError for a run without a field bus."""
    try:
        path = find_log(name, runs)
    except RigError as error:
        if Path(name).suffix and not is_trace(name):
            raise ConfigError(f"{error}; a trace of another program must be {KINDS}") from None
        raise
    return traffic_of(read_log(path))


def traffic_of(log: Log) -> Traffic:
    """Take the frames out of a log; raises RigError where there are none."""
    messages = [(message, False) for message in log.read(DOWN, CanMessage)]
    messages += [(message, True) for message in log.read(UP, CanMessage)]
    if not messages:
        raise RigError(
            f"{log.path}: a run without traffic on a field bus; must be a run with a drive: "
            '[bench.robot] kind = "ball_screw" or "elastic_joint"'
        )
    messages.sort(key=lambda row: row[0].t_ns)  # stable: of equal instants, the request first
    frames = [_frame(message, is_rx) for message, is_rx in messages]
    return Traffic(log, run_bus(log), frames)


def run_bus(log: Log) -> RunBus:
    """Read `[can]` and `[drive]` of the experiment of a log; raises LogError."""
    try:
        return msgspec.json.decode(log.attachments.get("experiment.json", b"{}"), type=RunBus)
    except msgspec.MsgspecError as error:
        raise LogError(
            f"{log.path}: its experiment cannot be read ({error}): damaged, or of another version"
        ) from error


def has_drive(log: Log) -> bool:
    """Tell if a run had a drive on the field bus."""
    return json.loads(log.attachments.get("drive.json") or b"null") is not None


def _frame(message: CanMessage, is_rx: bool) -> can.Message:
    """Convert a message of the log. is_rx: a node sent it, the master received it."""
    return can.Message(
        timestamp=message.t_ns * 1e-9,
        arbitration_id=message.can_id,
        is_extended_id=message.is_extended,
        is_remote_frame=message.is_remote,
        dlc=message.length,
        data=None if message.is_remote else message.data,
        is_rx=is_rx,
        channel=0,
    )
