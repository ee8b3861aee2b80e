"""Node of the canopen library with a CiA 402 drive of its own, on a virtual bus of python-can.

It shares no code with the product: SDO server, NMT slave and PDO mapping are the library's, the
dictionary is built here, the drive profile is written here from CiA 402. Nothing sleeps: `pump`
handles the frames that wait.
"""

from __future__ import annotations

import can
import canopen
from canopen import objectdictionary as od

NODE = 9
SYNC, BEAT_OF_MASTER = 0x080, 0x77F
SYNC_S = 0.005
U8, U16, U32 = od.UNSIGNED8, od.UNSIGNED16, od.UNSIGNED32
I8, I16, I32 = od.INTEGER8, od.INTEGER16, od.INTEGER32
VARIABLES = {
    0x1017: (U16, "rw", 0),
    0x6040: (U16, "rw", 0),
    0x6041: (U16, "ro", 0x0250),
    0x605A: (I16, "rw", 5),
    0x6060: (I8, "rw", 0),
    0x6064: (I32, "ro", 0),
    0x6065: (U32, "rw", 0),
    0x606C: (I32, "ro", 0),
    0x6077: (I16, "ro", 0),
    0x607A: (I32, "rw", 0),
    0x6085: (U32, "rw", 0),
}
RECORDS = {
    0x1016: [(1, U32, "rw", 0)],
    0x1018: [(1, U32, "ro", 0x99), (2, U32, "ro", 0x402), (3, U32, "ro", 0x10007)],
    0x607D: [(1, I32, "rw", 0), (2, I32, "rw", 0)],
    0x60C2: [(1, U8, "rw", 1), (2, I8, "rw", -3)],
}
DISABLED, READY, SWITCHED_ON = "disabled", "ready", "switched on"
ENABLED, QUICK_STOP, FAULT = "enabled", "quick stop", "fault"
STATUS = {
    DISABLED: 0x0250,
    READY: 0x0231,
    SWITCHED_ON: 0x0233,
    ENABLED: 0x0237,
    QUICK_STOP: 0x0217,
    FAULT: 0x0218,
}


def dictionary() -> od.ObjectDictionary:
    """Build the objects that the master needs, and no others."""
    objects = od.ObjectDictionary()
    for index, (kind, access, value) in VARIABLES.items():
        objects.add_object(_variable(index, 0, kind, access, value))
    records = dict(RECORDS)
    for number in range(4):
        for base, cob_id in ((0x1400, 0x200), (0x1800, 0x180)):
            pdo_id = cob_id + 0x100 * number + NODE
            records[base + number] = [(1, U32, "rw", pdo_id), (2, U8, "rw", 255)]
            records[base + 0x200 + number] = [(k, U32, "rw", 0) for k in range(1, 5)]
    for index, entries in records.items():
        record = od.ODRecord(f"record {index:04X}", index)
        is_mapping = index & 0xFF00 in (0x1600, 0x1A00)
        count = 0 if is_mapping else len(entries)
        record.add_member(_variable(index, 0, U8, "rw", count))
        for entry in entries:
            record.add_member(_variable(index, *entry))
        objects.add_object(record)
    return objects


def _variable(index: int, subindex: int, kind: int, access: str, value: int) -> od.ODVariable:
    variable = od.ODVariable(f"object {index:04X}:{subindex:02X}", index, subindex)
    variable.data_type = kind
    variable.access_type = access
    variable.default = value
    return variable


