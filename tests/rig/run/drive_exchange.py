"""Master of the field bus opposite a node of a few lines, in a time of their own.

The identifiers and the words are written out from CiA 301 and CiA 402, not taken from the product.
"""

from __future__ import annotations

import struct

from comms.messages import CanMessage, Command, JointState, Message, Reply, Verb, axis_setpoint
from comms.task import Send, Step
from rig.run.tasks.drive.settings import DriveSettings, Identity
from rig.run.tasks.drive.task import DriveTask

MS = 1_000_000
NODE = 5
NMT, SYNC, EMERGENCY = 0x000, 0x080, 0x080 + NODE
TPDO_1, RPDO_1, TPDO_2 = 0x180 + NODE, 0x200 + NODE, 0x280 + NODE
SDO_ANSWER, SDO_REQUEST = 0x580 + NODE, 0x600 + NODE
HEARTBEAT, BEAT_OF_MASTER = 0x700 + NODE, 0x77F
BOOTED, PRE_OPERATIONAL, OPERATIONAL = 0x00, 0x7F, 0x05
SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED = 0x0250, 0x0231, 0x0233, 0x0237
FAULTY, QUICK_STOPPING = 0x0218, 0x0217
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP = 0x06, 0x07, 0x0F, 0x02
AFTER_WORD = {
    (SWITCH_ON_DISABLED, SHUTDOWN): READY,
    (READY, SWITCH_ON): SWITCHED_ON,
    (SWITCHED_ON, ENABLE): ENABLED,
    (ENABLED, SHUTDOWN): READY,
    (ENABLED, QUICK_STOP): SWITCH_ON_DISABLED,  # at rest, the ramp has no length
}
IDENTITY = Identity(vendor=0x11, product=0x22, revision=0x33)
SETTINGS = DriveSettings(
    node_id=NODE,
    identity=IDENTITY,
    increments_per_unit=500_000.0,
    velocity_units_per_unit_s=250_000.0,
    acceleration_units_per_unit_s2=1000.0,
)


def can_message(
    can_id: int, data: bytes = b"", *, is_extended: bool = False, is_remote: bool = False
) -> CanMessage:
    return CanMessage(
        seq=0,
        t_ns=0,
        can_id=can_id,
        is_extended=is_extended,
        is_remote=is_remote,
        length=len(data),
        data=b"" if is_remote else data,
    )


class ScriptedNode:
    """Node that answers the master from a table; it moves to each target at once."""

    def __init__(self, position: int = 0) -> None:
        self.position = position  # [increments]
        self.velocity = 0
        self.status = SWITCH_ON_DISABLED
        self.is_operational = False
        self.is_silent = False  # no frame at all
        self.objects = {(0x1018, 1): 0x11, (0x1018, 2): 0x22, (0x1018, 3): 0x33}
        self.aborts: dict[tuple[int, int], int] = {}  # code by index and subindex
        self.writes: list[tuple[int, int, bytes]] = []

    def answers(self, can_id: int, data: bytes) -> list[tuple[int, bytes]]:
        if self.is_silent:
            return []
        if can_id == NMT and data == bytes([0x81, NODE]):
            return [(HEARTBEAT, bytes([BOOTED]))]
        if can_id == NMT and data == bytes([0x01, NODE]):
            self.is_operational = True
        if can_id == SDO_REQUEST:
            return [(SDO_ANSWER, self._sdo(data))]
        if can_id == RPDO_1:
            word, target = struct.unpack("<Hi", data)
            self.status = AFTER_WORD.get((self.status, word), self.status)
            if self.status == ENABLED:
                self.position = target
        if can_id == SYNC and self.is_operational:
            motion = struct.pack("<ii", self.position, self.velocity)
            return [(TPDO_1, motion), (TPDO_2, struct.pack("<Hh", self.status, 0))]
        if can_id == BEAT_OF_MASTER:
            return [(HEARTBEAT, bytes([OPERATIONAL if self.is_operational else PRE_OPERATIONAL]))]
        return []

    def _sdo(self, data: bytes) -> bytes:
        command, index, subindex = struct.unpack_from("<BHB", data)
        head = struct.pack("<HB", index, subindex)
        if (index, subindex) in self.aborts:
            return b"\x80" + head + struct.pack("<I", self.aborts[index, subindex])
        if command == 0x40:
            return b"\x43" + head + struct.pack("<I", self.objects[index, subindex])
        self.writes.append((index, subindex, data[4 : 8 - (command >> 2 & 3)]))
        return b"\x60" + head + bytes(4)


