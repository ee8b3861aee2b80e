"""The same tasks as processes over real sockets. No duration is asserted."""

import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from comms import bus_folder
from comms.endpoints import DATAGRAMS, PORTS, TCP_PORTS
from comms.errors import LogError, PortInUse
from comms.mcap_log import read_log
from comms.udp import port_is_free
from rig.analysis.analyze import RunAnalysis
from rig.errors import Refused
from rig.run import config, experiment, operator_file
from rig.run.runs import LOG
from rig.run.runtime import execute
from rig.run.runtime.interrupts import Interrupts

UDP, TCP = socket.SOCK_DGRAM, socket.SOCK_STREAM
pytestmark = pytest.mark.xdist_group("wall")  # one rig at a time: five processes each
PATIENT = [
    "safety.robot_stale_ms=5000",
    "safety.reference_stale_ms=5000",
    "safety.operator_silent_ms=5000",
]  # a busy machine is no fault of the rig's
BRIEF = [
    "experiment.quiet_s=0.3",
    "experiment.watch_s=2.5",
    "move.time_s=1.5",
    "safety.angle_stale_ms=5000",
    *PATIENT,
]


def quietly(*_):
    return None


def test_the_loop_over_sockets_ends_well_and_every_link_balances(tmp_path):
    ran = experiment.run(config.read_experiment("move", BRIEF), "wall", tmp_path, quietly, quietly)
    summary = RunAnalysis(ran.folder / LOG).summary
    assert (ran.outcome.exit_code, ran.outcome.reasons) == (0, [])
    assert {name: row.unexplained for name, row in summary.links.items()} == dict.fromkeys(
        summary.links, 0
    )
    assert min(row.delivered for row in summary.links.values()) > 100
    assert summary.measured.cable_length_m == pytest.approx(0.98, abs=0.01)
    assert not (ran.folder / "operator.json").exists()


def test_two_cameras_have_a_process_each_and_all_their_links_balance(tmp_path):
    chosen = config.read_experiment("two_cameras", BRIEF)
    ran = experiment.run(chosen, "wall", tmp_path, quietly, quietly)
    analysis = RunAnalysis(ran.folder / LOG)
    assert (ran.outcome.exit_code, ran.outcome.reasons) == (0, [])
    assert {"vision", "vision_2"} <= analysis.summary.cpu_share.keys()
    links = analysis.summary.links
    assert {"platform_2", "frame_2", "angle_2"} <= links.keys()
    assert "frame_3" not in links
    assert {row.unexplained for row in links.values()} == {0}
    assert min(row.delivered for row in links.values()) > 100
    assert analysis.run.log.topics["/camera_2/image"]


def test_wall_and_virtual_lose_the_very_same_references(tmp_path):
    changes = [*BRIEF, "links.reference.loss=0.1"]
    lost = []
    for mode in ("wall", "virtual"):
        ran = experiment.run(
            config.read_experiment("move", changes), mode, tmp_path, quietly, quietly
        )
        assert (ran.outcome.exit_code, ran.outcome.reasons) == (0, [])
        run = RunAnalysis(ran.folder / LOG).run
        arrived = run.receipts("reference")
        lost.append({r.seq for r in run.references() if r.seq not in arrived and r.seq < 300})
    assert lost[0] == lost[1]
    assert len(lost[0]) > 10


def test_a_stop_before_the_tasks_are_present_is_a_stop_and_no_fault(tmp_path, monkeypatch):
    class Impatient(Interrupts):
        """Interrupts with a Ctrl-C before the first task was present."""

        def __enter__(self):
            self.count, self.newest = 1, "Ctrl-C"
            return super().__enter__()

    monkeypatch.setattr(execute, "Interrupts", Impatient)
    ran = experiment.run(config.read_experiment("move", BRIEF), "wall", tmp_path, quietly, quietly)
    assert (ran.outcome.exit_code, ran.outcome.reasons) == (4, ["stopped by the operator (Ctrl-C)"])
    assert RunAnalysis(ran.folder / LOG).run.log.complete


