"""UDP sockets: non-blocking, bounded, with the kernel's count of dropped datagrams."""

from __future__ import annotations

import ipaddress
import socket
import struct
from collections.abc import Iterator

from comms.errors import PortInUse

MAX_DATAGRAM_BYTES = 2048
RECEIVE_BUFFER_BYTES = 1 << 20
DRAIN_LIMIT = 256  # datagrams a call, so that a flood does not delay the deadlines
_SO_RXQ_OVFL = 40  # Linux: ancillary count of datagrams dropped for a full receive buffer
_COUNT = struct.Struct("<I")


class UdpSender:
    """Sender of datagrams from one port to another; never waits for a full queue."""

    def __init__(self, host: str, port: int, own_port: int, channel: str) -> None:
        """port: of the receiver. Raises PortInUse."""
        self._socket = _bound(host, own_port, channel)
        connect(self._socket, (host, port))

    @property
    def port(self) -> int:
        """Bound port."""
        return int(self._socket.getsockname()[1])

    def send(self, data: bytes) -> bool:
        """Send a datagram; return False if the system does not accept it.

        A refusal tells of an earlier datagram that found no receiver; the system then sends the
        next one.
        """
        try:
            self._socket.send(data)
        except ConnectionRefusedError:
            return self._send_again(data)
        except OSError:
            return False
        return True

    def _send_again(self, data: bytes) -> bool:
        try:
            self._socket.send(data)
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class UdpReceiver:
    """Receiver of datagrams on one port, of one sender or of anybody.

    kernel_drops: datagrams dropped for a full receive buffer, counted by the kernel. foreign:
    datagrams of other senders that arrived before the socket was connected to its own; the kernel
    refuses later ones.
    """

    def __init__(self, host: str, port: int, channel: str, sender_port: int | None = None) -> None:
        """sender_port: of the one sender; None for anybody. Raises PortInUse."""
        self._socket = _bound(host, port, channel)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
        self._sender = None if sender_port is None else (host, sender_port)
        if self._sender is not None:
            connect(self._socket, self._sender)
        self.kernel_drops = 0
        self.foreign = 0

    @property
    def port(self) -> int:
        """Bound port; the free one chosen by the system if 0 was requested."""
        return int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        """Return the file descriptor, for select."""
        return self._socket.fileno()

    def has_pending(self) -> bool:
        """Tell if datagrams wait that select does not announce: none do."""
        return False

    def drain(self) -> Iterator[bytes]:
        """Yield the datagrams received so far, oldest first, at most DRAIN_LIMIT."""
        for _ in range(DRAIN_LIMIT):
            try:
                data, ancillary, _, sender = self._socket.recvmsg(MAX_DATAGRAM_BYTES, 64)
            except OSError:
                return
            for level, kind, value in ancillary:
                if level == socket.SOL_SOCKET and kind == _SO_RXQ_OVFL:
                    self.kernel_drops = _COUNT.unpack_from(value)[0]
            if self._sender in (None, sender):
                yield data
            else:
                self.foreign += 1

    def close(self) -> None:
        """Close the socket and free the port."""
        self._socket.close()


def connect(opened: socket.socket, address: tuple[str, int]) -> None:
    """Connect a socket of datagrams: from then on it takes those of this address alone."""
    opened.connect(address)


def _bound(host: str, port: int, channel: str) -> socket.socket:
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.setblocking(False)
    try:
        opened.bind((host, port))
    except OSError as error:
        opened.close()
        raise PortInUse(
            f"UDP port {port} on {host} for channel '{channel}': {error.strerror}; "
            "stop the process that uses it, or set network.base_port to another range "
            "(0 = free ports)"
        ) from error
    return opened


def is_loopback(address: str) -> bool:
    """Tell if an address is one that only this machine can reach."""
    try:
        return ipaddress.IPv4Address(address).is_loopback
    except ValueError:
        return False


def free_port(host: str, udp: bool = True) -> int:
    """Find a free port."""
    return free_ports(host, [udp])[0]


def free_ports(host: str, udp: list[bool]) -> list[int]:
    """Find free ports, all different; udp: True for a UDP port, False for a TCP port."""
    probes = [_open_socket(datagrams) for datagrams in udp]
    try:
        for probe in probes:
            probe.bind((host, 0))
        return [int(probe.getsockname()[1]) for probe in probes]
    finally:
        for probe in probes:
            probe.close()


def receive_buffer_bytes(host: str) -> int:
    """Return the receive buffer granted for a request of RECEIVE_BUFFER_BYTES [bytes]."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((host, 0))
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        return probe.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)


def port_is_free(host: str, port: int, udp: bool = True) -> bool:
    """Check if a port can be bound."""
    with _open_socket(udp) as probe:
        if not udp:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            return False
    return True


def _open_socket(udp: bool) -> socket.socket:
    kind = socket.SOCK_DGRAM if udp else socket.SOCK_STREAM
    return socket.socket(socket.AF_INET, kind)
