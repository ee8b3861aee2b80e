"""Network management: NMT state machine, heartbeat producer and consumer (CiA 301)."""

from __future__ import annotations

from enum import IntEnum

from rig.drives.cia402.frames import HEARTBEAT, CanFrame
from rig.drives.cia402.object_dictionary import ObjectDictionary
from rig.drives.cia402.signals import NS_PER_MS

CONSUMER_HEARTBEAT = 0x1016
PRODUCER_HEARTBEAT = 0x1017
ERROR_BEHAVIOUR = 0x1029

ALL_NODES = 0  # node-ID of a command to all nodes
_NODE_ID_MASK = 0x7F


class NmtState(IntEnum):
    """NMT states as the heartbeat encodes them."""

    INITIALISING = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class NmtCommand(IntEnum):
    """Command specifiers of the NMT master."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


STATE_AFTER = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.INITIALISING,
    NmtCommand.RESET_COMMUNICATION: NmtState.INITIALISING,
}

STATE_AFTER_ERROR = {
    0: NmtState.PRE_OPERATIONAL,
    1: None,  # no change
    2: NmtState.STOPPED,
}  # values of 1029:01


def decode_nmt_command(data: bytes, node_id: int) -> NmtCommand | None:
    """Decode a command to a node; None if it is for another node or unknown."""
    if len(data) != 2 or data[1] not in (ALL_NODES, node_id):
        return None
    try:
        return NmtCommand(data[0])
    except ValueError:
        return None


class HeartbeatProducer:
    """Heartbeat of the node with the period 1017 [ms]; 0 switches it off."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        """Read the period from a dictionary."""
        self._dictionary = dictionary
        self._period_ns = 0
        self._due_ns = 0

    def on_time(self, t_ns: int, state: NmtState) -> CanFrame | None:
        """Heartbeat that is due at t_ns [ns]; a new period starts with a heartbeat at once."""
        period_ns = self._dictionary.get(PRODUCER_HEARTBEAT) * NS_PER_MS
        if period_ns != self._period_ns:
            self._period_ns = period_ns
            self._due_ns = t_ns
        if period_ns == 0 or t_ns < self._due_ns:
            return None
        missed = (t_ns - self._due_ns) // period_ns
        self._due_ns += (missed + 1) * period_ns
        return CanFrame(HEARTBEAT + self._dictionary.node_id, bytes([state]))


class HeartbeatConsumer:
    """Watch of the heartbeat of the master.

    Object 1016:01 holds its node-ID (bits 16 to 22) and the longest time between two heartbeats
    (bits 0 to 15) [ms]: twice its period, if two lost ones are an error. The watch starts with the
    first heartbeat.
    """

    def __init__(self, dictionary: ObjectDictionary) -> None:
        """Read node-ID and time from a dictionary."""
        self._dictionary = dictionary
        self._last_ns: int | None = None
        dictionary.add_action(CONSUMER_HEARTBEAT, self._restart)

    def on_frame(self, frame: CanFrame, t_ns: int) -> bool:
        """Take a frame at t_ns [ns]; True if it is a heartbeat of the master."""
        node_id, time_ns = self._watched()
        if time_ns == 0 or frame.can_id != HEARTBEAT + node_id or len(frame.data) != 1:
            return False
        self._last_ns = t_ns
        return True

    def on_time(self, t_ns: int) -> bool:
        """True once if the heartbeat is overdue at t_ns [ns]."""
        _, time_ns = self._watched()
        if self._last_ns is None or time_ns == 0 or t_ns - self._last_ns < time_ns:
            return False
        self._last_ns = None
        return True

    def _watched(self) -> tuple[int, int]:
        """Node-ID and longest time [ns]; a node-ID of 0 switches the watch off."""
        setting = self._dictionary.get(CONSUMER_HEARTBEAT, 1)
        node_id = setting >> 16 & _NODE_ID_MASK
        time_ns = (setting & 0xFFFF) * NS_PER_MS
        return node_id, time_ns if node_id else 0

    def _restart(self, subindex: int, value: int) -> None:
        """Wait for the first heartbeat again."""
        self._last_ns = None
