"""`rig stop` with operators as its user meets them: running, gone, and described by a bad file."""

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import zmq

WAIT_MS = 10_000
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
    """Operator that answers from a table; `orders` are the requests it received."""

    def __init__(self, folder, answers):
        self.orders, self._answers = [], answers
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
                self._socket.send(self._answers[request].encode())

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


def write_bad(contents):
    bad = Path("runs/a_bad_one/operator.json")
    bad.parent.mkdir(parents=True)
    bad.write_bytes(contents)


@pytest.mark.parametrize("contents", BAD_FILES.values(), ids=BAD_FILES.keys())
def test_an_unreadable_file_is_named_and_keeps_no_other_run_from_being_stopped(
    rig, operator, contents
):
    write_bad(contents)
    running = operator("b", stop="stopping, was running")
    code, said, why = rig("stop")
    assert (code, running.orders) == (0, ["stop"])
    assert "b: stopping, was running" in said
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
