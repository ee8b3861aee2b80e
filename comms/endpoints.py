"""Addresses of a run: sockets of the bus and of the frames, ports of the datagrams."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from comms import bus_folder
from comms.channels import CHANNELS, DATA, Transport
from comms.udp import free_ports

BUS = ("commands", "telemetry", "pictures")
STREAMS = tuple(name for name in DATA if CHANNELS[name].transport is Transport.ZMQ)
DATAGRAMS = tuple(name for name in DATA if CHANNELS[name].transport is Transport.UDP)
STOPPABLE = ("controller", "streamer")  # tasks with a stop port: those that move the robot
TCP_PORTS = len(BUS) + len(STREAMS)
PORTS = TCP_PORTS + 2 * len(DATAGRAMS) + len(STOPPABLE)


class DatagramPorts(NamedTuple):
    """Ports of both ends of a channel; each end takes datagrams of the other alone."""

    receiver: int
    sender: int


class Endpoints(NamedTuple):
    """Addresses by name of socket or channel, ports by channel, stop ports by task."""

    addresses: Mapping[str, str]
    ports: Mapping[str, DatagramPorts]
    stop_ports: Mapping[str, int]
    can: Mapping[str, Any] = {}  # settings of the field bus, of a run with a drive


def choose_ports(host: str, base_port: int) -> list[int]:
    """List PORTS ports, those of TCP first: counted from base_port, or free ones where it is 0."""
    if base_port:
        return list(range(base_port, base_port + PORTS))
    return free_ports(host, [k >= TCP_PORTS for k in range(PORTS)])


def endpoints(
    host: str, ports: list[int], folder: Path | None, can: Mapping[str, Any] | None = None
) -> Endpoints:
    """Distribute ports; with a folder, the sockets that are no datagrams are local ones in it.

    can: settings of the field bus.
    """
    names = (*BUS, *STREAMS)
    addresses = {}
    for name, port in zip(names, ports, strict=False):
        local = bus_folder.address(folder, name) if folder else ""
        addresses[name] = local or f"tcp://{host}:{port}"
    datagrams = iter(ports[TCP_PORTS:])
    pairs = {name: DatagramPorts(next(datagrams), next(datagrams)) for name in DATAGRAMS}
    stops = dict(zip(STOPPABLE, datagrams, strict=True))
    return Endpoints(addresses, pairs, stops, can or {})
