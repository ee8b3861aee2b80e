"""Checks of the machine before a run: each finding has its value, its bound and the next step."""

from __future__ import annotations

import importlib.util
import os
import platform
import shutil
import sys
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import NamedTuple

from comms.channels import TASKS
from comms.endpoints import PORTS, TCP_PORTS, choose_ports
from comms.errors import CommsError
from comms.udp import UdpReceiver, port_is_free, receive_buffer_bytes
from rig.run.config import Experiment, NetworkSection, shipped_calibrations
from rig.run.finding import Finding
from rig.run.machine import MachineGrade, measure_machine

ROOMS = ("comms", "planners", "vision", "sim_rig", "rig")
NEEDED = {
    "numpy": 2,
    "scipy": 1,
    "opencv-python-headless": 4,
    "pyzmq": 26,
    "mcap": 1,
    "msgspec": 0,
    "matplotlib": 3,
}
MIN_FREE_BYTES = 500_000_000  # a run takes 5 MB; a disk this full fails soon


class Examination(NamedTuple):
    """Findings of all checks, and what runs on this machine."""

    findings: list[Finding]
    machine: MachineGrade

    @property
    def verdict(self) -> str:
        """One line: what can run here."""
        if any(finding.status == "failed" for finding in self.findings):
            return "not ready: a run would fail"
        if not self.machine.can_run_in_real_time:
            return "ready in virtual time only: `rig run --virtual`"
        return f"ready for {self.machine.grade.value}: `rig run`"


def examine(
    runs: Path,
    network: NetworkSection,
    measure: Callable[[], MachineGrade] = measure_machine,
    experiment: Experiment | None = None,
) -> Examination:
    """Run all checks; takes three seconds, for the timer.

    experiment: its field bus and node are checked, where it has a drive.
    """
    machine = measure()
    findings = [
        _python(),
        *(_package(name, major) for name, major in NEEDED.items()),
        *(_room(name) for name in ROOMS),
        _calibration(),
        _disk(runs),
        _ports(network),
        _receive_buffer(network.bind),
        _cores(),
        _timer(machine),
        *_field_bus(experiment),
    ]
    return Examination(findings, machine)


def _field_bus(experiment: Experiment | None) -> list[Finding]:
    """Check bus and node; without a drive nothing is imported and nothing is asked."""
    if experiment is None:
        return []
    from rig.run.runtime.bench import has_drive

    if not has_drive(experiment):
        return []
    from rig.run.field_bus.check import check_field_bus

    return check_field_bus(experiment)


def _python() -> Finding:
    found = platform.python_version()
    good = sys.version_info >= (3, 11)
    return Finding("python", "ok" if good else "failed", found, "" if good else "need >= 3.11")


def _package(name: str, major: int) -> Finding:
    try:
        found = version(name)
    except PackageNotFoundError:
        return Finding(name, "failed", "not installed", "run `make setup`")
    if int(found.split(".")[0]) >= major:
        return Finding(name, "ok", found)
    return Finding(name, "failed", found, f"need >= {major}: run `make setup`")


def _room(name: str) -> Finding:
    """Check that a package is the one of this project.

    The names are generic: a package `vision` of another distribution, earlier on the path, would
    be run instead.
    """
    spec = importlib.util.find_spec(name)
    if spec is None or not spec.origin:
        return Finding(f"package {name}", "failed", "not found", "run `make setup`")
    folder = Path(spec.origin).resolve().parent
    home = Path(__file__).resolve().parents[2]
    if folder.parent == home and _is_installed():
        return Finding(f"package {name}", "ok", str(folder))
    advice = (
        f"another package of this name precedes the one in {home}: "
        "use the project's own environment"
    )
    return Finding(f"package {name}", "failed", str(folder), advice)


def _is_installed() -> bool:
    try:
        distribution("swayless")
    except PackageNotFoundError:
        return False
    return True


def _calibration() -> Finding:
    known = shipped_calibrations()
    if known:
        return Finding("calibration", "ok", known[-1])
    return Finding(
        "calibration", "warning", "none shipped", "make one with `rig calibrate offsets`"
    )


def _disk(runs: Path) -> Finding:
    where = next(p for p in (runs, *runs.absolute().parents) if p.exists())
    if not where.is_dir() or not os.access(where, os.W_OK):
        return Finding(
            "disk",
            "failed",
            f"{where.resolve()} is not writable",
            "name another folder with --runs",
        )
    free = shutil.disk_usage(where).free
    found = f"{free / 1e9:.1f} GB free for {runs}"
    if free >= MIN_FREE_BYTES:
        return Finding("disk", "ok", found)
    advice = f"need {MIN_FREE_BYTES / 1e6:.0f} MB: remove old runs"
    return Finding("disk", "failed", found, advice)


def _ports(network: NetworkSection) -> Finding:
    if network.base_port == 0:
        return _free_port(network.bind)
    base = network.base_port
    taken = []
    for k, port in enumerate(choose_ports(network.bind, base)):
        if not port_is_free(network.bind, port, udp=k >= TCP_PORTS):
            taken.append(str(port))
    if taken:
        return Finding(
            "ports",
            "failed",
            f"in use on {network.bind}: {', '.join(taken)}",
            "stop what uses them, or change network.base_port",
        )
    return Finding("ports", "ok", f"{base} to {base + PORTS - 1} on {network.bind} are free")


def _free_port(host: str) -> Finding:
    try:
        receiver = UdpReceiver(host, 0, "doctor")
    except (CommsError, OSError) as error:
        return Finding("ports", "failed", str(error), f"can {host} be bound on this machine?")
    receiver.close()
    return Finding("ports", "ok", f"free ports on {host}")


def _receive_buffer(host: str) -> Finding:
    found = receive_buffer_bytes(host)
    good = found >= 100_000  # one second of the busiest channel
    return Finding(
        "UDP receive buffer",
        "ok" if good else "warning",
        f"{found // 1024} KiB",
        "" if good else "raise net.core.rmem_max",
    )


def _cores() -> Finding:
    cores = len(os.sched_getaffinity(0))
    if cores >= 2:
        return Finding("cores", "ok", str(cores))
    advice = f"{len(TASKS)} tasks and the operator share one core: expect late ticks"
    return Finding("cores", "warning", str(cores), advice)


def _timer(machine: MachineGrade) -> Finding:
    """Judge the timer: whether a run in real time keeps its deadlines on this machine."""
    if machine.can_run_in_real_time:
        return Finding("timer", "ok", machine.reason)
    found, _, advice = machine.reason.partition("; ")
    return Finding("timer", "warning", found, advice)
