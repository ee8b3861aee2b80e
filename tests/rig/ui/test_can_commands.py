"""`rig can` and the field bus in `rig export` and `rig doctor`, with a real node on a bus."""

import _thread
import json
import os
import re
import threading

import can
import cantools
import pytest

from comms.mcap_log import read_log
from comms.messages import CanMessage
from rig.run import config, experiment, operator_file
from rig.run.operator_file import OperatorFile
from rig.run.runs import LOG
from tests.rig.run.can_node import ServedNodes, new_channel

NODE_ID = 5
TIMEOUT = ("--timeout", "0.2")
RUN = ["bench.robot.kind=ball_screw", "experiment.quiet_s=0.3", "experiment.watch_s=0.3"]
UNICAST = "swayless_udp"


def named(channel, interface="virtual"):
    """Options that name a bus."""
    return ("--interface", interface, "--channel", channel)


@pytest.fixture
def bus():
    """Options of a bus with a real node."""
    channel = new_channel()
    with ServedNodes(channel, NODE_ID):
        yield named(channel)


@pytest.fixture(scope="module")
def drive_run(tmp_path_factory):
    """Folder of a run with a drive, in virtual time."""
    runs = tmp_path_factory.mktemp("can") / "runs"
    chosen = config.read_experiment("move", RUN)
    return experiment.run(chosen, "virtual", runs, lambda *_: None, lambda *_: None).folder


@pytest.fixture(scope="module")
def logged(drive_run):
    """Frames of the run as its log has them, in time order."""
    log = read_log(drive_run / LOG)
    frames = [m for topic in ("/can_down", "/can_up") for m in log.read(topic, CanMessage)]
    return sorted(frames, key=lambda frame: frame.t_ns)


def write_operator(runs, channel):
    """A run that goes on on a bus by unicast, without a log yet."""
    folder = runs / "20260101T000000Z_move_wall_abcd"
    folder.mkdir(parents=True)
    settings = {"interface": UNICAST, "channel": channel}
    OperatorFile("tcp://127.0.0.1:1", os.getpid(), can=settings).write(folder)
    return folder.name


@pytest.fixture
def running(tmp_path):
    """Name of a run that goes on in `runs`, with a real node on its bus by unicast."""
    from comms.can_bus import CanSettings, chosen

    channel = f"127.0.0.1:{chosen(CanSettings(interface=UNICAST)).port}"
    name = write_operator(tmp_path / "runs", channel)
    with ServedNodes(channel, NODE_ID, interface=UNICAST):
        yield name


# scan


def test_a_scan_lists_the_nodes_with_their_identity(rig):
    channel = new_channel()
    with ServedNodes(channel, 5, 127) as served:
        code, said, _ = rig("can", "scan", *named(channel), *TIMEOUT, "--json")
    assert code == 0
    first, second = json.loads(said)["nodes"]
    assert (first["node_id"], second["node_id"]) == (5, 127)
    assert first["nmt_state"] == "pre_operational"
    assert first["name"] == "Swayless servo drive"
    dictionary = served.nodes[0].dictionary
    assert first["device_type"] == dictionary.get(0x1000)
    identity = [first[key] for key in ("vendor", "product", "revision", "serial")]
    assert identity == [dictionary.get(0x1018, sub) for sub in (1, 2, 3, 4)]
    assert not first["is_duplicated"]


def test_a_scan_asks_every_node_once_and_a_millisecond_apart(rig):
    channel = new_channel()
    with (
        can.Bus(interface="virtual", channel=channel) as listener,
        ServedNodes(channel, NODE_ID),
    ):
        rig("can", "scan", *named(channel), *TIMEOUT)
        heard = iter(lambda: listener.recv(0), None)
        requests = [m for m in heard if 0x600 < m.arbitration_id <= 0x67F]
    first = [m.arbitration_id for m in requests[:127]]
    assert first == [0x600 + node_id for node_id in range(1, 128)]
    assert {m.arbitration_id for m in requests[127:]} == {0x600 + NODE_ID}
    assert requests[126].timestamp - requests[0].timestamp >= 0.125


def test_two_nodes_with_one_node_id_are_named(rig):
    channel = new_channel()
    with ServedNodes(channel, 5, 9, 9):
        code, said, _ = rig("can", "scan", *named(channel), *TIMEOUT)
    assert code == 0
    assert "node 9: more answers than requests; two nodes have this node-ID" in said
    assert "node 5: more" not in said


