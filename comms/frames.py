"""Camera frames over ZeroMQ push/pull: header and pixels in two parts; sending never blocks."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec
import numpy as np
import zmq

from comms.codec import Closing, Reject, decode, encode, encode_closing
from comms.errors import PortInUse
from comms.messages import Frame

HIGH_WATER = 4  # frames in the queue; at 50 Hz the fifth would be 80 ms old
MAX_BYTES = 64 * 1024 * 1024  # 4096 x 4096 pixels in colour are 48 MiB
MAX_HEAD_BYTES = 1024
# reasons to reject a datagram that has the channel and the session of this run
OWN_REJECTS = (Reject.NOT_FINITE, Reject.OUT_OF_RANGE)
DRAIN_LIMIT = 8  # frames a call, so that a flood does not delay the deadlines
LINGER_MS = 500
RECONNECT_MS = 5  # the receiver may bind after the sender connects; at 50 Hz the queue lasts 80 ms


class FrameSender:
    """Sender of frames to one receiver; a full queue rejects the frame."""

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        address: str,
        channel: str,
        session: int,
    ) -> None:
        self._socket = context.socket(zmq.PUSH)
        self._socket.setsockopt(zmq.SNDHWM, HIGH_WATER)
        self._socket.setsockopt(zmq.LINGER, LINGER_MS)
        self._socket.setsockopt(zmq.RECONNECT_IVL, RECONNECT_MS)
        self._socket.connect(address)
        self._channel, self._session = channel, session

    def send(self, frame: Frame) -> bool:
        """Send a frame; return False if the queue is full (before the connection too)."""
        head = encode(self._channel, frame, self._session)
        return self._push([head, np.ascontiguousarray(frame.pixels).data])

    def close(self, count: int, t_ns: int) -> None:
        """Send the number of frames sent, then close the socket."""
        self._push([encode_closing(self._channel, count, t_ns, self._session)])
        self._socket.close()

    def _push(self, parts: list[bytes | memoryview]) -> bool:
        try:
            self._socket.send_multipart(parts, zmq.NOBLOCK)
        except zmq.Again:
            return False
        return True


class FrameReceiver:
    """Receiver of frames; pixels are a read-only view of the received buffer.

    foreign: messages that are no datagram of this channel and run.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        address: str,
        channel: str,
        session: int,
    ) -> None:
        self._socket = context.socket(zmq.PULL)
        self._socket.setsockopt(zmq.RCVHWM, HIGH_WATER)
        self._socket.setsockopt(zmq.MAXMSGSIZE, MAX_BYTES)
        self._channel, self._session = channel, session
        self.foreign = 0
        try:
            self._socket.bind(address)
        except zmq.ZMQError as error:
            self._socket.close(0)
            raise PortInUse(
                f"{address} for channel '{channel}': {error}; "
                "stop the process that uses it, or set network.base_port to another range "
                "(0 = free ports)"
            ) from error

    def fileno(self) -> int:
        """Return the file descriptor, for select; edge-triggered, see has_pending."""
        return int(self._socket.getsockopt(zmq.FD))

    def has_pending(self) -> bool:
        """Tell if frames wait that the last drain left."""
        return bool(int(self._socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN)

    def drain(self) -> Iterator[Frame | Closing | Reject]:
        """Yield the frames received so far, oldest first, at most DRAIN_LIMIT."""
        for _ in range(DRAIN_LIMIT):
            try:
                parts = self._socket.recv_multipart(zmq.NOBLOCK, copy=False)
            except zmq.Again:
                return
            item = self._decode([part.buffer for part in parts])
            if item is None:
                self.foreign += 1
            else:
                yield item

    def close(self) -> None:
        """Close the socket."""
        self._socket.close(0)

    def _decode(self, parts: list[memoryview]) -> Frame | Closing | Reject | None:
        """Decode a message; None if it is not from the sender of this channel and run."""
        head = decode(self._channel, bytes(parts[0][:MAX_HEAD_BYTES]), self._session)
        if isinstance(head, Frame):
            return with_pixels(head, parts[1] if len(parts) == 2 else memoryview(b""))
        is_own = head in OWN_REJECTS or isinstance(head, Closing)
        return head if is_own and isinstance(head, Closing | Reject) else None


def with_pixels(head: Frame, data: memoryview) -> Frame | Reject:
    """Join the header and the pixel bytes of a frame, or give the reason to reject them."""
    planes = {"mono8": 1, "bgr8": 3}.get(head.encoding)
    if planes is None:
        return Reject.OUT_OF_RANGE
    if len(data) != head.height * head.width * planes:
        return Reject.LENGTH
    shape = (head.height, head.width) if planes == 1 else (head.height, head.width, 3)
    pixels = np.frombuffer(data.toreadonly(), dtype=np.uint8).reshape(shape)
    return msgspec.structs.replace(head, pixels=pixels)
