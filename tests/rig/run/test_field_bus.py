"""Names, load, traces, choice and check of the field bus, each against something independent."""

import contextlib
import itertools
import json
import os
import struct

import can
import cantools
import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from comms.can_bits import frame_bits
from comms.can_bus import CanSettings
from comms.clock import new_run_clock
from rig.analysis.readers import can_trace
from rig.errors import ConfigError, Refused, RunFailed
from rig.run import operator_file
from rig.run.config import read_experiment
from rig.run.doctor import examine
from rig.run.drive_section import AxisDriveSection
from rig.run.field_bus import bus_choice, objects, source
from rig.run.field_bus.bus_choice import BusOptions, choose_bus, run_on
from rig.run.field_bus.check import check_field_bus
from rig.run.field_bus.decoding import Decoder
from rig.run.field_bus.exchange import REQUEST_PERIOD_NS, Exchange
from rig.run.field_bus.names import dbc_text, frame_rows, function_name
from rig.run.field_bus.statistics import FrameCounter
from rig.run.operator_file import OperatorFile
from rig.run.tasks.drive import start_up
from tests.rig.run.can_node import ServedNodes, new_channel

DRIVES = (
    AxisDriveSection(),
    AxisDriveSection(node_id=17, lead_m=0.017, encoder_counts_per_rev=9_999, rated_torque_n_m=1.37),
)
I32 = st.integers(-(2**31), 2**31 - 1)
I16 = st.integers(-(2**15), 2**15 - 1)
U16 = st.integers(0, 2**16 - 1)


def database_of(drive):
    return cantools.database.load_string(dbc_text(drive), "dbc", strict=True)


DATABASES = [(drive, database_of(drive)) for drive in DRIVES]


# DBC


@pytest.mark.parametrize(("drive", "names"), DATABASES, ids=["default", "other"])
@given(position=I32, velocity=I32)
def test_the_dbc_reads_and_writes_a_motion_as_struct_does(drive, names, position, velocity):
    data = struct.pack("<ii", position, velocity)
    values = names.decode_message(start_up.TPDO_MOTION + drive.node_id, data)
    assert values["position"] == pytest.approx(position / drive.increments_per_unit, rel=1e-12)
    assert values["velocity"] == pytest.approx(velocity / drive.increments_per_unit, rel=1e-12)
    assert names.encode_message("tpdo1", values) == data


@pytest.mark.parametrize(("drive", "names"), DATABASES, ids=["default", "other"])
@given(word=U16, target=I32, torque=I16)
def test_the_dbc_reads_and_writes_words_target_and_torque_as_struct_does(
    drive, names, word, target, torque
):
    down = struct.pack("<Hi", word, target)
    values = names.decode_message(start_up.RPDO + drive.node_id, down)
    assert values["control_word"] == word
    assert values["target_position"] == pytest.approx(target / drive.increments_per_unit, rel=1e-12)
    assert names.encode_message("rpdo1", values) == down
    up = struct.pack("<Hh", word, torque)
    values = names.decode_message(start_up.TPDO_STATUS + drive.node_id, up)
    assert values["status_word"] == word
    assert values["torque"] == pytest.approx(torque * drive.rated_torque_n_m / 1000, rel=1e-12)
    assert names.encode_message("tpdo2", values) == up


@pytest.mark.parametrize(("drive", "names"), DATABASES, ids=["default", "other"])
def test_the_dbc_names_the_frames_that_the_master_configures(drive, names):
    """Identifier and length of each PDO are those of the mapping that start_up writes."""
    from rig.run.drive_settings import drive_settings
    from rig.run.job import safety_envelope

    settings = drive_settings(drive, safety_envelope(read_experiment("move", [])))
    written = {(a.object_index, a.subindex): a.value for a in start_up.accesses(settings)}
    for parameter in (0x1400, 0x1800, 0x1801):
        mapping = [written[parameter + 0x200, k + 1] for k in range(written[parameter + 0x200, 0])]
        message = names.get_message_by_frame_id(written[parameter, 1])
        lengths = [signal.length for signal in message.signals]
        assert lengths == [entry & 0xFF for entry in mapping]
        assert message.length == sum(lengths) / 8