def start_a_run(folder: Path) -> subprocess.Popen:
    """Start a run by the command line."""
    sets = [word for change in [*BRIEF, "experiment.watch_s=60"] for word in ("--set", change)]
    command = [
        sys.executable,
        "-P",
        "-m",
        "rig.ui.cli.entry",
        "run",
        "move",
        "--no-report",
        "--json",
        "--runs",
        str(folder),
        *sets,
    ]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def wait_for_the_start(run: subprocess.Popen, folder: Path) -> None:
    """Wait until the log has the start order; at most 60 s."""
    for _ in range(600):
        logs = list(folder.glob(f"*/{LOG}"))
        if logs and b"t_start" in _events(logs[0]):
            return
        with pytest.raises(subprocess.TimeoutExpired):
            run.wait(0.1)
    pytest.fail("the run never started")


def _events(log: Path) -> bytes:
    try:
        return b" ".join(entry.data for entry in read_log(log).topics.get("/events", []))
    except LogError:
        return b""


def ended(run: subprocess.Popen) -> tuple[int, dict]:
    said, _ = run.communicate(timeout=30)
    return run.returncode, msgspec.json.decode(said)


def test_ctrl_c_stops_the_robot_first_and_keeps_the_log(tmp_path):
    run = start_a_run(tmp_path)
    wait_for_the_start(run, tmp_path)
    run.send_signal(signal.SIGINT)
    code, said = ended(run)
    assert (code, said["exit_status"], said["exit_code"]) == (4, "stopped", 4)
    assert "Ctrl-C" in said["reasons"][0]
    log = RunAnalysis(Path(said["run_dir"]) / LOG)
    assert log.run.log.complete
    orders = [entry.data for entry in log.run.log.topics["/command"]]
    stop, close = (
        next(k for k, data in enumerate(orders) if word in data) for word in (b'"stop"', b'"close"')
    )
    assert stop < close


def test_rig_stop_from_a_second_terminal_stops_the_run(tmp_path):
    run = start_a_run(tmp_path)
    wait_for_the_start(run, tmp_path)
    stop = [sys.executable, "-P", "-m", "rig.ui.cli.entry", "stop", "--runs", str(tmp_path)]
    stopped = subprocess.run(stop, capture_output=True, text=True, timeout=30, check=False)
    assert (stopped.returncode, stopped.stderr) == (0, "")
    ordered, at_rest = stopped.stdout.splitlines()
    assert ordered.endswith(": ordered, was running")
    assert re.search(r": stopped after \d+ ms$", at_rest)
    code, said = ended(run)
    assert (code, said["exit_status"]) == (4, "stopped")
    assert said["reasons"][0] == "stop from another terminal"


def test_rig_stop_stops_the_robot_past_an_operator_that_does_not_run(tmp_path):
    run = start_a_run(tmp_path)
    wait_for_the_start(run, tmp_path)
    run.send_signal(signal.SIGSTOP)
    stop = [sys.executable, "-P", "-m", "rig.ui.cli.entry", "stop", "--runs", str(tmp_path)]
    stopped = subprocess.run(stop, capture_output=True, text=True, timeout=30, check=False)
    run.send_signal(signal.SIGCONT)
    assert stopped.returncode == 5
    assert "ordered at controller and streamer" in stopped.stdout
    code, said = ended(run)
    assert (code, said["exit_status"]) == (4, "stopped")
    replies = [
        entry.data for entry in RunAnalysis(Path(said["run_dir"]) / LOG).run.log.topics["/reply"]
    ]
    reports = [msgspec.json.decode(data) for data in replies if b"past the operator" in data]
    assert {(report["sender"], report["phase"]) for report in reports} == {
        ("controller", "stopped"),
        ("streamer", "stopped"),
    }


def test_a_killed_task_ends_the_run_as_a_fault_that_names_it_and_the_log_is_kept(
    tmp_path,
):
    run = start_a_run(tmp_path)
    wait_for_the_start(run, tmp_path)
    os.kill(child_of(run, "vision"), signal.SIGKILL)
    code, said = ended(run)
    assert (code, said["exit_status"]) == (5, "fault")
    assert "task 'vision' exited during the run (signal 9)" in said["reasons"][0]
    assert RunAnalysis(Path(said["run_dir"]) / LOG).run.angles


def child_of(run: subprocess.Popen, module: str) -> int:
    """The process that runs a task of this run."""
    children = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
    return next(
        int(pid)
        for pid in children
        if Path(f"/proc/{pid}/cmdline").read_bytes().endswith(f"{module}\0".encode())
    )


