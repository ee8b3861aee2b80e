"""Strangers on the machine: floods and forgeries at every port of a run in real time.

Usage: `python -m endurance.strangers [--short]`. Runs the same experiment alone and under each
attack, over TCP so that the bus can be reached at all, and compares ledger, verdict and lateness.
Ends with exit code 1 where an attack changed the ledger or the verdict.
"""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import zmq

from comms import codec
from comms.channels import CHANNELS, Transport
from comms.endpoints import BUS, PORTS, STREAMS, TCP_PORTS, endpoints
from comms.messages import axis_setpoint

HOST, BASE_PORT = "127.0.0.1", 47_100
RATE_HZ = 20_000
BURST = 50
RUN = ("run", "move", "--json", "--no-report", "--set", "experiment.watch_s=2")
NETWORK = ("--set", f"network.base_port={BASE_PORT}", "--set", "network.bus=tcp")
BIG_BYTES = 600_000_000
Attack = Callable[[threading.Event], dict[str, Any]]


def ends() -> Any:
    """Addresses and ports of the run that is attacked."""
    return endpoints(HOST, list(range(BASE_PORT, BASE_PORT + PORTS)), None)


def flood_ports(stop: threading.Event) -> dict[str, Any]:
    """Send 20,000 datagrams a second for 3 s, in turn to every UDP port."""
    ports = range(BASE_PORT + TCP_PORTS, BASE_PORT + PORTS)
    channels = [name for name, row in CHANNELS.items() if row.transport is Transport.UDP]
    rng = random.Random(1)
    forged = []
    for channel in channels:
        size = codec.length(channel) - codec.CLOSING_BYTES
        forged.append(codec.encode_closing(channel, 9, 0, 7))
        forged.append(rng.randbytes(size))
    forged.append(codec.encode("setpoint", axis_setpoint(100_000, 0, (-9.9, 0.0, 0.0)), 7))
    sent = 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        began = time.perf_counter()
        while time.perf_counter() - began < 3.0 and not stop.is_set():
            for port in ports:
                for _ in range(BURST):
                    try:
                        sender.sendto(rng.choice(forged), (HOST, port))
                    except OSError:
                        continue
                    sent += 1
            stop.wait(max(0.0, sent / RATE_HZ - (time.perf_counter() - began)))
    return {"datagrams": sent, "a second": round(sent / (time.perf_counter() - began))}


def pose_as_task(stop: threading.Event) -> dict[str, Any]:
    """Connect as controller and streamer, say hello and answer that all is well."""
    context = zmq.Context()
    sockets = []
    sent = 0
    for name in (b"controller", b"streamer", b"bench"):
        dealer = context.socket(zmq.DEALER)
        dealer.setsockopt(zmq.IDENTITY, name)
        dealer.setsockopt(zmq.LINGER, 0)
        dealer.connect(ends().addresses["commands"])
        sockets.append(dealer)
    while not stop.wait(0.01):
        for dealer in sockets:
            reply = {"seq": 0, "t_ns": 0, "id": 1, "sender": "controller", "ok": True}
            text = json.dumps(reply | {"phase": "stopped"}).encode()
            for parts in ([b"hello"], [b"reply", text], [b"farewell"]):
                dealer.send_multipart(parts, zmq.NOBLOCK)
                sent += 1
    answers = sum(dealer.poll(0) for dealer in sockets)
    context.destroy(0)
    return {"messages": sent, "answers": answers}


def flood_bus(stop: threading.Event) -> dict[str, Any]:
    """Send junk to the sockets of the bus and of the frames as fast as they take it."""
    context = zmq.Context()
    kinds = {"commands": zmq.DEALER}
    sockets = []
    for name in (*BUS, *STREAMS):
        junk = context.socket(kinds.get(name, zmq.PUSH))
        junk.setsockopt(zmq.LINGER, 0)
        junk.connect(ends().addresses[name])
        sockets.append(junk)
    sent = 0
    while not stop.is_set():
        for junk in sockets:
            try:
                junk.send_multipart([b"truth", bytes(60), bytes(60)], zmq.NOBLOCK)
                sent += 1
            except zmq.Again:
                stop.wait(0.001)
    context.destroy(0)
    return {"messages": sent}