def test_the_signals_of_a_frame_fill_it_without_overlap():
    for row in frame_rows(AxisDriveSection()):
        assert row.length <= 8
        bits = [bit for s in row.signals for bit in range(s.start, s.start + s.length)]
        assert bits == list(range(8 * row.length))


def test_states_and_commands_have_names_in_the_dbc():
    names = database_of(AxisDriveSection(node_id=5))
    assert str(names.decode_message(0x705, b"\x7f")["nmt_state"]) == "pre_operational"
    assert str(names.decode_message(0x000, b"\x01\x05")["command"]) == "start"


@pytest.mark.parametrize(
    ("can_id", "name"),
    [
        (0x000, "nmt"),
        (0x080, "sync"),
        (0x085, "emergency 5"),
        (0x385, "tpdo3 5"),
        (0x501, "rpdo4 1"),
        (0x67F, "sdo_request 127"),
        (0x700, ""),
        (0x123 & 0x07F, ""),
    ],
)
def test_an_identifier_has_the_function_of_the_connection_set(can_id, name):
    assert function_name(can_id) == name
    assert function_name(can_id, is_extended=True) == ""


def test_a_frame_of_another_length_is_named_and_not_decoded():
    frame = can.Message(arbitration_id=0x181, data=b"abc", is_extended_id=False)
    decoded = Decoder.of_drive(AxisDriveSection()).decode(frame)
    assert decoded.name == "tpdo1"
    assert "not decoded" in decoded.text


# Load


def stuffed_length(bits):
    """Number of bits after stuffing, by the rule itself: a bit after five equal ones."""
    count, run, last = 0, 0, None
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        count += 1
        if run == 5:
            count += 1
            last, run = 1 - bit, 1
    return count


@pytest.mark.parametrize("length", range(9))
@pytest.mark.parametrize("is_extended", [False, True])
def test_the_worst_length_is_that_of_the_worst_pattern_of_bits(length, is_extended):
    exposed = (54 if is_extended else 34) + 8 * length
    # five equal bits, then four of each kind: every stuff bit begins the next run
    pattern = [0] * 5
    for bit in itertools.cycle([1, 0]):
        pattern += [bit] * 4
        if len(pattern) >= exposed:
            break
    bits = frame_bits(length, is_extended)
    assert bits.nominal == exposed + 13
    assert bits.worst == stuffed_length(pattern[:exposed]) + 13


def test_a_full_bus_has_a_load_of_one():
    frame_s = frame_bits(8, is_extended=False).nominal / 500_000
    counter = FrameCounter(500_000)
    for k in range(101):
        stamp = k * frame_s
        counter.add(can.Message(timestamp=stamp, data=bytes(8), is_extended_id=False))
    result = counter.result()
    assert result.load_nominal == pytest.approx(1.0)
    assert result.load_worst == pytest.approx(135 / 111)


def test_rate_and_jitter_are_those_of_numpy():
    import numpy as np

    stamps = np.cumsum(np.random.default_rng(1).normal(5e-3, 1e-4, 500))
    counter = FrameCounter(1_000_000)
    for stamp in stamps:
        counter.add(can.Message(timestamp=stamp, arbitration_id=0x181, is_extended_id=False))
    (row,) = counter.result().by_id
    periods = np.diff(stamps)
    assert row.frames == 500
    assert row.rate_hz == pytest.approx(1 / periods.mean())
    assert row.jitter_ms == pytest.approx(1e3 * periods.std(ddof=1))
    assert row.longest_ms == pytest.approx(1e3 * periods.max())


def test_error_frames_are_counted_and_leave_the_load_alone():
    counter = FrameCounter(1_000_000)
    counter.add(can.Message(timestamp=0.0, is_extended_id=False))
    counter.add(can.Message(timestamp=1.0, is_error_frame=True))
    result = counter.result()
    assert (result.frames, result.error_frames, result.load_nominal) == (2, 1, 0.0)


# Objects


@pytest.mark.parametrize(
    ("text", "name"),
    [("6064", "6064:00"), ("1018:1", "1018:01"), ("0x1018:0xA", "1018:0A"), ("6", "0006:00")],
)
def test_an_address_is_hexadecimal(text, name):
    assert objects.parse_address(text).name == name


