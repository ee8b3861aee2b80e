"""Port numbers of the operator's bus, of the data channels and of the stop ports."""

from __future__ import annotations

from typing import NamedTuple

from comms.channels import CHANNELS, DATA, Transport
from comms.udp import free_ports
from rig.run.config import BUS_PORTS, STOPPABLE


class Ports(NamedTuple):
    """Ports of a run: by channel, and by task."""

    channels: dict[str, int]
    stops: dict[str, int]


def choose_ports(host: str, base_port: int) -> Ports:
    """Choose the ports: counted from base_port, or free ones where it is 0."""
    is_udp = [CHANNELS[name].transport is Transport.UDP for name in DATA]
    is_udp += [True] * len(STOPPABLE)
    if base_port:
        first = base_port + BUS_PORTS
        ports = list(range(first, first + len(is_udp)))
    else:
        ports = free_ports(host, is_udp)
    channels = dict(zip(DATA, ports[: len(DATA)], strict=True))
    return Ports(channels, dict(zip(STOPPABLE, ports[len(DATA) :], strict=True)))
