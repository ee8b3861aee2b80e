"""`rig analyze` of a run that still goes on: not damaged, not judged."""

import json
import os
import shutil
import subprocess

import msgspec
import pytest

from rig.run.operator_file import NAME as ADDRESS_FILE
from rig.run.runs import LOG

BRIEF = ["experiment.quiet_s=0.6", "experiment.watch_s=2.5"]


@pytest.fixture(scope="module")
def log_of_a_run(tmp_path_factory):
    """Bytes of the log of a short run in virtual time."""
    from rig.run import config, experiment

    chosen = config.read_experiment("move", BRIEF)
    runs = tmp_path_factory.mktemp("runs")
    ran = experiment.run(chosen, "virtual", runs, lambda *_: None, lambda *_: None)
    return (ran.folder / LOG).read_bytes()


@pytest.fixture
def going_on(tmp_path, log_of_a_run, monkeypatch):
    """Folder of a run whose log is written up to a share; its operator is this process."""

    def begin(share, pid=None):
        folder = tmp_path / "runs" / "20260101T000000Z_move_wall_abcd"
        folder.mkdir(parents=True)
        (folder / LOG).write_bytes(log_of_a_run[: int(len(log_of_a_run) * share)])
        address = folder / ADDRESS_FILE
        address.write_text(json.dumps({"address": "tcp://127.0.0.1:1", "pid": pid or os.getpid()}))
        written_s = address.stat().st_mtime
        monkeypatch.setattr("rig.ui.cli.analyze.utc_now", lambda: _Instant(written_s + 12.0))
        return folder

    yield begin
    shutil.rmtree(tmp_path / "runs", ignore_errors=True)


class _Instant:
    def __init__(self, stamp_s):
        self._stamp_s = stamp_s

    def timestamp(self):
        return self._stamp_s


def test_a_run_that_goes_on_is_said_to_and_not_called_damaged(rig, going_on):
    going_on(0.6)
    code, said, _ = rig("analyze", "last")
    assert code == 6
    assert "verdict: none yet: still running, 12 s so far" in said
    assert "incomplete" not in said
    assert "cut short" not in said


def test_the_document_of_a_run_that_goes_on_says_so(rig, going_on):
    going_on(0.6)
    code, said, _ = rig("analyze", "last", "--json")
    document = msgspec.json.decode(said)
    assert (code, document["exit_code"], document["running_s"]) == (6, 6, 12.0)
    assert document["reasons"] == [
        "still running, 12 s so far: analysed as far as it is logged",
    ]


def test_a_run_of_which_little_is_logged_is_said_to_go_on(rig, going_on):
    going_on(0.0)
    code, _, why = rig("analyze", "last")
    assert code == 6
    assert "still running, 12 s so far; too little is logged yet" in why


def test_the_log_of_an_operator_that_died_is_incomplete(rig, going_on):
    ended = subprocess.Popen(["true"])
    ended.wait()
    going_on(0.6, pid=ended.pid)
    code, said, _ = rig("analyze", "last")
    assert code == 6
    assert "the log is incomplete" in said
    assert "still running" not in said