@pytest.mark.parametrize("text", ["", "60641", "1018:", "1018:100", "xy", "1018:1:1", "-1"])
def test_an_address_of_another_form_is_refused(text):
    with pytest.raises(ConfigError, match="must be INDEX or INDEX:SUB"):
        objects.parse_address(text)


@pytest.mark.parametrize("bits", [8, 16, 32, 64])
@pytest.mark.parametrize("sign", ["u", "i"])
def test_an_integer_keeps_its_value_and_its_range(bits, sign):
    kind = f"{sign}{bits}"
    low = -(2 ** (bits - 1)) if sign == "i" else 0
    high = low + 2**bits - 1
    for value in (low, 0, 1, high):
        data = objects.encode(str(value), kind)
        assert len(data) == bits // 8
        assert objects.decode(data, kind).value == value
    for value in (low - 1, high + 1):
        with pytest.raises(ConfigError, match=f"must be {low} to {high}"):
            objects.encode(str(value), kind)


def test_bytes_of_another_length_than_the_type_are_shown_as_they_are():
    assert objects.decode(b"\x01\x02\x03", "u32") == (b"\x01\x02\x03", "hex", "01 02 03")


@pytest.mark.parametrize(
    ("text", "kind", "data"),
    [
        ("1.5", "f32", struct.pack("<f", 1.5)),
        ("-2", "f64", struct.pack("<d", -2.0)),
        ("0A ff", "hex", b"\x0a\xff"),
        ("drive", "str", b"drive"),
        ("0x10", "u16", b"\x10\x00"),
    ],
)
def test_a_typed_value_becomes_the_bytes_of_its_type(text, kind, data):
    assert objects.encode(text, kind) == data


@pytest.mark.parametrize(
    ("text", "kind"), [("x", "u8"), ("1e400", "f32"), ("abc", "hex"), ("é", "str"), ("1.5", "i8")]
)
def test_a_value_that_the_type_cannot_hold_is_refused(text, kind):
    with pytest.raises(ConfigError):
        objects.encode(text, kind)


# Exchange


def test_requests_are_a_millisecond_apart():
    channel = new_channel()
    with (
        can.Bus(interface="virtual", channel=channel) as bus,
        can.Bus(interface="virtual", channel=channel) as other,
    ):
        clock = new_run_clock()
        exchange = Exchange(bus, clock)
        start_ns = clock.now_ns()
        for node_id in range(1, 31):
            exchange.send_message(0x600 + node_id, bytes(8))
        assert clock.now_ns() - start_ns >= 29 * REQUEST_PERIOD_NS
        sent = [other.recv(0) for _ in range(30)]
        assert [message.arbitration_id for message in sent] == list(range(0x601, 0x61F))
        assert other.recv(0) is None


# Choice of the bus


def write_operator(folder, can_settings, pid=None):
    folder.mkdir(parents=True)
    OperatorFile("tcp://127.0.0.1:1", pid or os.getpid(), can=can_settings).write(folder)


def test_the_operator_file_keeps_the_settings_of_the_bus(tmp_path):
    settings = msgspec.to_builtins(CanSettings(interface="swayless_udp", port=47300))
    write_operator(tmp_path / "a", settings)
    assert operator_file.read(tmp_path / "a" / operator_file.NAME).can == settings


def test_the_operator_file_of_an_older_build_has_no_bus(tmp_path):
    path = tmp_path / operator_file.NAME
    path.write_text(json.dumps({"address": "tcp://127.0.0.1:1", "pid": 1}))
    assert operator_file.read(path).can == {}


def test_the_bus_is_that_of_the_newest_run_that_goes_on(tmp_path):
    write_operator(tmp_path / "1", {"interface": "swayless_udp", "port": 1000})
    write_operator(tmp_path / "2", {"interface": "swayless_udp", "port": 2000})
    write_operator(tmp_path / "3", {})  # a run without a drive
    write_operator(tmp_path / "4", {"interface": "swayless_udp", "port": 4000}, pid=2**22 + 1)
    choice = choose_bus(BusOptions(runs=tmp_path))
    assert choice.settings.port == 2000
    assert choice.run == tmp_path / "2"


