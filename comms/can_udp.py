"""Python-can interface `swayless_udp`: a bus of processes on one machine, by UDP unicast.

For machines without multicast. A channel is "127.0.0.1:47300": the bus has NODES ports from there
on. Each bus object binds the first free one and sends every frame to all others. A datagram is
accepted from these ports alone.
"""

from __future__ import annotations

import select
import socket
import struct
from typing import Any

import can

from comms.clock import epoch_now_ns

NODES = 8
LAST_PORT = 65_536 - NODES  # of a channel
RECEIVE_BUFFER_BYTES = 1 << 20
_FRAME = struct.Struct("<IBBd8s")  # identifier, flags, length, time stamp, data
EXTENDED, REMOTE, ERROR = 1, 2, 4


class UdpUnicastBus(can.BusABC):
    """Bus object; raises can.CanInitializationError where no port of the channel is free."""

    def __init__(self, channel: str, **settings: Any) -> None:
        host, _, port = str(channel).partition(":")
        if not port.isdecimal() or not 0 < int(port) <= LAST_PORT:
            raise can.CanInitializationError(
                f"channel {channel!r}; must be host:port, e.g. 127.0.0.1:47300, "
                f"with a port of 1 to {LAST_PORT}"
            )
        ports = range(int(port), int(port) + NODES)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        own = self._bind(host, ports)
        self._others = [(host, other) for other in ports if other != own]
        self._known = frozenset(self._others)
        self._own = settings.pop("receive_own_messages", False)
        self.channel_info = f"swayless_udp {host}:{own}"
        self._can_protocol = can.CanProtocol.CAN_20
        super().__init__(channel, **settings)

    def _bind(self, host: str, ports: range) -> int:
        for port in ports:
            try:
                self._socket.bind((host, port))
            except OSError:
                continue
            return port
        self._socket.close()
        raise can.CanInitializationError(
            f"no free port of {host}:{ports[0]} to {ports[-1]}; "
            "close a program on this bus, or name another channel"
        )

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to every other bus object of the channel."""
        flags = EXTENDED * msg.is_extended_id | REMOTE * msg.is_remote_frame
        flags |= ERROR * msg.is_error_frame
        sent_s = epoch_now_ns() * 1e-9
        data = _FRAME.pack(msg.arbitration_id, flags, msg.dlc, sent_s, bytes(msg.data))
        for address in self._others:
            try:
                self._socket.sendto(data, address)
            except ConnectionRefusedError:  # of an earlier one: nobody is there
                continue
            except OSError as error:
                raise can.CanOperationError(f"the frame was not sent: {error}") from error

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not select.select([self._socket], [], [], timeout)[0]:
            return None, False
        try:
            data, sender = self._socket.recvfrom(_FRAME.size + 1)
        except OSError:
            return None, False
        if sender not in self._known or len(data) != _FRAME.size:
            return None, False
        identifier, flags, length, sent_s, payload = _FRAME.unpack(data)
        if length > 8:
            return None, False
        message = can.Message(
            timestamp=sent_s,
            arbitration_id=identifier,
            is_extended_id=bool(flags & EXTENDED),
            is_remote_frame=bool(flags & REMOTE),
            is_error_frame=bool(flags & ERROR),
            dlc=length,
            data=b"" if flags & REMOTE else payload[:length],
        )
        return message, False

    def fileno(self) -> int:
        """Return the descriptor of the socket, for select."""
        return self._socket.fileno()

    def shutdown(self) -> None:
        """Close the socket."""
        super().shutdown()
        self._socket.close()
