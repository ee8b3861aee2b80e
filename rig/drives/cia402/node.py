"""CANopen node of a drive: frames and times in, frames and demands out."""

from __future__ import annotations

from rig.drives.cia402.drive import Cia402Drive
from rig.drives.cia402.emergency import EMERGENCY_COB_ID, EmergencyProducer, ErrorCode
from rig.drives.cia402.errors import AbortCode, SdoAbort
from rig.drives.cia402.frames import (
    CAN_ID_MASK,
    EXTENDED_FRAME,
    HEARTBEAT,
    NMT_COMMAND,
    SDO_REQUEST,
    SDO_RESPONSE,
    CanFrame,
    is_restricted,
)
from rig.drives.cia402.nmt import (
    ERROR_BEHAVIOUR,
    STATE_AFTER,
    STATE_AFTER_ERROR,
    HeartbeatConsumer,
    HeartbeatProducer,
    NmtCommand,
    NmtState,
    decode_nmt_command,
)
from rig.drives.cia402.object_dictionary import COMMUNICATION_AREA, ObjectDictionary
from rig.drives.cia402.pdo import ProcessData
from rig.drives.cia402.sdo import DEFAULT_TIMEOUT_NS, SdoServer
from rig.drives.cia402.signals import DriveDemand, DriveFeedback, DriveUnits
from rig.drives.cia402.state_machine import DriveState

SYNC_COB_ID = 0x1005
SYNC_PRODUCER = 1 << 30  # bit of 1005
_SDO_STATES = (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL)


