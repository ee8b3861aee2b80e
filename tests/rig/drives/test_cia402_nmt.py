"""Network management, heartbeat and emergency messages against CiA 301."""

import pytest

from rig.drives.cia402.emergency import register_bits
from rig.drives.cia402.frames import CanFrame
from rig.drives.cia402.node import DriveNode
from tests.rig.drives.cia402_bench import MS, NODE_ID, NodeBench, SdoRefused

MASTER = 0x7F
BOOT_UP = CanFrame(0x700 + NODE_ID, b"\0")


def heartbeat_states(frames):
    return [f.data[0] for f in frames if f.can_id == 0x700 + NODE_ID]


def watched(time_ms=20, **objects):
    """Moving bench whose drive watches the heartbeat of the master, which came once."""
    bench = NodeBench().enable(9)
    bench.nmt(1)
    bench.write(0x1016, MASTER << 16 | time_ms, 1)
    bench.write(0x6085, 100_000)
    bench.write(0x606F, 50)
    bench.write(0x60FF, 1000)
    for name, value in objects.items():
        bench.write(int(name[1:5], 16), value, int(name[6:] or 0))
    bench.run(20)
    bench.send(0x700 + MASTER, b"\x05")
    return bench


def test_the_boot_up_message_is_sent_once():
    node = DriveNode(NODE_ID)
    assert node.on_time(0) == [BOOT_UP]
    assert node.on_time(MS) == []
    assert node.nmt_state.name == "PRE_OPERATIONAL"


@pytest.mark.parametrize(
    ("command", "state", "boots"),
    [
        (0x01, "OPERATIONAL", False),
        (0x02, "STOPPED", False),
        (0x80, "PRE_OPERATIONAL", False),
        (0x81, "PRE_OPERATIONAL", True),
        (0x82, "PRE_OPERATIONAL", True),
    ],
)
@pytest.mark.parametrize("before", [0x01, 0x02, 0x80])
@pytest.mark.parametrize("address", [0, NODE_ID])
def test_an_nmt_command_leads_from_every_state_to_its_state(command, state, boots, before, address):
    bench = NodeBench()
    bench.nmt(before)
    frames = bench.nmt(command, address)
    assert bench.node.nmt_state.name == state
    assert (BOOT_UP in frames) == boots


@pytest.mark.parametrize("data", [[1, NODE_ID + 1], [3, NODE_ID], [1], [1, NODE_ID, 0], []])
def test_a_command_for_another_node_or_of_another_form_is_ignored(data):
    bench = NodeBench()
    assert bench.send(0x000, data) == []
    assert bench.node.nmt_state.name == "PRE_OPERATIONAL"


def test_a_stopped_node_answers_no_sdo():
    bench = NodeBench()
    bench.nmt(2)
    assert bench.send(0x605, b"\x40\0\x10\0" + bytes(4)) == []


def test_a_stopped_node_drops_an_sdo_transfer_without_a_time_out():
    bench = NodeBench(sdo_timeout_ns=10 * MS)
    bench.request(b"\x40\x08\x10\0" + bytes(4))
    bench.nmt(2)
    bench.sent.clear()
    bench.run(30)
    assert bench.sent == []


def test_a_stopped_node_holds_its_emergency_messages_back():
    bench = NodeBench()
    bench.nmt(2)
    bench.drive_fault = 0x2310
    bench.run(1)
    assert bench.emergencies() == []
    bench.nmt(0x80)
    assert bench.emergencies() == [(0x2310, 0x03)]


def test_the_heartbeat_has_its_period_and_the_nmt_state():
    bench = NodeBench()
    bench.write(0x1017, 10)
    bench.sent.clear()
    bench.run(30)
    bench.nmt(1)
    bench.run(10)
    bench.nmt(2)
    bench.run(10)
    assert heartbeat_states(bench.sent) == [0x7F, 0x7F, 0x7F, 0x05, 0x04]


def test_a_late_call_sends_one_heartbeat_and_keeps_the_period():
    node = DriveNode(NODE_ID)
    node.on_time(0)
    node.dictionary.write(0x1017, 0, b"\x0a\0")
    times = [t for t in (0, 5, 10, 47, 49, 50, 60) if node.on_time(t * MS)]
    assert times == [0, 10, 47, 50, 60]


def test_a_heartbeat_period_of_0_switches_it_off():
    bench = NodeBench()
    bench.write(0x1017, 10)
    bench.run(5)
    bench.write(0x1017, 0)
    bench.sent.clear()
    bench.run(50)
    assert bench.sent == []


def test_a_lost_heartbeat_stops_the_axis_quickly_and_then_is_a_fault():
    bench = watched(time_ms=20)
    bench.run(20)
    assert bench.node.state.name == "OPERATION_ENABLED"
    demands = bench.run(15)
    assert bench.emergencies() == [(0x8130, 0x11)]
    assert [d.kind for d in demands] == ["velocity"] * 10 + ["brake"] + ["off"] * 4
    assert [round(d.velocity) for d in demands[:11]] == list(range(1000, -1, -100))
    assert bench.node.state.name == "FAULT"
    assert bench.read(0x603F) == 0x8130
    assert bench.node.nmt_state.name == "PRE_OPERATIONAL"


