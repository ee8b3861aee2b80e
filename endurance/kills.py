"""kill -9 of each process of a run at random instants, watched from outside.

Usage: `python -m endurance.kills [--kills N] [--seed S] [--short]`, as root: the packets of the
loopback interface are read. After each kill the robot must stand in time, the log must be readable
and the next run must start. Ends with exit code 1 where one of these fails.
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import random
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import NamedTuple

from comms import codec
from comms.endpoints import PORTS, Endpoints, endpoints
from comms.errors import LogError
from comms.mcap_log import EPOCH_KEY, read_log

HOST, BASE_PORT = "127.0.0.1", 47_200
KILLS, SHORT_KILLS = 50, 5
VICTIMS = {
    "operator": "rig.ui.cli.entry",
    "controller": "rig.run.tasks.controller",
    "streamer": "rig.run.tasks.streamer",
    "bench": "sim_rig",
    "vision": "vision",
}
MOVE_S, WATCH_S = 1.5, 1.0
RUN = ("run", "move", "--no-report", "--json")
SETTINGS = {
    "network.base_port": BASE_PORT,
    "experiment.quiet_s": 0.6,
    "experiment.watch_s": WATCH_S,
    "move.time_s": MOVE_S,
}
QUIET_S = 0.6
DECELERATION_M_S2 = 5.5
REACTION_S = 0.1
AT_REST_M_S = 0.002
MAX_LOST_S = 0.5
LOOPBACK_ALL = 0x0003  # every protocol
OUTGOING = 4  # a loopback packet is seen on its way out, too
ETHERNET, UDP_HEAD = 14, 8


class Seen(NamedTuple):
    """Position and speed in a datagram, and its arrival [s]."""

    t_s: float
    position_m: tuple[float, ...]
    speed_m_s: float


class Sniffer(threading.Thread):
    """References, setpoints and encoder readings on the loopback interface, by channel."""

    def __init__(self, ends: Endpoints) -> None:
        super().__init__(daemon=True)
        self.seen: dict[str, list[Seen]] = {"reference": [], "setpoint": [], "joint_state": []}
        self._ports = {ends.ports[name].receiver: name for name in self.seen}
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(LOOPBACK_ALL))
        self._socket.bind(("lo", 0))
        self._socket.settimeout(0.1)
        self.stopped = threading.Event()

    def run(self) -> None:
        """Read packets until told to stop."""
        while not self.stopped.is_set():
            try:
                data, address = self._socket.recvfrom(4096)
            except TimeoutError:
                continue
            if address[2] == OUTGOING:
                self._take(data[ETHERNET:], time.monotonic())
        self._socket.close()

    def _take(self, packet: bytes, t_s: float) -> None:
        if len(packet) < 20 or packet[9] != socket.IPPROTO_UDP:
            return
        udp = packet[(packet[0] & 15) * 4 :]
        channel = self._ports.get(struct.unpack_from("!H", udp, 2)[0])
        body = udp[UDP_HEAD + codec.HEADER.size :]
        if channel == "reference" and len(body) > 32:
            self.seen[channel].append(Seen(t_s, struct.unpack_from("<3d", body, 8), 0.0))
        elif channel == "setpoint" and len(body) > 26:
            self.seen[channel].append(Seen(t_s, struct.unpack_from("<3d", body, 2), 0.0))
        elif channel == "joint_state" and len(body) > 74:
            speed = math.hypot(*struct.unpack_from("<3d", body, 50))
            self.seen[channel].append(Seen(t_s, struct.unpack_from("<3d", body, 2), speed))


class Killed(NamedTuple):
    """Outcome of a kill."""

    victim: str
    at_s: float  # from the first reference
    speed_m_s: float
    rest_s: float  # from the last moving reference, or the kill, to rest
    bound_s: float
    lost_s: float
    complaint: str


def kill_once(victim: str, at_s: float, runs: Path) -> Killed:
    """Start a run, kill a process of it, and judge what follows."""
    ends = endpoints(HOST, list(range(BASE_PORT, BASE_PORT + PORTS)), None)
    sniffer = Sniffer(ends)
    sniffer.start()
    changes = [part for key, value in SETTINGS.items() for part in ("--set", f"{key}={value}")]
    command = [sys.executable, "-m", VICTIMS["operator"], *RUN, *changes, "--runs", str(runs)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    began_s = _first_reference_s(sniffer, process)
    if began_s is None:
        error = process.communicate()[1].decode()
        return Killed(victim, at_s, 0.0, 0.0, 0.0, 0.0, f"the run did not start: {error[-300:]}")
    _wait_until(began_s + at_s)
    pid = process.pid if victim == "operator" else _child(process.pid, VICTIMS[victim])
    os.kill(pid, signal.SIGKILL)
    killed_s, killed_ns = time.monotonic(), time.time_ns()
    process.communicate(timeout=60)
    _wait_until(killed_s + 1.5)
    sniffer.stopped.set()
    sniffer.join()
    return _judge(victim, at_s, killed_s, killed_ns, sniffer.seen, runs)


def _first_reference_s(sniffer: Sniffer, process: subprocess.Popen[bytes]) -> float | None:
    while process.poll() is None and not sniffer.seen["reference"]:
        threading.Event().wait(0.01)
    return sniffer.seen["reference"][0].t_s if sniffer.seen["reference"] else None


def _wait_until(t_s: float) -> None:
    threading.Event().wait(max(0.0, t_s - time.monotonic()))


def _child(parent: int, module: str) -> int:
    """Find the child of a process that runs a module."""
    children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    for pid in children:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        if module.encode() in words:
            return int(pid)
    raise LookupError(f"no child runs {module}")


def _judge(
    victim: str,
    at_s: float,
    killed_s: float,
    killed_ns: int,
    seen: dict[str, list[Seen]],
    runs: Path,
) -> Killed:
    before = [s.speed_m_s for s in seen["joint_state"] if s.t_s <= killed_s]
    speed_m_s = before[-1] if before else 0.0
    last_s = killed_s
    if victim == "vision":  # references go on until the angle is stale
        last_s = max(killed_s, _last_change_s(seen["reference"]))
    if victim == "bench":  # no encoders any more
        rest_s = max(killed_s, _last_change_s(seen["setpoint"]))
    else:
        moving = [s.t_s for s in seen["joint_state"] if s.speed_m_s > AT_REST_M_S]
        rest_s = max([killed_s, *moving])
    bound_s = REACTION_S + speed_m_s / DECELERATION_M_S2
    complaint = "" if rest_s - last_s <= bound_s else "not at rest in time"
    lost_s, damage = _log_lost_s(runs, killed_ns if victim == "operator" else None)
    if damage or lost_s > MAX_LOST_S:
        complaint += damage or "the log lost too much"
    return Killed(victim, at_s, speed_m_s, rest_s - last_s, bound_s, lost_s, complaint)


def _last_change_s(seen: list[Seen]) -> float:
    changes = [b.t_s for a, b in itertools.pairwise(seen) if a.position_m != b.position_m]
    return max(changes, default=0.0)


def _log_lost_s(runs: Path, killed_ns: int | None) -> tuple[float, str]:
    """Time before the kill that the newest log lost, and why the log cannot be read."""
    newest = max(runs.glob("*/run.mcap"), key=lambda path: path.stat().st_mtime)
    try:
        log = read_log(newest)
    except LogError as error:
        return 0.0, str(error)
    if killed_ns is None:
        return 0.0, ""
    epoch_ns = int(log.metadata["run.start"][EPOCH_KEY])
    last_ns = max(entries[-1].log_ns for entries in log.topics.values() if entries)
    return max(0.0, (killed_ns - epoch_ns - last_ns) * 1e-9), ""


def leftovers(runs: Path) -> list[str]:
    """What the runs left behind, after the verb `rig stop`."""
    stop = [sys.executable, "-m", VICTIMS["operator"], "stop", "--runs", str(runs)]
    subprocess.run(stop, capture_output=True, check=False)
    found = [str(path) for path in runs.glob("*/operator.json")]
    found += [str(path) for path in Path(tempfile.gettempdir()).glob("rig-*")]
    return found


def main() -> int:
    """Kill, print a line for each and a summary; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=KILLS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--short", action="store_true")
    chosen = parser.parse_args()
    rng = random.Random(chosen.seed)
    outcomes = []
    with tempfile.TemporaryDirectory() as folder:
        runs = Path(folder) / "runs"
        for k in range(SHORT_KILLS if chosen.short else chosen.kills):
            victim = list(VICTIMS)[k % len(VICTIMS)]
            moving = k // len(VICTIMS) % 2 == 0
            at_s = rng.uniform(0.0, QUIET_S + MOVE_S + WATCH_S)
            if moving:
                at_s = rng.uniform(QUIET_S + 0.1, QUIET_S + MOVE_S - 0.1)
            o = kill_once(victim, at_s, runs)
            outcomes.append(o)
            print(
                f"{o.victim:10} at {o.at_s:.2f} s, {o.speed_m_s:.3f} m/s: at rest after "
                f"{o.rest_s * 1e3:4.0f} ms of {o.bound_s * 1e3:.0f}, log lost {o.lost_s:.2f} s "
                f"{o.complaint}",
                flush=True,
            )
        left = leftovers(runs)
    bad = [o for o in outcomes if o.complaint]
    print(f"{len(outcomes)} kills, {len(bad)} complaints; left behind: {left or 'nothing'}")
    for victim in VICTIMS:
        rests = [o.rest_s * 1e3 for o in outcomes if o.victim == victim and not o.complaint]
        print(f"{victim:10} longest {max(rests, default=math.nan):.0f} ms of {len(rests)}")
    return 1 if bad or left else 0


if __name__ == "__main__":
    sys.exit(main())
