"""`rig stop` with operators as its user meets them: running, gone, and described by a bad file."""

import json
import os
import re
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import zmq

from comms.stop_port import StopPort
from rig.errors import Refused
from rig.run import operator_file
from rig.run.operator_file import OperatorFile
from rig.ui.cli import stop_order

KEY = bytes(range(16))
BAD_FILES = {
    "cut": b'{"address": "tcp://',
    "empty": b"",
    "a_list": b"[]",
    "no_address": b'{"pid": 1}',
    "an_address_of_numbers": b'{"address": 1, "pid": 1}',
    "a_pid_of_letters": b'{"address": "tcp://127.0.0.1:9", "pid": "x"}',
    "a_pid_of_all_processes": b'{"address": "tcp://127.0.0.1:9", "pid": -1}',
    "no_text": b"\xff\xfe",
    "nested": b"[" * 100_000,
}


class FakeOperator:
    """Operator that answers from a table, the last answer for good.

    orders: the requests that it received.
    """

    def __init__(self, folder, answers):
        self.orders, self._answers = [], answers
        self.on_status = dict
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.REP)
        port = self._socket.bind_to_random_port("tcp://127.0.0.1")
        write_file(folder, f"tcp://127.0.0.1:{port}", os.getpid())
        self._is_open = True
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self):
        while self._is_open:
            if self._socket.poll(20):
                request = self._socket.recv().decode()
                self.orders.append(request)
                if request == "status":
                    self.on_status(missing_ok=True)
                answers = self._answers[request]
                self._socket.send((answers.pop(0) if len(answers) > 1 else answers[0]).encode())

    def close(self):
        self._is_open = False
        self._thread.join()
        self._context.destroy(0)


def write_file(folder, address, pid, **more):
    folder.mkdir(parents=True)
    (folder / "operator.json").write_text(json.dumps({"address": address, "pid": pid} | more))


def pid_of_the_past():
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    return child.pid


@pytest.fixture
def operator():
    """Start operators; they end with the test."""
    started = []

    def start(name, **answers):
        started.append(FakeOperator(Path("runs") / name, answers))
        return started[-1]

    yield start
    for one in started:
        one.close()


def status(phase="running", speed_m_s=0.3, at_rest=False):
    """Status as the operator answers it."""
    fields = {"stage": "stopping", "phase": phase, "speed_m_s": speed_m_s, "at_rest": at_rest}
    return json.dumps(fields)


MOVING, SLOWER = status(), status("stopped", 0.1)
STANDING = status("stopped", 0.0, at_rest=True)
ORDERED = ["ordered, was running"]


def write_bad(contents):
    bad = Path("runs/a_bad_one/operator.json")
    bad.parent.mkdir(parents=True)
    bad.write_bytes(contents)


@pytest.mark.parametrize("contents", BAD_FILES.values(), ids=BAD_FILES.keys())
def test_an_unreadable_file_is_named_and_keeps_no_other_run_from_being_stopped(
    rig, operator, contents
):
    write_bad(contents)
    running = operator("b", stop=ORDERED, status=[STANDING])
    code, said, why = rig("stop")
    assert (code, running.orders[0]) == (0, "stop")
    assert "b: ordered, was running" in said
    assert "runs/a_bad_one/operator.json cannot be read" in why
    assert "emergency stop" in why


def test_with_an_unreadable_file_alone_nothing_is_running_and_the_file_is_named(rig):
    write_bad(BAD_FILES["cut"])
    code, _, why = rig("stop")
    assert code == 2
    assert "a_bad_one" in why
    assert "nothing is running" in why


def test_the_file_of_an_operator_that_has_exited_is_removed(rig):
    write_file(Path("runs/old"), "tcp://127.0.0.1:9", pid_of_the_past())
    code, said, why = rig("stop")
    assert (code, Path("runs/old/operator.json").exists()) == (2, False)
    assert "old: its operator" in said
    assert "nothing is running" in why


def lines_of(said):
    return [re.sub(r"after \d+ ms", "after n ms", line) for line in said.splitlines()]


def test_a_stop_is_ordered_first_and_stopped_when_the_robot_stands(rig, operator):
    running = operator("a", stop=ORDERED, status=[MOVING, SLOWER, STANDING])
    code, said, why = rig("stop")
    assert (code, why) == (0, "")
    assert lines_of(said) == ["a: ordered, was running", "a: stopped after n ms"]
    assert running.orders[:4] == ["stop", "status", "status", "status"]


def test_an_emergency_stop_orders_an_emergency_stop(rig, operator):
    running = operator("a", estop=ORDERED, status=[STANDING])
    assert rig("stop", "--emergency")[0] == 0
    assert running.orders[0] == "estop"


def test_a_robot_that_does_not_come_to_rest_in_time_ends_in_exit_5_with_phase_and_speed(
    rig, operator, monkeypatch
):
    monkeypatch.setattr(stop_order, "TIMEOUT_S", 0.2)
    operator("a", stop=ORDERED, status=[MOVING])
    code, said, _ = rig("stop")
    assert code == 5
    assert lines_of(said)[1] == (
        "a: not at rest within 200 ms (phase running, speed 0.3 m/s): press the emergency stop"
    )