def test_a_stopped_node_is_listed_by_its_heartbeat(rig):
    channel = new_channel()
    with (
        ServedNodes(channel, NODE_ID, heartbeat_ms=20),
        can.Bus(interface="virtual", channel=channel) as master,
    ):
        master.send(can.Message(data=[0x02, NODE_ID], is_extended_id=False))
        code, said, _ = rig("can", "scan", *named(channel), *TIMEOUT)
    assert code == 0
    assert re.search(rf"^{NODE_ID} +stopped +- ", said, re.MULTILINE)
    assert "heartbeat alone, no answer by SDO" in said


def test_a_node_without_a_heartbeat_is_listed(rig):
    channel = new_channel()
    with ServedNodes(channel, NODE_ID, heartbeat_ms=0) as served:
        served_once = rig("can", "sdo", NODE_ID, "1000", *named(channel))
        code, said, _ = rig("can", "scan", *named(channel), *TIMEOUT)
    assert served_once[0] == code == 0
    assert re.search(rf"^{NODE_ID} +no heartbeat +Swayless", said, re.MULTILINE)
    assert len(served.nodes) == 1


def test_a_bus_without_nodes_is_a_fault_with_what_to_look_for(rig):
    channel = new_channel()
    code, _, err = rig("can", "scan", *named(channel), *TIMEOUT)
    assert code == 5
    assert f"no node answered within 0.2 s on virtual {channel}: look for power" in err


@pytest.mark.parametrize("verb", [("scan",), ("monitor",), ("sdo", "5", "1000")])
@pytest.mark.parametrize(
    ("options", "text"),
    [
        ((), "nothing with a drive is running under runs"),
        (("--interface", "socketcn"), "did you mean 'socketcan'"),
        (("--interface", "neovi"), "look for the device and its driver"),
        (("--interface", "kvaser", "--channel", "x"), "look for the device and its driver"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_refused(rig, verb, options, text):
    code, _, err = rig("can", *verb, *options)
    assert code == 3
    assert text in err


def test_a_scan_fits_eighty_columns(rig, bus, monkeypatch):
    from rig.ui.cli import page

    monkeypatch.setattr(page.out, "_width", 80)
    _, said, _ = rig("can", "scan", *bus, *TIMEOUT)
    assert max(map(len, said.splitlines())) <= 80


def test_a_scan_of_the_bus_of_a_run_sends_nothing(rig, running):
    code, said, err = rig("can", "scan", *TIMEOUT)
    assert code == 0
    assert f"run {running} goes on on this bus: heartbeats alone" in err
    assert re.search(rf"^{NODE_ID} +pre_operational +- ", said, re.MULTILINE)
    code, said, _ = rig("can", "scan", *TIMEOUT, "--force")
    assert code == 0
    assert "Swayless servo drive" in said


# sdo


def test_an_integer_a_negative_one_and_a_text_are_read(rig, bus):
    assert rig("can", "sdo", NODE_ID, "1018:2", *bus)[1] == (
        "1018:02 Product code = 1026 (0x00000402)\n"
    )
    assert "= Swayless servo drive" in rig("can", "sdo", NODE_ID, "1008", *bus)[1]


def test_what_is_written_is_read_again(rig, bus):
    code, said, _ = rig("can", "sdo", NODE_ID, "607D:1", "-500", *bus)
    assert (code, said) == (0, "607D:01 Min position limit := -500 (0xFFFFFE0C)\n")
    code, said, _ = rig("can", "sdo", NODE_ID, "607D:1", *bus, "--json")
    document = json.loads(said)
    assert document["value"] == -500
    assert document["type"] == "i32"
    assert document["data"] == "0cfeffff"


def test_a_named_type_is_taken_before_that_of_the_eds_file(rig, bus):
    rig("can", "sdo", NODE_ID, "607D:1", "-1", *bus)
    _, said, _ = rig("can", "sdo", NODE_ID, "607D:1", "--type", "u32", *bus, "--json")
    assert json.loads(said)["value"] == 2**32 - 1
    _, said, _ = rig("can", "sdo", NODE_ID, "607D:1", "--type", "u8", *bus, "--json")
    assert json.loads(said)["value"] == "ff ff ff ff"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("6041", "5"), "attempt to write a read only object (abort code 0x06010002): give no"),
        (("5000",), "object does not exist (abort code 0x06020000): look for the index in the EDS"),
        (("1018:9",), "subindex does not exist (abort code 0x06090011): read subindex 0"),
        (("6065", "7", "--type", "u8"), "(abort code 0x060700"),
        (("60C2:1", "0"), "too low (abort code 0x06090032): give a higher value"),
    ],
)
def test_an_abort_is_a_text_with_the_next_step(rig, bus, words, text):
    code, _, err = rig("can", "sdo", NODE_ID, *words, *bus)
    assert code == 3
    assert f"node {NODE_ID} refuses {words[0].partition(':')[0]}:" in err
    assert text in err