@pytest.mark.parametrize(
    ("interface", "channel", "port"),
    [
        ("swayless_udp", "127.0.0.1:2000", 0),
        ("swayless_udp", "", 2000),
    ],
)
def test_a_bus_that_is_named_is_found_to_be_that_of_a_run(tmp_path, interface, channel, port):
    write_operator(tmp_path / "2", {"interface": "swayless_udp", "port": 2000})
    settings = CanSettings(interface=interface, channel=channel, port=port)
    assert run_on(settings, tmp_path) == tmp_path / "2"
    other = CanSettings(interface=interface, channel="127.0.0.1:2001")
    assert run_on(other, tmp_path) is None


def test_the_bus_of_an_experiment_is_that_of_its_can_table(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(
        '[experiment]\nname = "x"\nkind = "move"\n'
        '[can]\ninterface = "virtual"\nchannel = "c"\nbitrate = 250000\n[drive]\nnode_id = 3\n'
    )
    choice = choose_bus(BusOptions(experiment=str(path), runs=tmp_path))
    assert choice.name == "virtual c"
    assert choice.settings.bitrate == 250_000
    assert choice.drive.node_id == 3


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        (BusOptions(), Refused, "nothing with a drive is running"),
        (BusOptions("socketcn"), Refused, "did you mean 'socketcan'"),
        (BusOptions(channel="can0"), ConfigError, "without --interface"),
        (BusOptions("udp_multicast", "239.0.0.1"), ConfigError, "must be GROUP:PORT"),
        (BusOptions(experiment="move"), Refused, "interface = 'auto'"),
    ],
)
def test_a_bus_that_cannot_be_chosen_says_why(tmp_path, options, error, text):
    with pytest.raises(error, match=text):
        choose_bus(options._replace(runs=tmp_path))


def test_a_group_of_multicast_has_a_port():
    choice = choose_bus(BusOptions("udp_multicast", "239.74.163.2:43113"))
    assert (choice.settings.channel, choice.settings.port) == ("239.74.163.2", 43113)
    assert bus_choice.name_of(choice.settings) == "udp_multicast 239.74.163.2 port 43113"


# Check before a run

BALL_SCREW = "bench.robot.kind=ball_screw"


def experiment_on(channel, kind="external"):
    return read_experiment(
        "move",
        [
            BALL_SCREW,
            f"bench.kind={kind}",
            "can.interface=virtual",
            f"can.channel={channel}",
            "drive.node_id=5",
        ],
    )


def test_an_external_node_that_answers_is_found():
    channel = new_channel()
    with ServedNodes(channel, 5):
        interface, node = check_field_bus(experiment_on(channel))
    assert (interface.status, node.status) == ("ok", "ok")
    assert interface.found == f"virtual {channel} opened, 1000000 bit/s"
    assert node.name == "node 5"


def test_an_external_node_that_is_silent_fails():
    _, node = check_field_bus(experiment_on(new_channel()))
    assert node.status == "failed"
    assert "power, termination, bit rate" in node.advice


def test_a_node_beside_the_simulated_one_fails():
    channel = new_channel()
    with ServedNodes(channel, 5):
        _, node = check_field_bus(experiment_on(channel, "simulated"))
    assert node.status == "failed"
    _, node = check_field_bus(experiment_on(channel, "simulated"))
    assert node.status == "ok"


def test_an_interface_that_cannot_be_opened_fails():
    experiment = read_experiment("move", [BALL_SCREW, "can.interface=neovi"])
    (finding,) = check_field_bus(experiment)
    assert (finding.name, finding.status) == ("CAN interface", "failed")


def test_the_simulated_bus_is_by_multicast_or_by_unicast(monkeypatch):
    interface, node = check_field_bus(read_experiment("move", [BALL_SCREW]))
    assert interface.found.split(":")[0] in ("multicast", "unicast, as multicast is missing")
    assert node.found.startswith("simulated")
    monkeypatch.setattr("comms.can_bus.has_multicast", lambda port: False)
    interface, _ = check_field_bus(read_experiment("move", [BALL_SCREW]))
    assert interface.found.startswith("unicast, as multicast is missing")


