"""Stop port of a task: a stop order past the operator. Imports no library.

A stop datagram is the key of the run, which stands in `operator.json`, and `stop` or `estop`.
"""

from __future__ import annotations

import hmac
import socket
from contextlib import suppress

from comms.errors import PortInUse

HOST = "127.0.0.1"  # whatever the data channels use
KEY_BYTES = 16
DRAIN_LIMIT = 64  # datagrams a call
MAX_BYTES = 64
REQUESTS = {"stop": 4, "estop": 5}  # exit code of the run


class StopPort:
    """Receiving end; anything but a stop datagram of this run is ignored and counted."""

    def __init__(self, port: int, key: bytes) -> None:
        """Raises PortInUse, and ValueError for a key of another length."""
        if len(key) != KEY_BYTES:
            raise ValueError(f"stop key of {len(key)} bytes; must be {KEY_BYTES} bytes")
        self._orders = {key + request.encode(): request for request in REQUESTS}
        self.ignored = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((HOST, port))
        except OSError as error:
            self._socket.close()
            raise PortInUse(
                f"UDP port {port} on {HOST} for stop orders: {error.strerror}; "
                "stop the process that uses it, or set network.base_port to another range "
                "(0 = free ports)"
            ) from error

    @property
    def port(self) -> int:
        """Bound port; the free one chosen by the system if 0 was requested."""
        return int(self._socket.getsockname()[1])

    def fileno(self) -> int:
        """Return the descriptor, for select."""
        return self._socket.fileno()

    def has_pending(self) -> bool:
        """Tell if datagrams wait that select does not announce: none do."""
        return False

    def drain(self) -> list[str]:
        """Read at most DRAIN_LIMIT datagrams; return the stop requests among them."""
        requests: list[str] = []
        for _ in range(DRAIN_LIMIT):
            try:
                data = self._socket.recv(MAX_BYTES)
            except OSError:
                break
            request = self._request(data)
            if request is None:
                self.ignored += 1
            else:
                requests.append(request)
        return requests

    def close(self) -> None:
        """Close the socket and free the port."""
        self._socket.close()

    def _request(self, data: bytes) -> str | None:
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