class LibraryNode:
    """Node on a virtual bus; its axis stands at each target one SYNC after it was sent."""

    def __init__(self, channel: str) -> None:
        self.bus = can.Bus(interface="virtual", channel=channel)
        self.network = canopen.Network()
        self.network.bus = self.bus
        self.node = canopen.LocalNode(NODE, dictionary())
        self.node.nmt.start_heartbeat = self._set_heartbeat
        self.node.associate_network(self.network)
        self.node.add_write_callback(self._on_write)
        self.network.subscribe(SYNC, self._on_sync)
        self.network.subscribe(BEAT_OF_MASTER, lambda *_: self.beats.append(1))
        self.network.subscribe(0, self._on_command)
        self.heartbeat_ms = 0
        self.beats: list[int] = []
        self.writes: list[tuple[int, int, bytes]] = []  # by SDO
        self.commands: list[bytes] = []  # NMT
        self.words: list[tuple[int, int]] = []  # control word and target of each SYNC
        self.state = DISABLED
        self.states = [DISABLED]
        self.position = 12_345
        self.speed = 0.0  # [increments/s]
        self._is_served = False  # process data

    def close(self) -> None:
        self.bus.shutdown()

    def pump(self) -> None:
        """Handle the frames that wait."""
        while (message := self.bus.recv(0)) is not None:
            self.network.notify(message.arbitration_id, message.data, message.timestamp)

    def beat(self) -> None:
        """Send a heartbeat."""
        code = {"OPERATIONAL": 5, "PRE-OPERATIONAL": 127}[self.node.nmt.state]
        self.network.send_message(0x700 + NODE, bytes([code]))

    def _set_heartbeat(self, period_ms: int) -> None:
        self.heartbeat_ms = period_ms

    def _on_write(self, index: int, subindex: int, data: bytes, **_: object) -> None:
        if index not in (0x6041, 0x6064, 0x606C, 0x6077):
            self.writes.append((index, subindex, bytes(data)))

    def _on_command(self, can_id: int, data: bytearray, timestamp: float) -> None:
        self.commands.append(bytes(data))
        if bytes(data) == bytes([0x81, NODE]):  # the library does not boot by itself
            self.node.nmt.send_command(0x81)
            self.node.nmt.send_command(0x80)
        if bytes(data) == bytes([0x01, NODE]):
            self.node.rpdo[1].read()
            for number in range(1, 5):
                self.node.tpdo[number].read()
            self._is_served = True

    def _on_sync(self, can_id: int, data: bytearray, timestamp: float) -> None:
        if not self._is_served:
            return
        received = self.node.rpdo[1]
        if received.is_received:
            self._obey(received[0x6040].raw, received[0x607A].raw)
        self._send_process_data()

    def _send_process_data(self) -> None:
        values = {
            0x6041: STATUS[self.state],
            0x6064: self.position,
            0x606C: round(self.speed),
            0x6077: 0,
        }
        for number in range(1, 5):
            pdo = self.node.tpdo[number]
            if pdo.enabled and pdo.trans_type == 1:
                for variable in pdo:
                    variable.raw = values[variable.index]
                pdo.transmit()

    def _obey(self, word: int, target: int) -> None:
        self.words.append((word, target))
        was_enabled = self.state == ENABLED
        self._enter(self._next(word))
        if was_enabled and self.state == ENABLED:
            self.speed = (target - self.position) / SYNC_S
            self.position = target
        if self.state == QUICK_STOP:
            self._brake()

    def _brake(self) -> None:
        change = self.node.sdo[0x6085].raw * SYNC_S
        self.speed = max(abs(self.speed) - change, 0.0) * (1 if self.speed > 0 else -1)
        self.position += round(self.speed * SYNC_S)
        if self.speed == 0.0 and self.node.sdo[0x605A].raw == 2:
            self._enter(DISABLED)

    def _next(self, word: int) -> str:
        """Next state by the bits of the control word (CiA 402, table of the commands)."""
        if self.state == FAULT:
            return FAULT
        switch_on, voltage, no_quick_stop, enable = (bool(word >> bit & 1) for bit in range(4))
        if not voltage:
            return DISABLED
        if not no_quick_stop:
            is_moving = self.state in (ENABLED, QUICK_STOP)
            return QUICK_STOP if is_moving else DISABLED
        if self.state == QUICK_STOP:
            return QUICK_STOP
        if not switch_on:
            return READY
        if self.state == DISABLED:
            return DISABLED
        if self.state == READY:
            return SWITCHED_ON
        return ENABLED if enable else SWITCHED_ON

    def _enter(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self.states.append(state)