def test_heartbeats_in_time_keep_the_drive_running():
    bench = watched(time_ms=20)
    for _ in range(10):
        bench.run(19)
        bench.send(0x700 + MASTER, b"\x05")
    assert bench.node.state.name == "OPERATION_ENABLED"
    assert bench.emergencies() == []


def test_the_watch_starts_with_the_first_heartbeat():
    bench = NodeBench()
    bench.write(0x1016, MASTER << 16 | 10, 1)
    bench.run(50)
    bench.send(0x700 + MASTER + 1 - 2, b"\x05")  # another node
    bench.run(50)
    assert bench.emergencies() == []
    bench.send(0x700 + MASTER, b"\x05")
    bench.run(11)
    assert bench.emergencies() == [(0x8130, 0x11)]


def test_a_reset_of_the_communication_ends_the_watch_of_the_master():
    bench = watched()
    bench.nmt(0x82)
    bench.run(100)
    assert bench.emergencies() == []
    bench.write(0x1016, MASTER << 16 | 20, 1)
    bench.run(100)
    assert bench.emergencies() == []


@pytest.mark.parametrize(("setting", "state"), [(0, 0x7F), (1, 0x05), (2, 0x04)])
def test_the_nmt_state_after_a_lost_heartbeat_is_configured_in_1029(setting, state):
    bench = watched(x1029_1=setting)
    bench.run(30)
    assert bench.node.nmt_state == state


@pytest.mark.parametrize(
    ("option", "state"),
    [
        (0, "OPERATION_ENABLED"),
        (1, "FAULT"),
        (2, "SWITCH_ON_DISABLED"),
        (3, "SWITCH_ON_DISABLED"),  # after the quick stop
    ],
)
def test_the_reaction_to_a_lost_heartbeat_is_configured_in_6007(option, state):
    bench = watched(x6007_=option)
    bench.run(40)
    assert bench.node.state.name == state
    assert bench.emergencies() == [(0x8130, 0x11)]


def test_a_heartbeat_that_returns_ends_the_error_only_after_a_fault_reset():
    bench = watched()
    bench.run(40)
    bench.send(0x700 + MASTER, b"\x05")
    assert bench.emergencies() == [(0x8130, 0x11)]
    bench.command(0x80)
    assert bench.emergencies() == [(0x8130, 0x11), (0, 0)]
    assert bench.node.state.name == "SWITCH_ON_DISABLED"


def test_a_heartbeat_that_returns_without_fault_ends_the_error():
    bench = watched(x6007_=0)
    bench.run(30)
    bench.send(0x700 + MASTER, b"\x05")
    assert bench.emergencies() == [(0x8130, 0x11), (0, 0)]


@pytest.mark.parametrize("command", [0x02, 0x80, 0x82])
def test_leaving_operational_stops_a_moving_axis_quickly(command):
    bench = watched()
    bench.nmt(command)
    assert bench.node.state.name == "QUICK_STOP_ACTIVE"
    bench.run(12)
    assert bench.node.state.name == "SWITCH_ON_DISABLED"


def test_the_error_history_holds_the_latest_8_errors_newest_first_and_can_be_cleared():
    bench = NodeBench()
    codes = [0x2310 + n for n in range(10)]
    for code in codes:
        bench.drive_fault = code
        bench.run(1)
    assert bench.read(0x1003) == 8
    assert [bench.read(0x1003, sub) for sub in range(1, 9)] == codes[:1:-1]
    bench.write(0x1003, 0)
    assert bench.read(0x1003) == 0
    with pytest.raises(SdoRefused, match="0x08000024"):
        bench.read(0x1003, 1)
    assert bench.read(0x1001) == 0x03  # the errors are still active


def test_a_persisting_fault_is_reported_once():
    bench = NodeBench()
    bench.drive_fault = 0x2310
    bench.run(50)
    assert bench.emergencies() == [(0x2310, 0x03)]
    assert bench.read(0x1003) == 1


def test_disabled_emergency_messages_are_not_sent_but_stored():
    bench = NodeBench()
    bench.write(0x1014, 0x85 | 1 << 31)
    bench.drive_fault = 0x4210
    bench.run(1)
    assert bench.emergencies() == []
    assert bench.read(0x1003, 1) == 0x4210


def test_a_reset_of_the_node_forgets_errors_and_settings():
    bench = NodeBench()
    bench.write(0x6066, 50)
    bench.drive_fault = 0x2310
    bench.run(1)
    bench.drive_fault = 0
    bench.nmt(0x81)
    assert (bench.read(0x1001), bench.read(0x1003), bench.read(0x6066)) == (0, 0, 0)


def test_a_reset_of_the_communication_keeps_the_error_register_of_active_errors():
    bench = NodeBench()
    bench.drive_fault = 0x2310
    bench.run(1)
    bench.nmt(0x82)
    assert bench.read(0x1001) == 0x03


@pytest.mark.parametrize(
    ("code", "bits"),
    [
        (0x0000, 0x00),
        (0x1000, 0x01),
        (0x2310, 0x03),
        (0x3210, 0x05),
        (0x4210, 0x09),
        (0x5112, 0x01),
        (0x7305, 0x21),
        (0x8130, 0x11),
        (0x8210, 0x11),
        (0x8611, 0x21),
        (0xFF01, 0x81),
    ],
)
def test_the_error_register_shows_the_class_of_a_code(code, bits):
    assert register_bits(code) == bits
