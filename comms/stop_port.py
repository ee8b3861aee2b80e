"""Stop port of a task: a stop order past the operator. Imports no library.

A stop datagram is the key of the run, which stands in `operator.json`, and `stop` or `estop`.
"""

from __future__ import annotations

import hmac
import socket
from contextlib import suppress

from comms.udp import UdpReceiver

HOST = "127.0.0.1"  # whatever the data channels use
KEY_BYTES = 16
REQUESTS = {"stop": 4, "estop": 5}  # exit code of the run


class StopPort:
    """Receiving end; anything but a stop datagram of this run is ignored and counted."""

    def __init__(self, port: int, key: bytes) -> None:
        """Raises PortInUse, and ValueError for a key of another length."""
        if len(key) != KEY_BYTES:
            raise ValueError(f"stop key of {len(key)} bytes; must be {KEY_BYTES} bytes")
        self._orders = {key + request.encode(): request for request in REQUESTS}
        self.ignored = 0
        self._receiver = UdpReceiver(HOST, port, "stop")

    @property
    def port(self) -> int:
        """Bound port; the free one chosen by the system if 0 was requested."""
        return self._receiver.port

    def fileno(self) -> int:
        """Return the descriptor, for select."""
        return self._receiver.fileno()

    def has_pending(self) -> bool:
        """Tell if datagrams wait that select does not announce: none do."""
        return self._receiver.has_pending()

    def drain(self) -> list[str]:
        """Read a bounded number of datagrams; return the stop requests among them."""
        requests: list[str] = []
        for data in self._receiver.drain():
            request = self.request(data)
            if request is None:
                self.ignored += 1
            else:
                requests.append(request)
        return requests

    def close(self) -> None:
        """Close the socket and free the port."""
        self._receiver.close()

    def request(self, data: bytes) -> str | None:
        """Compare a datagram with the two orders, in a time that does not depend on the key."""
        for order, request in self._orders.items():
            if hmac.compare_digest(data, order):
                return request
        return None


def send_stop(port: int, key: bytes, request: str) -> None:
    """Send a stop datagram; one that the system does not accept is lost like any other."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender, suppress(OSError):
        sender.setblocking(False)
        sender.sendto(key + request.encode(), (HOST, port))