def test_every_run_is_ordered_to_stop_before_any_is_waited_for(rig, operator, monkeypatch):
    monkeypatch.setattr(stop_order, "TIMEOUT_S", 0.2)
    operator("a", stop=ORDERED, status=[MOVING])
    operator("b", stop=ORDERED, status=[STANDING])
    code, said, _ = rig("stop")
    assert code == 5
    assert "b: stopped after" in said
    assert lines_of(said)[-1].startswith("a: not at rest")


def test_an_operator_that_does_not_answer_ends_in_exit_5(rig, monkeypatch):
    monkeypatch.setattr(stop_order, "TIMEOUT_S", 0.1)
    write_file(Path("runs/a"), "tcp://127.0.0.1:9", os.getpid())
    code, said, _ = rig("stop")
    assert code == 5
    assert lines_of(said) == [
        "a: no answer of the operator within 100 ms, so nothing shows that the robot stands: "
        "press the emergency stop"
    ]


def test_an_address_that_is_none_is_named_and_keeps_no_other_run_from_being_stopped(rig, operator):
    write_file(Path("runs/a"), "nowhere", os.getpid())
    operator("b", stop=ORDERED, status=[STANDING])
    code, said, _ = rig("stop")
    assert code == 5
    assert "a: address = 'nowhere'" in said
    assert "b: stopped after" in said


@pytest.mark.parametrize(("stage", "code"), [("connecting", 0), ("running", 5)])
def test_a_run_that_ends_unseen_is_stopped_only_if_nothing_had_moved(rig, operator, stage, code):
    run = operator("a", stop=[f"ordered, was {stage}"], status=[MOVING])
    run.on_status = (Path("runs/a/operator.json")).unlink
    ended, said, _ = rig("stop")
    assert ended == code
    assert "a: ordered" in said
    assert "the run ended after" in said


@pytest.fixture
def stop_ports():
    """Stop ports of a controller and a streamer."""
    ports = {name: StopPort(0, KEY) for name in ("controller", "streamer")}
    yield ports
    for port in ports.values():
        port.close()


def numbers_of(ports):
    return {name: port.port for name, port in ports.items()}


@pytest.mark.parametrize("words", [("stop",), ("stop", "--emergency")])
def test_past_an_operator_that_does_not_answer_the_tasks_themselves_are_ordered_to_stop(
    rig, monkeypatch, stop_ports, words
):
    monkeypatch.setattr(stop_order, "ANSWER_S", 0.0)
    monkeypatch.setattr(stop_order, "TIMEOUT_S", 0.1)
    fields = {"stop_key": KEY.hex(), "stop_ports": numbers_of(stop_ports)}
    write_file(Path("runs/a"), "tcp://127.0.0.1:9", os.getpid(), **fields)
    code, said, _ = rig(*words)
    request = "stop" if len(words) == 1 else "estop"
    assert code == 5
    assert "a: the operator does not answer; ordered at controller and streamer" in said
    assert "nothing shows that the robot stands" in said
    for port in stop_ports.values():
        assert set(port.drain()) == {request}
        assert port.ignored == 0


def test_an_operator_that_answers_is_not_passed_over(rig, operator, stop_ports):
    run = operator("a", stop=ORDERED, status=[STANDING])
    path = Path("runs/a/operator.json")
    fields = {"stop_key": KEY.hex(), "stop_ports": numbers_of(stop_ports)}
    path.write_text(json.dumps(json.loads(path.read_text()) | fields))
    assert rig("stop")[0] == 0
    assert run.orders[0] == "stop"
    assert [port.drain() for port in stop_ports.values()] == [[], []]


def test_the_tasks_of_an_operator_that_has_exited_are_ordered_to_stop_too(rig, stop_ports):
    fields = {"stop_key": KEY.hex(), "stop_ports": numbers_of(stop_ports)}
    write_file(Path("runs/a"), "tcp://127.0.0.1:9", pid_of_the_past(), **fields)
    assert rig("stop")[0] == 2
    assert [port.drain() for port in stop_ports.values()] == [["stop"], ["stop"]]


@pytest.mark.parametrize(
    "fields",
    [
        {"stop_key": "no hexadecimal", "stop_ports": {"controller": 4000}},
        {"stop_key": KEY.hex(), "stop_ports": {"controller": 70_000, "streamer": "x"}},
        {"stop_key": KEY.hex(), "stop_ports": [4000]},
    ],
)
def test_key_or_ports_that_cannot_be_used_keep_no_operator_from_being_asked(rig, operator, fields):
    operator("a", stop=ORDERED, status=[STANDING])
    path = Path("runs/a/operator.json")
    path.write_text(json.dumps(json.loads(path.read_text()) | fields))
    code, said, _ = rig("stop")
    assert (code, "a: stopped after" in said) == (0, True)


def test_the_file_with_the_key_is_for_its_user_alone_and_reads_back(tmp_path):
    written = OperatorFile("tcp://127.0.0.1:9", 7, KEY.hex(), {"controller": 4000})
    written.write(tmp_path)
    path = tmp_path / operator_file.NAME
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert operator_file.read(path) == written
    assert [file.name for file in tmp_path.iterdir()] == [operator_file.NAME]


def test_a_file_system_that_lets_others_read_the_key_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(operator_file.stat, "S_IMODE", lambda mode: 0o644)
    with pytest.raises(Refused, match=r"has mode 644 there; must be 600.*--runs"):
        OperatorFile("tcp://127.0.0.1:9", 7, KEY.hex(), {}).write(tmp_path)
    assert list(tmp_path.iterdir()) == []
