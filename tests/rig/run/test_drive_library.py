"""Master of the field bus opposite a node of the canopen library, over a virtual bus."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Iterator

import pytest

from comms.can_bus import CanEnd, CanSettings
from comms.messages import CanMessage, Command, JointState, Reply, Verb, axis_setpoint
from comms.task import Step
from rig.run.tasks.drive.settings import DriveSettings, Identity
from rig.run.tasks.drive.task import DriveTask
from tests.rig.run.library_node import (
    DISABLED,
    ENABLED,
    FAULT,
    NODE,
    QUICK_STOP,
    READY,
    SWITCHED_ON,
    LibraryNode,
)

MS = 1_000_000
PER_M = 100_000
SETTINGS = DriveSettings(
    node_id=NODE,
    identity=Identity(vendor=0x99, product=0x402, revision=0x10007),
    increments_per_unit=PER_M,
    velocity_units_per_unit_s=PER_M,
    acceleration_units_per_unit_s2=PER_M,
    quick_stop=20.0,
    lower=-0.3,
    upper=0.25,
    following_error=0.005,
)
CHANNELS = itertools.count()


class Bus:
    """Master and node on one bus, in the time of the master."""

    def __init__(self) -> None:
        channel = f"library-{next(CHANNELS)}"
        self.node = LibraryNode(channel)
        self.end = CanEnd(CanSettings(interface="virtual", channel=channel))
        self.master = DriveTask(SETTINGS)
        self.t_ns = 0
        self.replies: list[Reply] = []
        self.states: list[JointState] = []
        self.take(self.master.start(0))

    def close(self) -> None:
        self.node.close()
        self.end.close()

    def now_ns(self) -> int:
        return self.t_ns

    def sleep_until_ns(self, t_ns: int) -> None:
        raise AssertionError(f"slept until {t_ns}")

    def take(self, step: Step) -> None:
        """Send what the master sends; node and master then handle all that waits."""
        for send in step.sends:
            if isinstance(send.message, CanMessage):
                assert self.end.send(send.message)
            elif isinstance(send.message, Reply):
                self.replies.append(send.message)
            elif isinstance(send.message, JointState):
                self.states.append(send.message)
        self.node.pump()
        for frame in self.end.drain(self, of_nodes=True):
            self.take(self.master.on_message("can_up", frame, self.t_ns))

    def tick(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.t_ns += 5 * MS
            if self.node.heartbeat_ms and self.t_ns % (self.node.heartbeat_ms * MS) == 0:
                self.node.beat()
            self.take(self.master.on_tick(self.t_ns))

    def order(self, verb: Verb) -> None:
        order = Command(seq=0, t_ns=self.t_ns, id=len(self.replies) + 1, to="drive", verb=verb)
        self.take(self.master.on_message("command", order, self.t_ns))

    def setpoint(self, x_m: float) -> None:
        message = axis_setpoint(0, self.t_ns, (x_m, 0.0, 0.0))
        self.take(self.master.on_message("setpoint", message, self.t_ns))

    def until_ready(self) -> Bus:
        for _ in range(100):
            self.tick()
            self.order(Verb.STATUS)
            if self.replies[-1].ok:
                return self
        raise AssertionError(f"not ready after 100 SYNCs: {self.replies[-1].text}")

    def until_running(self) -> Bus:
        self.until_ready()
        self.order(Verb.ARM)
        self.tick(6)
        self.order(Verb.START)
        assert self.replies[-1].ok
        return self


@pytest.fixture
def bus() -> Iterator[Bus]:
    found = Bus()
    yield found
    found.close()


def unsigned(value: int, size: int) -> bytes:
    return value.to_bytes(size, "little")


def signed(value: int, size: int) -> bytes:
    return value.to_bytes(size, "little", signed=True)


OFF = 1 << 31
CONFIGURATION = [
    (0x1016, 1, unsigned(127 << 16 | 40, 4)),  # the master, lost after two heartbeats
    (0x1017, 0, unsigned(20, 2)),
    # RPDO 1: control word, target position
    *[(0x1400, 1, unsigned(OFF | 0x209, 4)), (0x1400, 2, b"\1"), (0x1600, 0, b"\0")],
    *[(0x1600, 1, unsigned(0x6040_0010, 4)), (0x1600, 2, unsigned(0x607A_0020, 4))],
    *[(0x1600, 0, b"\2"), (0x1400, 1, unsigned(0x209, 4))],
    # TPDO 1: actual position, actual velocity
    *[(0x1800, 1, unsigned(OFF | 0x189, 4)), (0x1800, 2, b"\1"), (0x1A00, 0, b"\0")],
    *[(0x1A00, 1, unsigned(0x6064_0020, 4)), (0x1A00, 2, unsigned(0x606C_0020, 4))],
    *[(0x1A00, 0, b"\2"), (0x1800, 1, unsigned(0x189, 4))],
    # TPDO 2: status word, actual torque
    *[(0x1801, 1, unsigned(OFF | 0x289, 4)), (0x1801, 2, b"\1"), (0x1A01, 0, b"\0")],
    *[(0x1A01, 1, unsigned(0x6041_0010, 4)), (0x1A01, 2, unsigned(0x6077_0010, 4))],
    *[(0x1A01, 0, b"\2"), (0x1801, 1, unsigned(0x289, 4))],
    # TPDO 3 and 4: none
    *[(0x1802, 1, unsigned(OFF | 0x389, 4)), (0x1803, 1, unsigned(OFF | 0x489, 4))],
    (0x6060, 0, b"\x08"),  # cyclic synchronous position
    *[(0x60C2, 1, b"\5"), (0x60C2, 2, signed(-3, 1))],  # 5 x 10^-3 s
    (0x6085, 0, unsigned(2_000_000, 4)),  # 20 m/s^2
    (0x605A, 0, unsigned(2, 2)),  # by its ramp, then switched off
    *[(0x607D, 1, signed(-30_000, 4)), (0x607D, 2, signed(25_000, 4))],
    (0x6065, 0, unsigned(500, 4)),  # 5 mm
]


def test_the_node_is_reset_configured_and_started_in_this_order(bus: Bus) -> None:
    bus.until_ready()
    assert bus.node.commands == [bytes([0x81, NODE]), bytes([0x01, NODE])]
    assert bus.node.writes == CONFIGURATION
    assert bus.node.node.nmt.state == "OPERATIONAL"


def test_the_drive_is_enabled_step_by_step_where_it_stands(bus: Bus) -> None:
    bus.until_ready()
    bus.tick(10)
    assert bus.node.states == [DISABLED, READY]
    bus.order(Verb.ARM)
    bus.tick(6)
    assert bus.node.states == [DISABLED, READY, SWITCHED_ON, ENABLED]
    assert bus.replies[-1].ok
    assert bus.node.position == 12_345
    assert bus.states[-1].position_m == (0.12345, 0.0, 0.0)


def test_each_setpoint_is_reached_and_reported_in_the_sync_after_it(bus: Bus) -> None:
    bus.until_running()
    for increments in range(12_345, 13_345, 50):
        bus.setpoint(increments / PER_M)
        bus.tick()
        assert bus.node.position == increments
        assert bus.states[-1].t_ns == bus.t_ns
        assert bus.states[-1].position_m == (increments / PER_M, 0.0, 0.0)
    assert bus.states[-1].velocity_m_s == (0.1, 0.0, 0.0)


def test_the_master_is_heard_every_20_ms(bus: Bus) -> None:
    bus.until_running()
    before = len(bus.node.beats)
    for _ in range(40):
        bus.setpoint(0.12345)
        bus.tick()
    assert len(bus.node.beats) - before == 10


def test_an_emergency_stop_brakes_by_the_ramp_of_the_drive(bus: Bus) -> None:
    bus.until_running()
    for step in range(1, 11):
        bus.setpoint(0.12345 + 0.002 * step)  # 0.4 m/s
        bus.tick()
    bus.order(Verb.ESTOP)
    bus.tick(20)
    assert bus.node.states[-3:] == [ENABLED, QUICK_STOP, DISABLED]
    braked_m = bus.node.position / PER_M - 0.12345 - 0.02
    assert 0.0 < braked_m < 0.4**2 / (2 * 20.0) + 0.4 * 0.005  # and one SYNC
    assert bus.node.speed == 0.0


def test_a_drive_that_runs_is_switched_off_at_the_end_of_the_task(bus: Bus) -> None:
    bus.until_running()
    bus.take(bus.master.stop(bus.t_ns))
    assert bus.node.state == DISABLED


def test_an_emergency_of_the_node_ends_the_run_and_names_its_code(bus: Bus) -> None:
    bus.until_running()
    bus.node.state = FAULT
    bus.node.node.emcy.send(0x3210, register=0x05)
    bus.tick()
    given = [reply for reply in bus.replies if reply.exit is not None]
    assert [(reply.exit, reply.id) for reply in given] == [(5, 0)]
    assert "error 0x3210, register 0x05" in given[0].text
    bus.tick()
    assert bus.node.words[-1][0] & 0x0006 == 0x0002  # quick stop


def test_an_object_that_the_node_does_not_have_is_named_with_the_code_of_the_library(
    bus: Bus,
) -> None:
    del bus.node.node.object_dictionary.indices[0x60C2]
    bus.tick(100)
    bus.order(Verb.STATUS)
    text = f"node {NODE}: object 60C2:01: the node refuses, 0x06020000 (no such object)"
    assert (bus.replies[-1].ok, bus.replies[-1].text) == (False, text)
    assert bytes([0x01, NODE]) not in bus.node.commands


def test_a_motion_pdo_is_8_bytes_with_the_sign_of_the_standard(bus: Bus) -> None:
    bus.node.position = -5
    bus.until_ready()
    bus.tick()
    assert bus.states[-1].position_m == (-5 / PER_M, 0.0, 0.0)
    assert bus.node.words[-1] == (0x06, -5)
    assert struct.calcsize("<ii") == 8