def test_a_node_that_is_not_there_is_named(rig, bus):
    code, _, err = rig("can", "sdo", 7, "1000", *bus, "--timeout", "0.05")
    assert code == 5
    assert "node 7 did not answer within 0.05 s to 1000:00: look for its power" in err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("60641",), "must be INDEX or INDEX:SUB"),
        (("6064", "--type", "int"), "must be one of u8, u16"),
        (("2001", "5"), "name it, e.g. --type u16"),
        (("607D:1", "1e3"), "must be an integer"),
        (("6040", "70000"), "must be 0 to 65535"),
        (("6040", "--forse"), "--forse: no such option"),
    ],
)
def test_words_that_make_no_request_are_a_usage_error(rig, bus, words, text):
    code, _, err = rig("can", "sdo", NODE_ID, *words, *bus)
    assert code == 2
    assert text in err


def test_a_write_to_the_bus_of_a_run_is_refused_with_its_name(rig, running):
    code, _, err = rig("can", "sdo", NODE_ID, "607D:1", "-500")
    assert code == 3
    assert f"run {running} goes on on this bus; nothing was written" in err
    code, said, err = rig("can", "sdo", NODE_ID, "607D:1")
    assert (code, said) == (0, "607D:01 Min position limit = -2147483648 (0x80000000)\n")
    assert "its ledger shows the request" in err
    assert rig("can", "sdo", NODE_ID, "607D:1", "-500", "--force")[0] == 0
    assert "= -500 " in rig("can", "sdo", NODE_ID, "607D:1")[1]


# monitor


def test_the_frames_of_a_run_have_their_signals(rig, drive_run, logged):
    code, said, _ = rig("can", "monitor", "--from", drive_run, "--json")
    *lines, last = [json.loads(line) for line in said.splitlines()]
    assert code == 0
    assert len(lines) == len(logged)
    for line, frame in zip(lines, logged, strict=True):
        assert line["t_s"] == pytest.approx(frame.t_ns * 1e-9, abs=1e-9)
    motion = [line for line in lines if line["name"] == "tpdo1"]
    assert motion[-1]["signals"]["position"] == pytest.approx(0.2, abs=1e-3)
    summary = last["summary"]
    assert summary["frames"] == len(logged)
    assert summary["bitrate"] == 1_000_000
    assert 0.01 < summary["load_nominal"] < summary["load_worst"] < 0.3
    sync = next(row for row in summary["by_id"] if row["can_id"] == 0x080)
    assert sync["period_ms"] == pytest.approx(5.0)


def test_the_text_of_a_run_fits_eighty_columns(rig, drive_run, monkeypatch):
    from rig.ui.cli import page

    monkeypatch.setattr(page.out, "_width", 80)
    code, said, _ = rig("can", "monitor", "--from", "last", "--runs", drive_run.parent)
    assert code == 0
    # the path of a temporary folder is one word
    lines = [line for line in said.splitlines() if str(drive_run) not in line]
    assert max(map(len, lines)) <= 80
    assert re.search(r"^ {12}position 0\.2\d* m, velocity ", said, re.MULTILINE)
    assert re.search(r"^080  sync +\d+  200\.0   5\.000   0\.000 ", said, re.MULTILINE)
    assert "without stuff bits" in said


@pytest.mark.parametrize("suffix", ["asc", "blf"])
def test_an_exported_trace_is_read_by_others_and_by_the_monitor(
    rig, drive_run, logged, tmp_path, suffix
):
    code, said, _ = rig("export", drive_run, f"--{suffix}", f"t.{suffix}", "--dbc", "t.dbc")
    assert code == 0
    assert f"{len(logged)} frames written to t.{suffix}" in said
    with can.LogReader(tmp_path / f"t.{suffix}") as reader:
        read = list(reader)
    assert [f.arbitration_id for f in read] == [f.can_id for f in logged]
    assert [bytes(f.data) for f in read] == [f.data for f in logged]
    stamps_s = [f.timestamp - read[0].timestamp for f in read]
    expected_s = [(f.t_ns - logged[0].t_ns) * 1e-9 for f in logged]
    assert stamps_s == pytest.approx(expected_s, abs=2e-6)
    names = cantools.database.load_file(tmp_path / "t.dbc", strict=True)
    assert {f.arbitration_id for f in read} <= {message.frame_id for message in names.messages}
    shown = rig("can", "monitor", "--from", f"t.{suffix}", "--dbc", "t.dbc", "--json")[1]
    last = json.loads(shown.splitlines()[-1])["summary"]
    assert last["frames"] == len(logged)
    assert "tpdo1" in shown


