"""Whether this machine can run experiments: each check says what it found, the bound, and what to do."""

from __future__ import annotations

import importlib.util
import os
import platform
import shutil
import sys
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import NamedTuple

import numpy as np

from comms.channels import CHANNELS, Transport
from comms.clock import timer_lateness_ns
from comms.errors import CommsError
from comms.udp import UdpReceiver, port_is_free, receive_buffer_bytes
from rig.run.config import NetworkSection, shipped_calibrations
from rig.run.runtime.children import PROCESSES
from rig.run.runtime.processes import BUS_PORTS, channel_ports

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
TIMER_PERIOD_NS, TIMER_TICKS = 5_000_000, 200
TIMER_BOUND_MS = 2.0  # p99; above it setpoints come in visibly uneven


class Finding(NamedTuple):
    """One finding: status is ok, warning (runs, perhaps not well) or failed (would not run)."""

    name: str
    status: str
    found: str
    advice: str = ""


def examine(runs: Path, network: NetworkSection) -> list[Finding]:
    """All checks; takes about one second for the timer."""
    return [
        _python(),
        *(_package(name, major) for name, major in NEEDED.items()),
        *(_room(name) for name in ROOMS),
        _calibration(),
        _disk(runs),
        _ports(network),
        _receive_buffer(network.bind),
        _cores(),
        _timer(),
    ]


def _python() -> Finding:
    found = platform.python_version()
    good = sys.version_info >= (3, 11)
    return Finding("python", "ok" if good else "failed", found, "" if good else "need >= 3.11")


def _package(name: str, major: int) -> Finding:
    try:
        found = version(name)
    except PackageNotFoundError:
        return Finding(name, "failed", "not installed", "run `make setup`")
    good = int(found.split(".")[0]) >= major
    return Finding(
        name,
        "ok" if good else "failed",
        found,
        "" if good else f"need >= {major}: run `make setup`",
    )


def _room(name: str) -> Finding:
    """The names are generic: another distribution's `vision` on the path would be run instead of ours."""
    spec = importlib.util.find_spec(name)
    where = Path(spec.origin).resolve().parent if spec and spec.origin else None
    home = Path(__file__).resolve().parents[2]
    if where is None:
        return Finding(f"package {name}", "failed", "not found", "run `make setup`")
    ours = where.parent == home and _distributed()
    advice = (
        ""
        if ours
        else f"another package of this name is in front of ours in {home}: use the project's own environment"
    )
    return Finding(f"package {name}", "ok" if ours else "failed", str(where), advice)


def _distributed() -> bool:
    try:
        distribution("swayless")
    except PackageNotFoundError:
        return False
    return True


def _calibration() -> Finding:
    known = shipped_calibrations()
    return (
        Finding("calibration", "ok", known[-1])
        if known
        else Finding(
            "calibration", "warning", "none shipped", "make one with `rig calibrate offsets`"
        )
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
    good = free >= MIN_FREE_BYTES
    advice = "" if good else f"need {MIN_FREE_BYTES / 1e6:.0f} MB: remove old runs"
    return Finding(
        "disk", "ok" if good else "failed", f"{free / 1e9:.1f} GB free for {runs}", advice
    )


def _ports(network: NetworkSection) -> Finding:
    base = network.base_port
    if base == 0:
        try:
            receiver = UdpReceiver(network.bind, 0, "doctor")
        except (CommsError, OSError) as error:
            return Finding(
                "ports", "failed", str(error), f"can {network.bind} be bound on this machine?"
            )
        receiver.close()
        return Finding("ports", "ok", f"free ports on {network.bind}")
    wanted = [(base + i, False) for i in range(BUS_PORTS)]
    wanted += [
        (port, CHANNELS[name].transport is Transport.UDP)
        for name, port in channel_ports(network.bind, base).items()
    ]
    taken = [str(port) for port, udp in wanted if not port_is_free(network.bind, port, udp)]
    if taken:
        return Finding(
            "ports",
            "failed",
            f"in use on {network.bind}: {', '.join(taken)}",
            "stop what uses them, or change network.base_port",
        )
    return Finding("ports", "ok", f"{base} to {base + len(wanted) - 1} on {network.bind} are free")


def _receive_buffer(host: str) -> Finding:
    found = receive_buffer_bytes(host)
    good = found >= 100_000  # a second of our busiest channel
    return Finding(
        "UDP receive buffer",
        "ok" if good else "warning",
        f"{found // 1024} KiB",
        "" if good else "raise net.core.rmem_max",
    )


def _cores() -> Finding:
    cores = len(os.sched_getaffinity(0))
    advice = (
        ""
        if cores >= 2
        else f"{len(PROCESSES)} tasks and the operator share one core: expect late ticks"
    )
    return Finding("cores", "ok" if cores >= 2 else "warning", str(cores), advice)


def _timer() -> Finding:
    late_ms = np.array(timer_lateness_ns(TIMER_PERIOD_NS, TIMER_TICKS)) * 1e-6
    p99 = float(np.percentile(late_ms, 99))
    good = p99 <= TIMER_BOUND_MS
    advice = (
        ""
        if good
        else f"p99 should be <= {TIMER_BOUND_MS:g} ms: this machine is busy; expect late ticks"
    )
    found = f"a 5 ms tick is late by {np.median(late_ms):.2f} ms (median), {p99:.2f} (p99), {late_ms.max():.2f} (worst)"
    return Finding("timer", "ok" if good else "warning", found, advice)