class Exchange:
    """Master and node; a frame arrives in the tick in which it was sent."""

    def __init__(
        self, settings: DriveSettings = SETTINGS, node: ScriptedNode | None = None
    ) -> None:
        self.node = node or ScriptedNode()
        self.master = DriveTask(settings)
        self.t_ns = 0
        self.sent: list[Send] = []
        self._orders = 0
        self._wake_ns = self.master.start(0).wake_ns or 0

    def tick(self, ticks: int = 1) -> list[tuple[int, bytes]]:
        """Let the master tick; return what it put on the bus in the last one."""
        frames: list[tuple[int, bytes]] = []
        for _ in range(ticks):
            frames = self.tick_at(self._wake_ns)
        return frames

    def tick_at(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Let the master tick at an instant of choice."""
        self.t_ns = t_ns
        step = self.master.on_tick(t_ns)
        self._wake_ns = step.wake_ns or 0
        frames = self.keep(step)
        self._deliver(frames)
        return frames

    def receive(self, can_id: int, data: bytes) -> list[Send]:
        """Give the master a frame of the node."""
        return self.give("can_up", can_message(can_id, data))

    def give(self, channel: str, message: Message) -> list[Send]:
        """Give the master a message now; return what it sends because of it."""
        step = self.master.on_message(channel, message, self.t_ns)
        self._deliver(self.keep(step))
        return list(step.sends)

    def _deliver(self, frames: list[tuple[int, bytes]]) -> None:
        for can_id, data in frames:
            for answer in self.node.answers(can_id, data):
                self.receive(*answer)

    def keep(self, step: Step) -> list[tuple[int, bytes]]:
        self.sent += step.sends
        return [(m.can_id, m.data) for m in frames_of(list(step.sends))]

    def order(self, verb: Verb) -> Reply | None:
        """Give an order; return the answer if it comes at once."""
        self._orders += 1
        order = Command(seq=0, t_ns=self.t_ns, id=self._orders, to="drive", verb=verb)
        answers = replies_of(self.give("command", order))
        return answers[0] if answers else None

    def setpoint(self, x_m: float, y_m: float = 0.0, z_m: float = 0.0) -> list[Send]:
        return self.give("setpoint", axis_setpoint(0, self.t_ns, (x_m, y_m, z_m)))

    def until_ready(self) -> Exchange:
        """Tick until the master answers a status; bounded."""
        for _ in range(100):
            self.tick()
            answer = self.order(Verb.STATUS)
            if answer is not None and answer.ok:
                return self
        raise AssertionError(f"not ready after 100 SYNCs: {answer}")

    def until_running(self) -> Exchange:
        """Arm and start."""
        self.until_ready()
        assert self.order(Verb.ARM) is None
        self.tick(3)
        started = self.order(Verb.START)
        assert started is not None
        assert started.ok
        return self

    @property
    def replies(self) -> list[Reply]:
        return replies_of(self.sent)

    @property
    def frames(self) -> list[CanMessage]:
        return frames_of(self.sent)

    @property
    def states(self) -> list[JointState]:
        return [send.message for send in self.sent if isinstance(send.message, JointState)]


def frames_of(sends: list[Send]) -> list[CanMessage]:
    return [send.message for send in sends if isinstance(send.message, CanMessage)]


def replies_of(sends: list[Send]) -> list[Reply]:
    return [send.message for send in sends if isinstance(send.message, Reply)]