def send_big(stop: threading.Event) -> dict[str, Any]:
    """Send one message of 600 MB to each socket of the bus and of the frames."""
    context = zmq.Context()
    big = bytes(BIG_BYTES)
    for name in (*BUS, *STREAMS):
        junk = context.socket(zmq.DEALER if name == "commands" else zmq.PUSH)
        junk.setsockopt(zmq.LINGER, 0)
        junk.connect(ends().addresses[name])
        junk.send(big, copy=False)
    stop.wait()
    context.destroy(0)
    return {"messages": len(BUS) + len(STREAMS)}


def run(runs: Path, attack: Attack | None, interrupt: bool) -> dict[str, Any]:
    """Run the experiment, attacked from its start of motion on; returns what it reported.

    interrupt: send Ctrl-C one second after the attack began.
    """
    command = [sys.executable, "-m", "rig.ui.cli.entry", *RUN, *NETWORK, "--runs", str(runs)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    stop = threading.Event()
    noted: dict[str, Any] = {}

    def hostile() -> None:
        if attack is not None:
            noted.update(attack(stop))

    thread = threading.Thread(target=hostile)
    wait_for_run(runs, process)
    thread.start()
    interrupted_s = None
    if interrupt:
        stop.wait(4.0)
        process.send_signal(signal.SIGINT)
        interrupted_s = time.perf_counter()
    output, _ = process.communicate(timeout=120)
    ended_s = time.perf_counter()
    stop.set()
    thread.join()
    document: dict[str, Any] = json.loads(output)
    document["attack"] = noted
    if interrupted_s is not None:
        document["exit_after_s"] = round(ended_s - interrupted_s, 2)
    document["peak_mb"] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024
    return document


def wait_for_run(runs: Path, process: subprocess.Popen[bytes]) -> None:
    """Wait until the tasks run; returns at once where the run has ended."""
    while process.poll() is None and not list(runs.glob("*/operator.json")):
        select_ms(20)
    select_ms(2000)


def select_ms(ms: int) -> None:
    """Wait."""
    threading.Event().wait(ms * 1e-3)


def line(name: str, d: dict[str, Any]) -> str:
    """One line of figures."""
    links = d.get("links", {})
    unexplained = sum(row["unexplained"] for row in links.values())
    foreign = sum(row["foreign"] for row in links.values())
    events = [e for e in d.get("events", []) if "foreign" in e]
    late = (d.get("lateness") or {}).get("late_ticks", {})
    return (
        f"{name:14} exit {d['exit_code']}, verdict {d['verdict']}, unaccounted {unexplained}, "
        f"foreign in ledger {foreign}, late ticks {late}, peak memory {d['peak_mb']} MB, "
        f"Ctrl-C to exit {d.get('exit_after_s')} s, {d['attack']}, {events}, {d['reasons']}"
    )


def main(arguments: Sequence[str]) -> int:
    """Run alone and under each attack; return the exit code."""
    attacks: dict[str, tuple[Attack | None, bool]] = {
        "alone": (None, False),
        "ports": (flood_ports, False),
    }
    if "--short" not in arguments:
        attacks |= {
            "impostors": (pose_as_task, False),
            "600 MB": (send_big, False),
            "bus": (flood_bus, False),
            "Ctrl-C alone": (None, True),
            "Ctrl-C, bus": (flood_bus, True),
        }
    os.environ["COLUMNS"] = "200"
    failed = 0
    for name, (attack, interrupt) in attacks.items():
        with tempfile.TemporaryDirectory() as runs:
            document = run(Path(runs), attack, interrupt)
        links = document.get("links", {})
        is_balanced = all(row["unexplained"] == 0 for row in links.values())
        expected = 4 if interrupt else 0
        failed += document["exit_code"] != expected or not (links and is_balanced)
        print(line(name, document), flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
