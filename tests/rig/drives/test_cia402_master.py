"""The node under the master of the canopen library, with the EDS file that ships.

The drive runs in a thread. Its time is simulated: it passes freely, or with each SYNC alone. No
result depends on the speed of the machine; every wait has a bound.
"""

import itertools
import queue
import threading
from importlib import resources

import can
import canopen
import pytest
from canopen.profiles import p402

from rig.drives.cia402.frames import CanFrame
from rig.drives.cia402.node import DriveNode
from rig.drives.cia402.signals import DriveFeedback

NODE_ID = 12
BOUND_S = 20.0  # of every wait
MS = 1_000_000
PERIOD_SAMPLES = 10
CHANNELS = itertools.count()
EDS = str(resources.files("rig.drives.cia402") / "swayless_drive.eds")


class DriveThread:
    """Drive with an ideal axis and end switches, in a thread on a virtual bus."""

    def __init__(self, channel):
        self.bus = can.Bus(interface="virtual", channel=channel)
        self.node = DriveNode(NODE_ID, sdo_timeout_ns=10**15)
        self.position = 0.0
        self.negative_end = -40.0
        self.drive_fault = 0
        self.runs_freely = threading.Event()
        self.runs_freely.set()
        self._is_stopped = threading.Event()
        self._t_ns = 0
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self):
        self._thread.start()

    def stop(self):
        self._is_stopped.set()
        self._thread.join(BOUND_S)
        assert not self._thread.is_alive()
        self.bus.shutdown()

    def _run(self):
        while not self._is_stopped.is_set():
            message = self.bus.recv(0.0005)
            if message is not None:
                frame = CanFrame(message.arbitration_id, bytes(message.data))
                self._transmit(self.node.on_frame(frame, self._t_ns))
            if self.runs_freely.is_set():
                self._sample()
            elif message is not None and message.arbitration_id == 0x080:
                for _ in range(PERIOD_SAMPLES):
                    self._sample()

    def _sample(self):
        feedback = DriveFeedback(
            self.position,
            negative_switch=self.position <= self.negative_end,
            drive_fault=self.drive_fault,
        )
        demand = self.node.step(self._t_ns, feedback)
        self._transmit(self.node.on_time(self._t_ns))
        if demand.kind in ("position", "brake"):
            self.position = demand.position
        self._t_ns += MS

    def _transmit(self, frames):
        for frame in frames:
            message = can.Message(
                arbitration_id=frame.can_id, data=frame.data, is_extended_id=False
            )
            self.bus.send(message)


class Master:
    """canopen network with one drive; the boot-up message is awaited."""

    def __init__(self):
        channel = f"canopen-{next(CHANNELS)}"
        self.drive = DriveThread(channel)
        self.network = canopen.Network(can.Bus(interface="virtual", channel=channel))
        self.network.NOTIFIER_CYCLE = 0.05
        self.network.connect()
        self.node = p402.BaseNode402(NODE_ID, EDS)
        self.node.sdo.RESPONSE_TIMEOUT = BOUND_S
        self.network.add_node(self.node)
        self.boot_ups = queue.Queue()
        self.network.subscribe(0x700 + NODE_ID, lambda _, data, __: self.boot_ups.put(bytes(data)))
        self.drive.start()
        assert self.boot_ups.get(timeout=BOUND_S) == b"\0"

    def close(self):
        self.drive.stop()
        self.network.disconnect()

    def enable(self):
        """Start the node and bring the drive into OPERATION ENABLED."""
        self.node.setup_402_state_machine()
        self.start()
        self.node.state = "OPERATION ENABLED"

    def start(self):
        """Enter OPERATIONAL; the first status word has then arrived."""
        arrived = threading.Event()
        self.node.tpdo[1].add_callback(lambda _: arrived.set())
        self.node.nmt.state = "OPERATIONAL"
        assert arrived.wait(BOUND_S)


@pytest.fixture
def master(monkeypatch):
    for name in ("RESET_FAULT", "SWITCH_OP_MODE", "SWITCH_STATE_FINAL", "SWITCH_STATE_SINGLE"):
        monkeypatch.setattr(p402.BaseNode402, f"TIMEOUT_{name}", BOUND_S)
    monkeypatch.setattr(p402.BaseNode402, "TIMEOUT_CHECK_TPDO", BOUND_S)
    session = Master()
    yield session
    session.close()


def test_the_eds_file_has_an_entry_for_every_object_that_the_library_needs():
    dictionary = canopen.import_od(EDS, NODE_ID)
    assert dictionary[0x6041].pdo_mappable
    assert dictionary[0x1400][1].default == 0x200 + NODE_ID
    assert dictionary.device_information.nr_of_RXPDO == 4


def test_the_library_reads_and_writes_by_segments(master):
    assert master.node.sdo[0x1008].raw == "Swayless servo drive"
    master.node.sdo[0x6404].raw = "Motor works of the example, type 4711"
    assert master.node.sdo[0x6404].raw == "Motor works of the example, type 4711"
    assert master.node.sdo["Identity object"]["Product code"].raw == 0x402
    assert master.node.sdo[0x607A].raw == 0


