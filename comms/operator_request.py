"""Requests to a running operator from another process; imports only the socket library."""

from __future__ import annotations

from contextlib import suppress

import zmq


class OperatorRequests:
    """Connection to an operator: requests are sent without waiting, answers come in their order."""

    def __init__(self, address: str) -> None:
        """Raises ValueError for an address that is none."""
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.DEALER)
        self._socket.setsockopt(zmq.LINGER, 0)
        try:
            self._socket.connect(address)
        except zmq.ZMQError as error:
            self.close()
            raise ValueError(f"address = {address!r}: {error}") from error

    def send(self, request: str) -> None:
        """Send a request; dropped where too many wait for an operator that does not read."""
        with suppress(zmq.Again):
            self._socket.send_multipart([b"", request.encode()], zmq.NOBLOCK)

    def receive(self, timeout_ms: int) -> str | None:
        """Return the next answer, None if none comes in time."""
        if not self._socket.poll(timeout_ms):
            return None
        return self._socket.recv_multipart()[-1].decode(errors="replace")

    def close(self) -> None:
        """Close the connection."""
        self._socket.close(0)
        self._context.term()