def test_a_blf_has_the_time_and_the_direction_of_the_run(rig, drive_run, tmp_path):
    rig("export", drive_run, "--blf", "t.blf")
    log = read_log(drive_run / LOG)
    epoch_s = int(log.metadata["run.start"]["epoch_ns"]) * 1e-9
    with can.BLFReader(tmp_path / "t.blf") as reader:
        read = list(reader)
    assert read[0].timestamp == pytest.approx(epoch_s, abs=0.01)
    assert {f.is_rx for f in read if f.arbitration_id == 0x181} == {True}
    assert {f.is_rx for f in read if f.arbitration_id == 0x080} == {False}


def test_seconds_and_count_bound_the_frames_of_a_log(rig, drive_run):
    for bound in (("--count", "7"), ("--seconds", "0.1")):
        said = rig("can", "monitor", "--from", drive_run, "--json", *bound)[1]
        *lines, _ = [json.loads(line) for line in said.splitlines()]
        if bound[0] == "--count":
            assert len(lines) == 7
        else:
            assert 0.09 < lines[-1]["t_s"] - lines[0]["t_s"] <= 0.1


def test_a_cut_log_shows_what_is_left(rig, drive_run, tmp_path):
    data = (drive_run / LOG).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    code, said, _ = rig("can", "monitor", "--from", "cut.mcap")
    assert code == 6
    assert "sync" in said
    assert "the log is incomplete: cut short" in said


def test_a_bus_is_shown_for_a_number_of_frames_and_for_a_time(rig, bus):
    code, said, _ = rig("can", "monitor", *bus, "--count", 3)
    assert code == 0
    assert len(re.findall(rf"^ +[0-9.]+ +{0x700 + NODE_ID:X} 1 (?:00|7F)", said, re.MULTILINE)) == 3
    assert "3 frames in" in said
    code, said, _ = rig("can", "monitor", *bus, "--seconds", 0.1)
    assert code == 0
    assert "0 error frames" in said


def test_a_silent_bus_says_what_to_look_for(rig):
    code, said, _ = rig("can", "monitor", *named(new_channel()), "--seconds", 0.05)
    assert code == 0
    assert "look for power, termination and bit rate" in said


def test_ctrl_c_ends_with_the_summary(rig, bus):
    timer = threading.Timer(0.2, _thread.interrupt_main)
    timer.start()
    try:
        code, said, _ = rig("can", "monitor", *bus, "--seconds", 20)
    finally:
        timer.cancel()
        timer.join()
    assert code == 0
    assert f"{0x700 + NODE_ID:X}  heartbeat {NODE_ID}" in said
    assert "bus load at 1000000 bit/s" in said


def test_the_monitor_attaches_to_the_running_experiment(rig, running):
    code, said, _ = rig("can", "monitor", "--count", 2)
    assert code == 0
    assert f"heartbeat {NODE_ID}" in said
    assert "swayless_udp 127.0.0.1:" in said


def test_an_error_frame_is_shown_and_counted(rig, tmp_path):
    with can.BLFWriter(tmp_path / "t.blf") as writer:
        writer(can.Message(timestamp=1.0, arbitration_id=1, is_extended_id=False, channel=0))
        writer(can.Message(timestamp=1.1, is_error_frame=True, channel=0))
    code, said, _ = rig("can", "monitor", "--from", "t.blf")
    assert code == 0
    assert "2 frames in 0.100 s, of these 1 error frames" in said


@pytest.mark.parametrize(
    ("name", "code", "text"),
    [
        ("t.foo", 2, "must be ASC (.asc), BLF (.blf), PCAN (.trc), candump (.log)"),
        ("t.asc", 2, "no such file; must be a trace"),
        ("empty.log", 6, "no frame in this file"),
        ("bad.blf", 6, "no BLF trace after 0 frames"),
        ("nowhere", 2, "no such run"),
    ],
)
def test_a_trace_that_cannot_be_read_is_named(rig, tmp_path, name, code, text):
    (tmp_path / "empty.log").write_text("")
    (tmp_path / "bad.blf").write_bytes(b"LOGG" + bytes(300))
    got, _, err = rig("can", "monitor", "--from", name)
    assert got == code
    assert text in err


