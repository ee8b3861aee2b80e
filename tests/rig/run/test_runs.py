"""The folder of a run: who may read it, and what a killed operator left behind."""

from __future__ import annotations

import json
import os
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from comms import bus_folder
from rig.run import operator_file
from rig.run.operator_file import OperatorFile
from rig.run.runs import new_folder

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)


@pytest.fixture(params=[0o000, 0o022, 0o027])
def usual_mask(request: pytest.FixtureRequest) -> Iterator[None]:
    """File mode masks that take nothing from the mode of a run folder."""
    before = os.umask(request.param)
    yield
    os.umask(before)


def mode(path: Path) -> int:
    """Permission bits of a file or folder."""
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.usefixtures("usual_mask")
def test_a_new_run_folder_is_not_for_all_users(tmp_path: Path) -> None:
    folder = new_folder(tmp_path / "runs", "move", "wall", NOON)
    assert mode(folder) == 0o750
    assert folder.name.startswith("20260101T120000Z_move_wall_")


@pytest.mark.usefixtures("usual_mask")
def test_a_run_in_virtual_time_leaves_a_folder_of_that_mode(tmp_path: Path) -> None:
    from rig.run import config, experiment

    chosen = config.read_experiment("move", ["experiment.quiet_s=0.6", "experiment.watch_s=2.5"])
    ran = experiment.run(chosen, "virtual", tmp_path, lambda *_: None, lambda *_: None)
    assert mode(ran.folder) == 0o750


# what an operator that was killed left behind


@pytest.fixture(scope="module")
def dead_pid() -> int:
    """Number of a process that has ended."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    return ended.pid


@pytest.fixture
def sockets() -> Iterator[Path]:
    """Folder of the sockets of a run, with two of them."""
    folder = bus_folder.make()
    for name in ("commands", "telemetry"):
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind(str(folder / name))
    yield folder
    for path in folder.iterdir() if folder.exists() else ():
        path.unlink()
    if folder.exists():
        folder.rmdir()


def left_by(runs: Path, pid: int, address: str, name: str = "run_1") -> Path:
    """File of an operator in the folder of its run."""
    folder = runs / name
    folder.mkdir()
    OperatorFile(address, pid, "00ff", {"controller": 5}).write(folder)
    return folder / operator_file.NAME


def test_file_and_sockets_of_a_dead_operator_are_removed(
    tmp_path: Path, sockets: Path, dead_pid: int
) -> None:
    path = left_by(tmp_path, dead_pid, bus_folder.address(sockets, "commands"))
    (path.parent / "run.mcap").touch()
    operator_file.remove_stale(tmp_path)
    assert not path.exists()
    assert not sockets.exists()
    assert [file.name for file in path.parent.iterdir()] == ["run.mcap"]


def test_the_file_of_a_dead_operator_on_ports_is_removed(tmp_path: Path, dead_pid: int) -> None:
    path = left_by(tmp_path, dead_pid, "tcp://127.0.0.1:40000")
    operator_file.remove_stale(tmp_path)
    assert not path.exists()


def test_file_and_sockets_of_a_living_operator_are_kept(tmp_path: Path, sockets: Path) -> None:
    path = left_by(tmp_path, os.getpid(), bus_folder.address(sockets, "commands"))
    before = path.read_bytes()
    operator_file.remove_stale(tmp_path)
    assert path.read_bytes() == before
    assert {file.name for file in sockets.iterdir()} == {"commands", "telemetry"}


UNREADABLE = {
    "no JSON": b"{",
    "a list": b"[]",
    "nothing": b"",
    "no process": json.dumps({"address": "ipc:///tmp/rig-x/commands"}).encode(),
    "a group of processes": json.dumps({"address": "tcp://127.0.0.1:1", "pid": -1}).encode(),
    "a deep list": b"[" * 100_000,
}


@pytest.mark.parametrize("data", UNREADABLE.values(), ids=UNREADABLE.keys())
def test_a_file_that_cannot_be_read_is_kept_and_hides_no_other(
    tmp_path: Path, dead_pid: int, data: bytes
) -> None:
    strange = left_by(tmp_path, dead_pid, "tcp://127.0.0.1:1", "run_1")
    strange.write_bytes(data)
    other = left_by(tmp_path, dead_pid, "tcp://127.0.0.1:1", "run_2")
    operator_file.remove_stale(tmp_path)
    assert strange.read_bytes() == data
    assert not other.exists()


def test_a_dead_operator_whose_sockets_are_gone_leaves_nothing(
    tmp_path: Path, dead_pid: int
) -> None:
    path = left_by(tmp_path, dead_pid, f"ipc://{tmp_path}/rig-gone/commands")
    operator_file.remove_stale(tmp_path)
    assert not path.exists()


@pytest.mark.parametrize("name", ["home", "rig", "my-rig-1"])
def test_a_folder_that_is_not_of_the_sockets_of_a_run_is_kept_whatever_the_file_says(
    tmp_path: Path, dead_pid: int, name: str
) -> None:
    precious = tmp_path / "elsewhere" / name
    precious.mkdir(parents=True)
    path = left_by(tmp_path, dead_pid, bus_folder.address(precious, "commands"))
    operator_file.remove_stale(tmp_path)
    assert not path.exists()
    assert precious.exists()


def test_files_that_are_no_sockets_are_kept_with_their_folder(
    tmp_path: Path, sockets: Path, dead_pid: int
) -> None:
    (sockets / "notes").touch()
    left_by(tmp_path, dead_pid, bus_folder.address(sockets, "commands"))
    operator_file.remove_stale(tmp_path)
    assert [file.name for file in sockets.iterdir()] == ["notes"]


def test_without_runs_there_is_nothing_to_remove(tmp_path: Path) -> None:
    operator_file.remove_stale(tmp_path / "runs")
    assert not (tmp_path / "runs").exists()
