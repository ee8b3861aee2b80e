"""Table of the frames of a run: COB-ID, name and signals; the DBC file is made from it.

COB-IDs: predefined connection set of CiA 301. PDOs: the mapping of rig/run/tasks/drive/start_up.py.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from cantools.database import Database
from cantools.database.can import Message, Node, Signal
from cantools.database.conversion import BaseConversion
from cantools.database.namedsignalvalue import NamedSignalValue

from rig.drives.cia402 import frames
from rig.drives.cia402.nmt import NmtCommand, NmtState
from rig.drives.cia402.signals import PERMILLE
from rig.run.drive_section import ACCELERATION_UNIT_RAD_S2, DriveSection, JointNodeSection
from rig.run.tasks.drive import start_up

MASTER, DRIVE = "master", "drive"
NODE_STATES = {int(state): state.name.lower() for state in NmtState}
NMT_COMMANDS = {int(command): command.name.lower() for command in NmtCommand}
FUNCTION_MASK, NODE_MASK = 0x780, 0x7F
FUNCTIONS = {
    frames.EMERGENCY: "emergency",
    frames.SDO_RESPONSE: "sdo_response",
    frames.SDO_REQUEST: "sdo_request",
    frames.HEARTBEAT: "heartbeat",
}
FUNCTIONS |= {cob_id: f"tpdo{k}" for k, cob_id in enumerate(frames.TPDO, start=1)}
FUNCTIONS |= {cob_id: f"rpdo{k}" for k, cob_id in enumerate(frames.RPDO, start=1)}


class SignalRow(NamedTuple):
    """Signal of a frame, little-endian: physical value = scale * integer."""

    name: str
    start: int  # bit
    length: int  # bits
    is_signed: bool = False
    scale: float = 1
    unit: str = ""
    choices: Mapping[int, str] | None = None


class FrameRow(NamedTuple):
    """Frame in the base format: identifier, name, sender, length [bytes] and signals."""

    can_id: int
    name: str
    sender: str
    length: int
    signals: tuple[SignalRow, ...] = ()


def frame_rows(drive: DriveSection) -> list[FrameRow]:
    """List the frames of a run with one drive, by identifier."""
    node = drive.node_id
    heartbeat = (SignalRow("nmt_state", 0, 8, choices=NODE_STATES),)
    rows = [
        FrameRow(frames.NMT_COMMAND, "nmt", MASTER, 2, _nmt()),
        FrameRow(frames.SYNC, "sync", MASTER, 0),
        FrameRow(frames.EMERGENCY + node, "emergency", DRIVE, 8, _emergency()),
        FrameRow(start_up.TPDO_MOTION + node, "tpdo1", DRIVE, 8, _motion(drive)),
        FrameRow(start_up.RPDO + node, "rpdo1", MASTER, _bytes(_target(drive)), _target(drive)),
        FrameRow(
            start_up.TPDO_STATUS + node, "tpdo2", DRIVE, _bytes(_status(drive)), _status(drive)
        ),
        FrameRow(frames.SDO_RESPONSE + node, "sdo_response", DRIVE, 8, _sdo()),
        FrameRow(frames.SDO_REQUEST + node, "sdo_request", MASTER, 8, _sdo()),
        FrameRow(frames.HEARTBEAT + node, "heartbeat", DRIVE, 1, heartbeat),
        FrameRow(frames.HEARTBEAT + start_up.MASTER_ID, "master_heartbeat", MASTER, 1, heartbeat),
    ]
    return sorted(rows)


def database(drive: DriveSection) -> Database:
    """Make the database of cantools from the table."""
    messages = [_message(row) for row in frame_rows(drive)]
    nodes = [Node(MASTER), Node(DRIVE)]
    return Database(messages=messages, nodes=nodes, version="")


def dbc_text(drive: DriveSection) -> str:
    """Write the table as a DBC file."""
    return database(drive).as_dbc_string()


def function_name(can_id: int, is_extended: bool = False) -> str:
    """Name the function of an identifier by CiA 301, e.g. `heartbeat 5`; "" for none."""
    if is_extended:
        return ""
    if can_id == frames.NMT_COMMAND:
        return "nmt"
    if can_id == frames.SYNC:
        return "sync"
    name = FUNCTIONS.get(can_id & FUNCTION_MASK)
    node = can_id & NODE_MASK
    return f"{name} {node}" if name and node else ""


def _bytes(signals: Sequence[SignalRow]) -> int:
    return max(signal.start + signal.length for signal in signals) // 8


def _nmt() -> tuple[SignalRow, ...]:
    return (
        SignalRow("command", 0, 8, choices=NMT_COMMANDS),
        SignalRow("node", 8, 8),  # 0: all
    )


def _emergency() -> tuple[SignalRow, ...]:
    return (
        SignalRow("error_code", 0, 16),
        SignalRow("error_register", 16, 8),
        SignalRow("manufacturer", 24, 40),
    )


def _sdo() -> tuple[SignalRow, ...]:
    return (
        SignalRow("command", 0, 8),
        SignalRow("object_index", 8, 16),
        SignalRow("subindex", 24, 8),
        SignalRow("value", 32, 32),
    )


def _target(drive: DriveSection) -> tuple[SignalRow, ...]:
    scale = 1.0 / drive.increments_per_unit
    return (
        SignalRow("control_word", 0, 16),
        SignalRow("target_position", 16, 32, True, scale, drive.unit),
        *_torque_offset(drive),
    )


def _torque_offset(drive: DriveSection) -> tuple[SignalRow, ...]:
    if not isinstance(drive, JointNodeSection):
        return ()
    return (SignalRow("torque_offset", 48, 16, True, drive.rated_torque_n_m / PERMILLE, "N m"),)


def _motion(drive: DriveSection) -> tuple[SignalRow, ...]:
    scale = 1.0 / drive.increments_per_unit  # increments/s are the unit of velocity
    return (
        SignalRow("position", 0, 32, True, scale, drive.unit),
        SignalRow("velocity", 32, 32, True, scale, f"{drive.unit}/s"),
    )


def _status(drive: DriveSection) -> tuple[SignalRow, ...]:
    scale_n_m = drive.rated_torque_n_m / PERMILLE
    return (
        SignalRow("status_word", 0, 16),
        SignalRow("torque", 16, 16, True, scale_n_m, "N m"),
        *_load_acceleration(drive),
    )


def _load_acceleration(drive: DriveSection) -> tuple[SignalRow, ...]:
    if not isinstance(drive, JointNodeSection):
        return ()
    return (SignalRow("load_acceleration", 32, 32, True, ACCELERATION_UNIT_RAD_S2, "rad/s2"),)


def _message(row: FrameRow) -> Message:
    receiver = DRIVE if row.sender == MASTER else MASTER
    return Message(
        frame_id=row.can_id,
        name=row.name,
        length=row.length,
        signals=[_signal(signal, receiver) for signal in row.signals],
        senders=[row.sender],
        strict=True,
    )


def _signal(row: SignalRow, receiver: str) -> Signal:
    choices = OrderedDict[int, str | NamedSignalValue](row.choices) if row.choices else None
    conversion = BaseConversion.factory(scale=row.scale, offset=0, choices=choices)
    return Signal(
        name=row.name,
        start=row.start,
        length=row.length,
        is_signed=row.is_signed,
        conversion=conversion,
        unit=row.unit or None,
        receivers=[receiver],
    )