class DriveNode:
    """Drive of one axis on a CAN bus.

    Call `on_frame` for every frame of the bus, `step` once per drive sample, and `on_time` after
    each `step` (at least once a millisecond). All times are integer nanoseconds of one clock that
    never runs backwards. Frames that a `step` causes are returned by the next `on_time`.
    """

    def __init__(
        self,
        node_id: int,
        units: DriveUnits | None = None,
        *,
        sdo_timeout_ns: int = DEFAULT_TIMEOUT_NS,
    ) -> None:
        """Create the node with a node-ID of 1 to 127 in the state after power on.

        sdo_timeout_ns [ns]: longest time between two requests of a segmented SDO transfer. Raises
        Cia402Error for a value out of bounds.
        """
        self.dictionary = ObjectDictionary(node_id)
        self.node_id = node_id
        self.nmt_state = NmtState.INITIALISING
        self._emergency = EmergencyProducer(self.dictionary)
        self._sdo = SdoServer(self.dictionary, sdo_timeout_ns)
        self._pdo = ProcessData(self.dictionary, self._emergency)
        self._producer = HeartbeatProducer(self.dictionary)
        self._consumer = HeartbeatConsumer(self.dictionary)
        self._drive = Cia402Drive(self.dictionary, self._emergency, units or DriveUnits())
        self.dictionary.add_check(SYNC_COB_ID, _check_sync_cob_id)
        self.dictionary.add_check(EMERGENCY_COB_ID, _check_emergency_cob_id)

    @property
    def state(self) -> DriveState:
        """State of the drive state machine."""
        return self._drive.state

    def on_frame(self, frame: CanFrame, t_ns: int) -> list[CanFrame]:
        """Take a frame received at t_ns [ns]; return the frames to send."""
        frames = self._boot()
        answers = self._dispatch(frame, t_ns)
        return frames + self._pending(t_ns) + answers

    def on_time(self, t_ns: int) -> list[CanFrame]:
        """Return the frames to send at t_ns [ns]: boot-up, heartbeat, events and time-outs."""
        frames = self._boot()
        if self._consumer.on_time(t_ns):
            self._lose_master()
        heartbeat = self._producer.on_time(t_ns, self.nmt_state)
        if heartbeat is not None:
            frames.append(heartbeat)
        abort = self._sdo.on_time(t_ns)
        if abort is not None:
            frames.append(self._sdo_frame(abort))
        return frames + self._pending(t_ns)

    def step(self, t_ns: int, feedback: DriveFeedback) -> DriveDemand:
        """Compute the demand of the drive sample at t_ns [ns] from its measurement.

        Raises Cia402Error if t_ns is before that of the last step, or for a feedback out of range.
        """
        return self._drive.step(t_ns, feedback)

    def _boot(self) -> list[CanFrame]:
        """Leave INITIALISING with the boot-up message."""
        if self.nmt_state is not NmtState.INITIALISING:
            return []
        self.nmt_state = NmtState.PRE_OPERATIONAL
        return [CanFrame(HEARTBEAT + self.node_id, bytes([NmtState.INITIALISING]))]

    def _dispatch(self, frame: CanFrame, t_ns: int) -> list[CanFrame]:
        """Hand a frame to its service; return the answers."""
        is_operational = self.nmt_state is NmtState.OPERATIONAL
        sync_id = self.dictionary.get(SYNC_COB_ID) & CAN_ID_MASK
        if frame.is_remote:
            return self._pdo.on_frame(frame, t_ns) if is_operational else []
        if frame.can_id == NMT_COMMAND:
            return self._on_nmt_command(frame.data)
        if frame.can_id == SDO_REQUEST + self.node_id:
            return self._on_sdo_request(frame.data, t_ns)
        if self._consumer.on_frame(frame, t_ns):
            self._find_master()
            return []
        if not is_operational:
            return []
        if frame.can_id == sync_id:
            return self._on_sync(t_ns)
        return self._pdo.on_frame(frame, t_ns)

    def _pending(self, t_ns: int) -> list[CanFrame]:
        """Emergency messages and event TPDOs that the NMT state lets pass."""
        frames: list[CanFrame] = []
        if self.nmt_state in _SDO_STATES:
            frames += self._emergency.take_messages()
        if self.nmt_state is NmtState.OPERATIONAL:
            frames += self._pdo.on_time(t_ns)
        return frames

    def _on_sync(self, t_ns: int) -> list[CanFrame]:
        self._pdo.apply_received()
        self._drive.on_sync(t_ns)
        return self._pdo.on_sync(t_ns)

    def _on_sdo_request(self, request: bytes, t_ns: int) -> list[CanFrame]:
        if self.nmt_state not in _SDO_STATES:
            return []
        response = self._sdo.on_request(request, t_ns)
        return [] if response is None else [self._sdo_frame(response)]

    def _sdo_frame(self, data: bytes) -> CanFrame:
        return CanFrame(SDO_RESPONSE + self.node_id, data)

    def _on_nmt_command(self, data: bytes) -> list[CanFrame]:
        command = decode_nmt_command(data, self.node_id)
        if command is None:
            return []
        self._enter(STATE_AFTER[command])
        if command is NmtCommand.RESET_NODE:
            self._reset_node()
        elif command is NmtCommand.RESET_COMMUNICATION:
            self._reset_communication()
        return self._boot()

    def _enter(self, state: NmtState) -> None:
        """Enter an NMT state; the drive stops when its process data end."""
        was_operational = self.nmt_state is NmtState.OPERATIONAL
        is_operational = state is NmtState.OPERATIONAL
        self.nmt_state = state
        if is_operational and not was_operational:
            self._pdo.reset()
        if was_operational and not is_operational:
            self._drive.on_control_lost()
        if state is NmtState.STOPPED:
            self._sdo.reset()

    def _reset_node(self) -> None:
        self.dictionary.reset()
        self._emergency.reset()
        self._restart_services()
        self._drive.reset()

    def _reset_communication(self) -> None:
        self.dictionary.reset(COMMUNICATION_AREA)
        self._emergency.update_register()
        self._restart_services()

    def _restart_services(self) -> None:
        self._sdo.reset()
        self._pdo.reset()

    def _lose_master(self) -> None:
        """React to the lost heartbeat of the master: NMT state 1029, drive 6007."""
        self._emergency.report(ErrorCode.HEARTBEAT_LOST)
        self._drive.on_connection_lost()
        state = STATE_AFTER_ERROR[self.dictionary.get(ERROR_BEHAVIOUR, 1)]
        if state is not None and self.nmt_state is NmtState.OPERATIONAL:
            self.nmt_state = state

    def _find_master(self) -> None:
        """Report the end of a lost heartbeat, unless a fault reset has to do that."""
        if self.state not in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE):
            self._emergency.clear(ErrorCode.HEARTBEAT_LOST)


def _check_sync_cob_id(subindex: int, value: int) -> None:
    if value & (EXTENDED_FRAME | SYNC_PRODUCER):
        detail = f"0x{value:08X}, bits 29 and 30 must be 0: another node sends the SYNC"
        raise SdoAbort(AbortCode.INVALID_VALUE, SYNC_COB_ID, subindex, detail)


def _check_emergency_cob_id(subindex: int, value: int) -> None:
    if value & EXTENDED_FRAME or is_restricted(value & CAN_ID_MASK):
        detail = f"0x{value:08X}, must be a free 11-bit CAN-ID: use 0x080 + node-ID"
        raise SdoAbort(AbortCode.INVALID_VALUE, EMERGENCY_COB_ID, subindex, detail)
