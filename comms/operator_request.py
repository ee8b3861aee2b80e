"""Request to a running operator from another process; imports only the socket library."""

from __future__ import annotations

import zmq


def ask(address: str, request: str, timeout_ms: int) -> str | None:
    """Send a request to the operator at address; return its answer, None if none comes in time."""
    with zmq.Context() as context:
        socket = context.socket(zmq.REQ)
        socket.setsockopt(zmq.LINGER, 0)
        socket.connect(address)
        socket.send(request.encode())
        answer = socket.recv().decode() if socket.poll(timeout_ms) else None
        socket.close(0)
        return answer
