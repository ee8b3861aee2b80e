"""Operator bus: control socket (request/reply), telemetry socket and picture socket.

A task connects to the sockets of the operator and needs no port of its own. Every part is JSON or
a datagram of the codec; no received data is executed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Literal, NamedTuple

import msgspec
import zmq

from comms.channels import CHANNELS
from comms.errors import PortInUse
from comms.layouts import LAYOUTS
from comms.messages import Command, Reply
from comms.records import Event, LinkRow, Receipts, TaskTiming

TELEMETRY_HIGH_WATER = 1000  # batches, each of up to 50 ms of a task's messages
PICTURE_HIGH_WATER = 2  # pictures are dropped first
DRAIN_LIMIT = 64  # messages of a socket a call, so that a flood delays neither stop nor tick
LINGER_MS = 1000
CLOSE_LINGER_MS = 200  # of the operator's end
TELEMETRY_PARTS = 2  # channel, datagram
PICTURE_PARTS = 3  # channel, datagram, pixels
Context = zmq.Context[zmq.Socket[bytes]]

_RECORDS: dict[str, type] = {kind.__name__: kind for kind in (Receipts, TaskTiming, LinkRow, Event)}
_HELLO = b"hello"
_REPLY = b"reply"
_STREAM_END = b"farewell"
_encode = msgspec.json.encode


class Telemetry(NamedTuple):
    """Copy of a sent message for the log; pixels only on the picture socket."""

    channel: str
    data: bytes
    pixels: bytes | None


class Hello(NamedTuple):
    """Notice that the sockets of a task are open; it waits for the first heartbeat."""


class StreamEnd(NamedTuple):
    """End of stream on the control or the telemetry socket of a task; each ends on its own."""

    socket: Literal["control", "telemetry"]


class Record(NamedTuple):
    """Record of a task for the log."""

    record: Receipts | TaskTiming | LinkRow | Event


class TaskBus:
    """Task end: receives commands and heartbeats, sends replies, records and telemetry."""

    def __init__(
        self, context: Context, task: str, commands: str, telemetry: str, pictures: str
    ) -> None:
        self._name = task.encode()
        self._commands = context.socket(zmq.DEALER)
        self._telemetry = context.socket(zmq.PUSH)
        self._pictures = context.socket(zmq.PUSH)
        self._commands.setsockopt(zmq.IDENTITY, self._name)
        self._telemetry.setsockopt(zmq.SNDHWM, TELEMETRY_HIGH_WATER)
        self._pictures.setsockopt(zmq.SNDHWM, PICTURE_HIGH_WATER)
        for socket, address in (
            (self._commands, commands),
            (self._telemetry, telemetry),
            (self._pictures, pictures),
        ):
            socket.setsockopt(zmq.LINGER, LINGER_MS)
            socket.connect(address)
        self._batch: list[bytes] = []  # channel, datagram, channel, datagram ...
        self.dropped_telemetry = 0
        self.dropped_pictures = 0

    def fileno(self) -> int:
        """Return the descriptor of the control socket, for select; edge-triggered: drain it."""
        return int(self._commands.getsockopt(zmq.FD))

    def has_pending(self) -> bool:
        """Tell if commands wait that the last drain left."""
        return bool(int(self._commands.getsockopt(zmq.EVENTS)) & zmq.POLLIN)

    def drain(self) -> Iterator[Command | None]:
        """Yield the commands received so far, at most DRAIN_LIMIT; None is a heartbeat."""
        for _ in range(DRAIN_LIMIT):
            try:
                data = self._commands.recv(zmq.NOBLOCK)
            except zmq.Again:
                return
            yield msgspec.json.decode(data, type=Command) if data else None

    def hello(self) -> None:
        """Notify the operator that the sockets of this task are open."""
        self._commands.send_multipart([_HELLO])

    def end_streams(self) -> None:
        """Send the end of stream on the telemetry and the control socket."""
        self.flush_telemetry()
        with suppress(zmq.Again):
            self._telemetry.send_multipart([_STREAM_END, self._name], zmq.NOBLOCK)
        self._commands.send_multipart([_STREAM_END])

    def reply(self, reply: Reply) -> None:
        """Send a reply to the operator."""
        self._commands.send_multipart([_REPLY, _encode(reply)])

    def record(self, record: Receipts | TaskTiming | LinkRow | Event) -> None:
        """Send a record for the log; never dropped."""
        self._commands.send_multipart([type(record).__name__.encode(), _encode(record)])

    def add_telemetry(self, channel: str, data: bytes) -> None:
        """Add the copy of a sent message to the batch of the next flush_telemetry."""
        self._batch += (channel.encode(), data)

    def flush_telemetry(self) -> None:
        """Send the batch of telemetry; drop and count it if the queue is full."""
        if not self._batch:
            return
        try:
            self._telemetry.send_multipart(self._batch, zmq.NOBLOCK)
        except zmq.Again:
            self.dropped_telemetry += len(self._batch) // TELEMETRY_PARTS
        self._batch = []

    def picture(self, channel: str, data: bytes, pixels: bytes) -> None:
        """Send a picture for the log; drop and count it if the queue is full."""
        try:
            self._pictures.send_multipart([channel.encode(), data, pixels], zmq.NOBLOCK)
        except zmq.Again:
            self.dropped_pictures += 1

    def close(self) -> None:
        """Close the sockets after the delivery of what was sent, within LINGER_MS."""
        for socket in (self._commands, self._telemetry, self._pictures):
            socket.close()


class OperatorBus:
    """Operator end; its addresses are passed to the tasks."""

    def __init__(self, context: Context, host: str, port: int = 0) -> None:
        """Bind port, port + 1 and port + 2, or free ports if port is 0."""
        self._commands = context.socket(zmq.ROUTER)
        self._telemetry = context.socket(zmq.PULL)
        self._pictures = context.socket(zmq.PULL)
        self._telemetry.setsockopt(zmq.RCVHWM, TELEMETRY_HIGH_WATER)
        self._pictures.setsockopt(zmq.RCVHWM, PICTURE_HIGH_WATER)
        try:
            self.commands = _bind(self._commands, host, port)
            self.telemetry = _bind(self._telemetry, host, port and port + 1)
            self.pictures = _bind(self._pictures, host, port and port + 2)
        except PortInUse:
            self.close()
            raise

    def send(self, command: Command) -> None:
        """Send a command to a task; dropped if the task has not sent anything before."""
        self._commands.send_multipart([command.to.encode(), _encode(command)])

    def heartbeat(self, task: str) -> None:
        """Send a heartbeat to a task."""
        self._commands.send_multipart([task.encode(), b""])

    def answer(self, client: bytes, text: str) -> None:
        """Answer the request of another terminal."""
        self._commands.send_multipart([client, b"", text.encode()])

    def wait(self, timeout_ms: int) -> None:
        """Wait until something arrives, at most timeout_ms."""
        zmq.select([self._commands, self._telemetry, self._pictures], [], [], timeout_ms / 1000)

    def drain(self) -> Iterator[tuple[bytes, Hello | StreamEnd | Reply | Record | Telemetry | str]]:
        """Yield (sender, message) of what arrived; a str is a request of another terminal.

        At most DRAIN_LIMIT messages of each socket; the next call goes on.
        """
        yield from _drain_telemetry(self._telemetry, TELEMETRY_PARTS)
        yield from _drain_telemetry(self._pictures, PICTURE_PARTS)
        yield from self._drain_commands()

    def close(self) -> None:
        """Close the sockets and free the ports."""
        for socket in (self._commands, self._telemetry, self._pictures):
            socket.close(CLOSE_LINGER_MS)

    def _drain_commands(self) -> Iterator[tuple[bytes, Hello | StreamEnd | Reply | Record | str]]:
        for _ in range(DRAIN_LIMIT):
            try:
                sender, *parts = self._commands.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            message = _decode(parts)
            if message is not None:
                yield sender, message


def _decode(parts: list[bytes]) -> Hello | StreamEnd | Reply | Record | str | None:
    """Decode the parts of a message on the control socket; None if they are invalid."""
    try:
        if parts == [_HELLO]:
            return Hello()
        if parts == [_STREAM_END]:
            return StreamEnd("control")
        if len(parts) == 2 and parts[0] == b"":
            return parts[1].decode()
        if len(parts) == 2 and parts[0] == _REPLY:
            return msgspec.json.decode(parts[1], type=Reply)
        if len(parts) == 2 and parts[0].decode() in _RECORDS:
            kind = _RECORDS[parts[0].decode()]
            return Record(msgspec.json.decode(parts[1], type=kind))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    return None


def _drain_telemetry(
    socket: zmq.Socket[bytes], parts_each: int
) -> Iterator[tuple[bytes, StreamEnd | Telemetry]]:
    """Yield what arrived on a telemetry or picture socket, at most DRAIN_LIMIT messages.

    A multipart message holds several copies of parts_each parts: channel, datagram and, for a
    picture, the pixels.
    """
    for _ in range(DRAIN_LIMIT):
        try:
            parts = socket.recv_multipart(zmq.NOBLOCK)
        except zmq.Again:
            return
        if parts[0] == _STREAM_END and len(parts) == 2:
            yield parts[1], StreamEnd("telemetry")
            continue
        for k in range(0, len(parts) - parts_each + 1, parts_each):
            channel = parts[k].decode("ascii", "replace")
            if channel in CHANNELS and CHANNELS[channel].message in LAYOUTS:
                pixels = parts[k + 2] if parts_each == PICTURE_PARTS else None
                yield b"", Telemetry(channel, parts[k + 1], pixels)


def _bind(socket: zmq.Socket[bytes], host: str, port: int) -> str:
    try:
        socket.bind(f"tcp://{host}:{port or '*'}")
    except zmq.ZMQError as error:
        raise PortInUse(
            f"TCP port {port} on {host} for the operator's bus: {error}; "
            "stop the process that uses it, or set network.base_port to another range "
            "(0 = free ports)"
        ) from error
    return bytes(socket.getsockopt(zmq.LAST_ENDPOINT)).rstrip(b"\0").decode()