def test_the_doctor_asks_nothing_without_a_drive(tmp_path, monkeypatch):
    from rig.run import machine
    from rig.run.config import NetworkSection

    def examined(experiment):
        timely = machine.grade_of(None, machine.lateness_of([0]))
        found = examine(tmp_path, NetworkSection(), lambda: timely, experiment)
        return [finding.name for finding in found.findings]

    monkeypatch.setattr("rig.run.field_bus.check.chosen", lambda settings: 1 / 0)
    assert "CAN interface" not in examined(None)
    assert "CAN interface" not in examined(read_experiment("move", []))
    monkeypatch.undo()
    assert "CAN interface" in examined(read_experiment("move", [BALL_SCREW]))


# Traces


def frames_of(count=5):
    """Frames of all kinds that a classic bus has."""
    yield can.Message(
        timestamp=1.0, arbitration_id=0x1ABCDEF0, data=b"\x01\x02", is_extended_id=True, channel=0
    )
    yield can.Message(
        timestamp=1.001, arbitration_id=0x123, is_remote_frame=True, dlc=4,
        is_extended_id=False, channel=0,
    )  # fmt: skip
    for k in range(count):
        yield can.Message(
            timestamp=1.01 + k * 1e-3, arbitration_id=0x181, data=bytes([k] * 8),
            is_extended_id=False, channel=0,
        )  # fmt: skip


WRITERS = {
    ".asc": can.ASCWriter,
    ".blf": can.BLFWriter,
    ".trc": can.TRCWriter,
    ".log": can.CanutilsLogWriter,
}


def write_trace(path, frames):
    with WRITERS[path.suffix](str(path)) as writer:
        for frame in frames:
            writer.on_message_received(frame)


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_trace_of_every_kind_is_read_as_it_was_written(tmp_path, suffix):
    path = tmp_path / f"t{suffix}"
    # the writer of TRC does not write what marks a remote frame
    written = [f for f in frames_of() if not (f.is_remote_frame and suffix == ".trc")]
    write_trace(path, written)
    read = list(can_trace.read_trace(path))
    assert [(f.arbitration_id, f.is_extended_id, f.is_remote_frame) for f in read] == [
        (f.arbitration_id, f.is_extended_id, f.is_remote_frame) for f in written
    ]
    assert [bytes(f.data) for f in read] == [bytes(f.data) for f in written]
    zero_s = read[0].timestamp
    stamps_s = [f.timestamp - zero_s for f in read]
    assert stamps_s == pytest.approx([f.timestamp - 1.0 for f in written], abs=1e-6)


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".log", ".trc"])
def test_bytes_that_are_no_trace_are_damage(tmp_path, suffix):
    path = tmp_path / f"t{suffix}"
    path.write_bytes(b"no trace at all, (1) x\n" * 9)
    with pytest.raises(can_trace.DamagedTrace, match=r"no \w+ trace after 0 frames|no frame in"):
        source.trace_source(path, None)


@pytest.mark.parametrize("suffix", WRITERS)
@given(share=st.floats(0, 1), noise=st.binary(max_size=20))
def test_a_damaged_trace_is_read_up_to_its_damage_or_named(tmp_path_factory, suffix, share, noise):
    path = tmp_path_factory.mktemp("damaged") / f"t{suffix}"
    write_trace(path, frames_of())
    data = path.read_bytes()
    cut = int(share * len(data))
    path.write_bytes(data[:cut] + noise + data[cut + len(noise) :])
    with contextlib.suppress(can_trace.DamagedTrace):
        assert len(list(can_trace.read_trace(path))) <= 20


def test_a_node_that_answers_no_more_is_a_fault():
    channel = new_channel()
    with can.Bus(interface="virtual", channel=channel) as bus:
        from rig.run.field_bus.exchange import ObjectClient

        client = ObjectClient(Exchange(bus, new_run_clock()), 5, 0.02)
        with pytest.raises(RunFailed, match=r"did not answer within 0.02 s to 6064:00"):
            objects.read_object(client, objects.parse_address("6064"), None)
