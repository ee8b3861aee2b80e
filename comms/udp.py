"""UDP endpoints: non-blocking, bounded, with the kernel's own count of what it dropped."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator

from comms.errors import PortInUse

MAX_DATAGRAM_BYTES = 2048
RECEIVE_BUFFER_BYTES = 1 << 20
DRAIN_LIMIT = 256  # datagrams a pass: a flood may not starve the deadline
_SO_RXQ_OVFL = 40  # Linux: ancillary count of datagrams dropped for a full receive buffer
_COUNT = struct.Struct("<I")


class UdpSender:
    """Sends datagrams to one address; a full queue is counted by the caller, not waited for."""

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, data: bytes) -> bool:
        """False when the system would not take the datagram."""
        try:
            self._socket.sendto(data, self._address)
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()


class UdpReceiver:
    """Receives datagrams on one port. kernel_drops: what the kernel says it threw away for want of room."""

    def __init__(self, host: str, port: int, channel: str) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise PortInUse(
                f"UDP port {port} on {host} for channel '{channel}': {error.strerror}; "
                "stop what uses it, or set network.base_port to another range (0 = free ports)"
            ) from error
        self.kernel_drops = 0

    @property
    def port(self) -> int:
        """The port bound (useful when asked for port 0)."""
        return int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        """For select."""
        return self._socket.fileno()

    def drain(self) -> Iterator[bytes]:
        """Datagrams waiting now, oldest first, at most DRAIN_LIMIT."""
        for _ in range(DRAIN_LIMIT):
            try:
                data, ancillary, _, _ = self._socket.recvmsg(MAX_DATAGRAM_BYTES, 64)
            except OSError:
                return
            for level, kind, value in ancillary:
                if level == socket.SOL_SOCKET and kind == _SO_RXQ_OVFL:
                    self.kernel_drops = _COUNT.unpack_from(value)[0]
            yield data

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()


def free_port(host: str, udp: bool = True) -> int:
    """A port nobody uses now."""
    return free_ports(host, [udp])[0]


def free_ports(host: str, udp: list[bool]) -> list[int]:
    """Ports nobody uses now, all different; True asks for a UDP port, False for a TCP port."""
    probes = [
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM if datagrams else socket.SOCK_STREAM)
        for datagrams in udp
    ]
    try:
        for probe in probes:
            probe.bind((host, 0))
        return [int(probe.getsockname()[1]) for probe in probes]
    finally:
        for probe in probes:
            probe.close()


def receive_buffer_bytes(host: str) -> int:
    """What the system grants of the receive buffer we ask for."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((host, 0))
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        return probe.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)


def port_is_free(host: str, port: int, udp: bool = True) -> bool:
    """Whether a port could be bound now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM if udp else socket.SOCK_STREAM) as probe:
        if not udp:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            return False
    return True