def test_the_library_sees_the_abort_codes(master):
    with pytest.raises(canopen.SdoAbortedError) as refused:
        master.node.sdo.download(0x6041, 0, b"\0\0")
    assert refused.value.code == 0x06010002
    with pytest.raises(canopen.SdoAbortedError) as refused:
        master.node.sdo.upload(0x2345, 0)
    assert refused.value.code == 0x06020000


def test_the_library_maps_a_pdo(master):
    received = queue.Queue()
    tpdo = master.node.tpdo[4]
    master.node.tpdo.read()
    tpdo.clear()
    tpdo.add_variable(0x6064)
    tpdo.add_variable(0x6061)
    tpdo.add_variable(0x6077)
    tpdo.trans_type = 1
    tpdo.enabled = True
    tpdo.save()
    tpdo.add_callback(lambda pdo: received.put([entry.raw for entry in pdo]))
    master.drive.position = -123.0
    master.node.sdo[0x6060].raw = 8
    master.start()
    master.network.sync.transmit()
    position, mode, torque = received.get(timeout=BOUND_S)
    assert (position, mode, torque) == (-123, 8, 0)


def test_the_library_is_told_that_a_pdo_is_too_long(master):
    tpdo = master.node.tpdo[4]
    master.node.tpdo.read()
    tpdo.clear()
    for index in (0x6064, 0x606C, 0x6061):
        tpdo.add_variable(index)
    with pytest.raises(canopen.SdoAbortedError) as refused:
        tpdo.save()
    assert refused.value.code == 0x06040042


def test_the_library_brings_the_drive_through_its_states(master):
    master.node.setup_402_state_machine()
    master.start()
    assert master.node.state == "SWITCH ON DISABLED"
    for state in (
        "READY TO SWITCH ON",
        "SWITCHED ON",
        "OPERATION ENABLED",
        "SWITCHED ON",
        "READY TO SWITCH ON",
        "SWITCH ON DISABLED",
    ):
        master.node.state = state
        assert master.node.state == state


def test_the_library_resets_a_fault_and_sees_its_emergency_messages(master):
    codes = queue.Queue()
    master.node.emcy.add_callback(lambda error: codes.put((error.code, error.register)))
    master.enable()
    master.drive.drive_fault = 0x2310
    assert codes.get(timeout=BOUND_S) == (0x2310, 0x03)
    assert master.node.sdo[0x603F].raw == 0x2310
    assert master.node.sdo[0x1003][1].raw == 0x2310
    assert master.node.is_faulted()
    master.drive.drive_fault = 0
    while master.node.is_faulted():
        master.node.controlword = 0x00
        master.node.controlword = 0x80
        master.node.check_statusword()
    assert codes.get(timeout=BOUND_S) == (0, 0)
    master.node.state = "OPERATION ENABLED"


def test_the_library_resets_the_node(master):
    master.node.sdo[0x1017].raw = 0
    master.node.sdo[0x6066].raw = 77
    master.node.nmt.state = "RESET"
    assert master.boot_ups.get(timeout=BOUND_S) == b"\0"
    assert master.node.sdo[0x6066].raw == 0


def test_the_library_sees_the_heartbeat(master):
    master.node.sdo[0x1017].raw = 10
    states = [master.boot_ups.get(timeout=BOUND_S) for _ in range(3)]
    assert states == [b"\x7f"] * 3
    assert master.node.nmt.state == "PRE-OPERATIONAL"


def test_the_library_homes_the_axis_on_its_switch_and_moves_it_cyclically(master):
    node = master.node
    node.sdo[0x6098].raw = 17
    node.sdo[0x6099][1].raw = 500
    node.sdo[0x6099][2].raw = 100
    node.sdo[0x60C2][1].raw = PERIOD_SAMPLES
    master.enable()
    assert node.homing(timeout=BOUND_S)
    assert master.drive.position == pytest.approx(-40.0, abs=1.0)
    # the library sends the mode in RPDO 2, whose control word is 0: the drive is disabled by it
    node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
    node.state = "OPERATION ENABLED"
    master.drive.runs_freely.clear()

    positions = queue.Queue()
    node.tpdo[3].add_callback(lambda pdo: positions.put(pdo[0x6064].raw))
    start = node.sdo[0x6064].raw
    targets = [start + 5 * cycle for cycle in range(1, 41)] + [start + 200] * 3
    seen = []
    for target in targets:
        node.rpdo[3][0x6040].raw = 0x0F
        node.rpdo[3][0x607A].raw = target
        node.rpdo[3].transmit()
        master.network.sync.transmit()
        seen.append(positions.get(timeout=BOUND_S))
    assert seen == sorted(seen)
    for cycle in range(3, 40):
        # one period of interpolation and one sample of measurement behind the master
        assert targets[cycle - 2] - 1 <= seen[cycle] <= targets[cycle - 1]
    assert seen[-1] == start + 200
    assert node.state == "OPERATION ENABLED"
