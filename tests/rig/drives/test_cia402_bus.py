"""Every transition of the drive state machine over a python-can bus, without threads or waiting."""

import itertools

import can
import pytest

from rig.drives.cia402.frames import CanFrame
from rig.drives.cia402.node import DriveNode
from rig.drives.cia402.signals import DriveFeedback

NODE_ID = 9
MS = 1_000_000
CHANNELS = itertools.count()
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, DISABLE_VOLTAGE, RESET = 0x06, 0x07, 0x0F, 0x02, 0x00, 0x80

# mask and value of the state in the status word (CiA 402)
STATES = {
    "not ready to switch on": (0x4F, 0x00),
    "switch on disabled": (0x4F, 0x40),
    "ready to switch on": (0x6F, 0x21),
    "switched on": (0x6F, 0x23),
    "operation enabled": (0x6F, 0x27),
    "quick stop active": (0x6F, 0x07),
    "fault reaction active": (0x4F, 0x0F),
    "fault": (0x4F, 0x08),
}


class BusBench:
    """Master and drive on one virtual bus; the status word comes by TPDO 1."""

    def __init__(self):
        channel = f"cia402-{next(CHANNELS)}"
        self.master = can.Bus(interface="virtual", channel=channel)
        self.wire = can.Bus(interface="virtual", channel=channel)
        self.node = DriveNode(NODE_ID)
        self.t_ns = 0
        self.position, self.drive_fault, self.switch = 0.0, 0, False
        self.status = None
        self.emergencies = []
        self.received = []

    def close(self):
        self.master.shutdown()
        self.wire.shutdown()

    def send(self, can_id, data):
        message = can.Message(arbitration_id=can_id, data=data, is_extended_id=False)
        self.master.send(message)
        self.pump()

    def pump(self):
        """Carry all frames that are on the bus to the drive, and its answers to the master."""
        while (message := self.wire.recv(0.0)) is not None:
            frame = CanFrame(message.arbitration_id, bytes(message.data), message.is_remote_frame)
            self._transmit(self.node.on_frame(frame, self.t_ns))
        while (message := self.master.recv(0.0)) is not None:
            data = bytes(message.data)
            self.received.append((message.arbitration_id, data))
            if message.arbitration_id == 0x180 + NODE_ID:
                self.status = int.from_bytes(data, "little")
            if message.arbitration_id == 0x080 + NODE_ID:
                self.emergencies.append(int.from_bytes(data[:2], "little"))

    def step(self, samples=1):
        for _ in range(samples):
            feedback = DriveFeedback(
                self.position, positive_switch=self.switch, drive_fault=self.drive_fault
            )
            demand = self.node.step(self.t_ns, feedback)
            self._transmit(self.node.on_time(self.t_ns))
            self.pump()
            if demand.kind == "velocity":
                self.position += demand.velocity * 1e-3
            self.t_ns += MS

    def control(self, *words):
        for word in words:
            self.send(0x200 + NODE_ID, word.to_bytes(2, "little"))

    def write(self, index, sub, value, length):
        command = 0x23 | (4 - length) << 2
        data = bytes([command, index & 0xFF, index >> 8, sub]) + value.to_bytes(4, "little")
        self.send(0x600 + NODE_ID, data)
        assert self.received[-1][1][0] == 0x60

    def start(self):
        self.step()
        self.send(0x000, [0x01, NODE_ID])

    def move(self):
        """Enable cyclic velocity with a long quick stop, and move."""
        self.start()
        self.write(0x6060, 0, 9, 1)
        self.write(0x605A, 0, 6, 2)
        self.write(0x6085, 0, 100, 4)
        self.control(SHUTDOWN, SWITCH_ON, ENABLE)
        self.write(0x60FF, 0, 1000, 4)
        self.step(20)

    def state(self):
        (name,) = [n for n, (mask, value) in STATES.items() if self.status & mask == value]
        return name

    def _transmit(self, frames):
        for frame in frames:
            message = can.Message(
                arbitration_id=frame.can_id, data=frame.data, is_extended_id=False
            )
            self.wire.send(message)