@pytest.mark.parametrize(
    ("dbc", "text"),
    [("no.dbc", "no such file"), ("bad.dbc", "must be a DBC file"), ("run", "not those of a run")],
)
def test_names_that_cannot_be_read_are_named(rig, tmp_path, bus, dbc, text):
    (tmp_path / "bad.dbc").write_text("BO_ 1 x\n")
    code, _, err = rig("can", "monitor", *bus, "--dbc", dbc)
    assert code == 2
    assert f"--dbc {dbc}: " in err
    assert text in err


def test_a_trace_cannot_steer_the_terminal(rig, tmp_path):
    names = cantools.database.can.Database(
        messages=[
            cantools.database.can.Message(
                1, "m", 1, [cantools.database.can.Signal("s", 0, 8, unit="\x1b[31mX")]
            )
        ]
    )
    (tmp_path / "t.dbc").write_text(names.as_dbc_string())
    with can.CanutilsLogWriter(tmp_path / "t.log") as writer:
        writer(can.Message(timestamp=1.0, arbitration_id=1, data=b"\7", is_extended_id=False))
    code, said, _ = rig("can", "monitor", "--from", "t.log", "--dbc", "t.dbc")
    assert code == 0
    assert "m: s 7" in said
    assert "\x1b" not in said


# export and doctor


def test_a_run_without_a_field_bus_has_no_trace(rig):
    log = "/".join([os.path.dirname(__file__), "../../data/logs/e295f92_move_virtual.mcap"])
    for option in ("--asc", "--blf", "--dbc"):
        code, _, err = rig("export", log, option, f"t.{option[2:]}")
        assert code == 2
        assert "without traffic on a field bus" in err
    code, _, err = rig("can", "monitor", "--from", log)
    assert code == 2
    assert "without traffic on a field bus" in err


def test_a_trace_has_the_suffix_of_its_kind(rig, drive_run):
    code, _, err = rig("export", drive_run, "--asc", "t.blf")
    assert code == 2
    assert "--asc t.blf; must end in .asc" in err


def test_an_export_of_nothing_is_a_usage_error(rig, drive_run):
    code, _, err = rig("export", drive_run)
    assert code == 2
    assert "must be at least one" in err


def test_the_doctor_checks_interface_and_node_of_an_experiment(rig, tmp_path, monkeypatch):
    from functools import partial

    from rig.run import doctor, machine

    timely = machine.grade_of(None, machine.lateness_of([0]))
    examine = partial(doctor.examine, measure=lambda: timely)
    monkeypatch.setattr("rig.ui.cli.doctor.examine", examine)
    channel = new_channel()
    (tmp_path / "rig.toml").write_text(
        '[experiment]\nname = "x"\nkind = "move"\n[bench]\nkind = "external"\n'
        f'[bench.robot]\nkind = "ball_screw"\n[can]\ninterface = "virtual"\nchannel = "{channel}"\n'
        f"[drive]\nnode_id = {NODE_ID}\n"
    )
    code, said, _ = rig("doctor", "--experiment", "rig.toml", "--json")
    checks = {check["name"]: check for check in json.loads(said)["checks"]}
    assert code == 3
    assert checks["CAN interface"]["status"] == "ok"
    assert checks[f"node {NODE_ID}"]["status"] == "failed"
    with ServedNodes(channel, NODE_ID):
        said = rig("doctor", "--experiment", "rig.toml", "--json")[1]
    checks = {check["name"]: check for check in json.loads(said)["checks"]}
    assert checks[f"node {NODE_ID}"]["status"] == "ok"
    said = rig("doctor", "--json")[1]
    assert "CAN interface" not in said


def test_a_run_that_has_ended_is_no_bus(rig, tmp_path):
    name = write_operator(tmp_path / "runs", "127.0.0.1:1")
    path = tmp_path / "runs" / name / operator_file.NAME
    path.write_text(path.read_text().replace(f'"pid": {os.getpid()}', '"pid": 4194305'))
    code, _, err = rig("can", "monitor")
    assert code == 3
    assert "nothing with a drive is running" in err
