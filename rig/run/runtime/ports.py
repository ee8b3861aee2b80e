"""Port numbers of the operator's bus and of the data channels."""

from __future__ import annotations

from comms.channels import CHANNELS, DATA, Transport
from comms.udp import free_ports
from rig.run.config import BUS_PORTS


def channel_ports(host: str, base_port: int) -> dict[str, int]:
    """Choose a port for each data channel: counted from base_port, or free ones where it is 0."""
    if base_port:
        return {name: base_port + BUS_PORTS + i for i, name in enumerate(DATA)}
    is_udp = [CHANNELS[name].transport is Transport.UDP for name in DATA]
    return dict(zip(DATA, free_ports(host, is_udp), strict=True))