@pytest.fixture
def bus():
    bench = BusBench()
    yield bench
    bench.close()


def test_transitions_0_and_1_follow_power_on_and_the_first_sample(bus):
    bus._transmit(bus.node.on_time(0))
    bus.send(0x000, [0x01, NODE_ID])
    assert bus.received[0] == (0x700 + NODE_ID, b"\0")
    assert bus.state() == "not ready to switch on"
    bus.step()
    assert bus.state() == "switch on disabled"


@pytest.mark.parametrize(
    ("number", "words", "before", "word", "after"),
    [
        (2, (), "switch on disabled", SHUTDOWN, "ready to switch on"),
        (3, (SHUTDOWN,), "ready to switch on", SWITCH_ON, "switched on"),
        (4, (SHUTDOWN, SWITCH_ON), "switched on", ENABLE, "operation enabled"),
        (5, (SHUTDOWN, ENABLE), "operation enabled", SWITCH_ON, "switched on"),
        (6, (SHUTDOWN, SWITCH_ON), "switched on", SHUTDOWN, "ready to switch on"),
        (7, (SHUTDOWN,), "ready to switch on", DISABLE_VOLTAGE, "switch on disabled"),
        (8, (SHUTDOWN, ENABLE), "operation enabled", SHUTDOWN, "ready to switch on"),
        (9, (SHUTDOWN, ENABLE), "operation enabled", DISABLE_VOLTAGE, "switch on disabled"),
        (10, (SHUTDOWN, SWITCH_ON), "switched on", DISABLE_VOLTAGE, "switch on disabled"),
        (10, (SHUTDOWN, SWITCH_ON), "switched on", QUICK_STOP, "switch on disabled"),
    ],
)
def test_a_control_word_in_a_pdo_makes_its_transition(bus, number, words, before, word, after):
    bus.start()
    bus.control(*words)
    assert bus.state() == before
    bus.control(word)
    assert bus.state() == after


def test_transitions_11_and_12_and_16_enter_and_leave_the_quick_stop(bus):
    bus.move()
    bus.control(QUICK_STOP)
    assert bus.state() == "quick stop active"
    bus.control(ENABLE)
    assert bus.state() == "operation enabled"
    bus.control(QUICK_STOP)
    bus.control(DISABLE_VOLTAGE)
    assert bus.state() == "switch on disabled"


def test_transition_12_follows_the_end_of_the_ramp(bus):
    bus.move()
    bus.write(0x605A, 0, 2, 2)
    bus.write(0x6085, 0, 100_000, 4)
    bus.control(QUICK_STOP)
    bus.step(9)
    assert bus.state() == "quick stop active"
    bus.step(3)
    assert bus.state() == "switch on disabled"


def test_transitions_13_and_14_and_15_follow_a_fault_its_reaction_and_its_reset(bus):
    bus.move()
    bus.write(0x6085, 0, 100_000, 4)
    bus.switch = True
    bus.step(2)
    assert bus.state() == "fault reaction active"
    assert bus.emergencies == [0x8612]
    bus.control(RESET, 0x00)
    assert bus.state() == "fault reaction active"
    bus.step(12)
    assert bus.state() == "fault"
    bus.control(SHUTDOWN, SWITCH_ON, ENABLE)
    assert bus.state() == "fault"
    bus.control(RESET)
    assert bus.state() == "switch on disabled"
    assert bus.emergencies == [0x8612, 0]


def test_a_fault_of_the_power_stage_is_on_the_bus_within_one_sample(bus):
    bus.start()
    bus.control(SHUTDOWN, ENABLE)
    bus.drive_fault = 0x2320
    bus.step()
    assert bus.state() == "fault"
    assert bus.emergencies == [0x2320]