def test_a_run_killed_outright_leaves_a_log_that_can_be_read_and_no_task_behind(tmp_path):
    run = start_a_run(tmp_path)
    wait_for_the_start(run, tmp_path)
    children = [
        int(pid) for pid in Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
    ]
    sockets = bus_folder.folder_of(operator_file.read(*operator_file.find(tmp_path)).address)
    run.kill()
    run.communicate()
    (log,) = tmp_path.glob(f"*/{LOG}")
    analysis = RunAnalysis(log)
    assert not analysis.run.log.complete
    assert analysis.summary.exit_code == 6
    assert any("incomplete" in reason for reason in analysis.summary.reasons)
    for pid in children:
        wait_until_gone(pid)
    for task in ("controller", "streamer"):  # by the end of their input, not by a silence
        said = (log.parent / f"{task}.log").read_text()
        assert f"{task}: the process of the operator has exited" in said
    assert sockets.exists()
    operator_file.remove_stale(tmp_path)  # as the next run does
    assert not sockets.exists()
    assert operator_file.find(tmp_path) == []


def wait_until_gone(pid: int) -> None:
    """Wait for the exit of a task whose operator has exited."""
    descriptor = os.pidfd_open(pid) if Path(f"/proc/{pid}").exists() else None
    if descriptor is None:
        return
    import select

    assert select.select([descriptor], [], [], 20)[0], f"task {pid} outlived its operator"
    os.close(descriptor)


def free_block() -> int:
    """A base port with free ports for a run, below the range the kernel hands out.

    A port of the kernel's range may be taken by another program between the look and the run.
    """
    for base in range(20_000, 32_000, PORTS):
        ports = range(base, base + PORTS)
        if all(port_is_free("127.0.0.1", p, udp) for p in ports for udp in (True, False)):
            return base
    raise AssertionError("no block of free ports between 20000 and 32000")


DATAGRAM_PORT = TCP_PORTS  # receiver of the first channel on UDP; the sender has the next one
PORT_OF = {
    "a receiver of datagrams": (DATAGRAM_PORT, "UDP port"),
    "a sender of datagrams": (DATAGRAM_PORT + 1, "UDP port"),
    "the last sender": (DATAGRAM_PORT + 2 * DATAGRAMS.index("angle_1") + 1, "UDP port"),
    "the bus": (0, "tcp://127.0.0.1:"),
    "the frames": (3, "tcp://127.0.0.1:"),
}


@pytest.mark.parametrize("name", PORT_OF)
def test_a_port_in_use_is_refused_before_anything_moves(tmp_path, name):
    offset, kind = PORT_OF[name]
    base = free_block()
    with socket.socket(socket.AF_INET, UDP if kind == "UDP port" else TCP) as taken:
        taken.bind(("127.0.0.1", base + offset))
        if kind != "UDP port":
            taken.listen()
        told = rf"{kind} ?{base + offset}\b.*base_port"
        with pytest.raises((Refused, PortInUse), match=told):
            experiment.run(
                config.read_experiment(
                    "move", [*BRIEF, f"network.base_port={base}", "network.bus=tcp"]
                ),
                "wall",
                tmp_path,
                quietly,
                quietly,
            )
    (log,) = tmp_path.glob(f"*/{LOG}")
    recorded = read_log(log)
    assert recorded.metadata["run.stop"]["exit_code"] == "3"
    assert {"/reference", "/setpoint"}.isdisjoint(recorded.topics)


def test_a_run_over_ports_balances_like_one_over_local_sockets(tmp_path):
    changes = [*BRIEF, "network.bus=tcp", f"network.base_port={free_block()}"]
    ran = experiment.run(
        config.read_experiment("move", changes), "wall", tmp_path, quietly, quietly
    )
    links = RunAnalysis(ran.folder / LOG).summary.links
    assert (ran.outcome.exit_code, ran.outcome.reasons) == (0, [])
    assert {name: row.unexplained for name, row in links.items()} == dict.fromkeys(links, 0)
    assert {row.foreign for row in links.values()} == {0}


def test_a_run_leaves_no_folder_of_sockets_behind(tmp_path, monkeypatch):
    sockets = tmp_path / "tmp"
    sockets.mkdir()
    monkeypatch.setattr(bus_folder.tempfile, "gettempdir", lambda: str(sockets))
    seen = []

    def look(*_):
        seen.extend(path.name for path in sockets.glob("rig-*/*"))

    ran = experiment.run(
        config.read_experiment("move", BRIEF), "wall", tmp_path / "runs", look, quietly
    )
    assert ran.outcome.exit_code == 0
    assert {"commands", "telemetry", "pictures", "frame_1"} <= set(seen)
    assert list(sockets.iterdir()) == []
