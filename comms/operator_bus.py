"""The operator's wires: commands and replies (request/reply), taps of every message, pictures apart.

Tasks call out to the operator, so a task needs no port of its own for this. Every part is JSON or a datagram of the
codec; nothing that arrives is executed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

import msgspec
import zmq

from comms.channels import CHANNELS
from comms.codec import LAYOUTS
from comms.errors import PortInUse
from comms.messages import Command, Reply
from comms.records import Event, LinkRow, Receipts, TaskTiming

TAP_HIGH_WATER = 1000  # batches, each of up to 50 ms of a task's messages
PICTURE_HIGH_WATER = 2  # pictures are the first to be dropped
LINGER_MS = 1000
Context = zmq.Context[zmq.Socket[bytes]]

_RECORDS: dict[str, type] = {kind.__name__: kind for kind in (Receipts, TaskTiming, LinkRow, Event)}
_encode = msgspec.json.encode


class Telemetry(NamedTuple):
    """A message of a channel as its sender put it on the wire (pixels only with a picture)."""

    channel: str
    data: bytes
    pixels: bytes | None


class Hello(NamedTuple):
    """A task's sockets are open; it waits for the first heartbeat."""


class StreamEnd(NamedTuple):
    """A task has said all it has to say on one of its wires; taps and words travel apart and end apart."""

    wire: str  # "words" or "taps"


class Record(NamedTuple):
    """A task's own record for the log."""

    record: Receipts | TaskTiming | LinkRow | Event


class TaskBus:
    """A task's end: receives commands and heartbeats, sends replies, records and taps."""

    def __init__(
        self, context: Context, task: str, commands: str, taps: str, pictures: str
    ) -> None:
        self._commands = context.socket(zmq.DEALER)
        self._name = task.encode()
        self._commands.setsockopt(zmq.IDENTITY, self._name)
        self._taps, self._pictures = context.socket(zmq.PUSH), context.socket(zmq.PUSH)
        self._taps.setsockopt(zmq.SNDHWM, TAP_HIGH_WATER)
        self._pictures.setsockopt(zmq.SNDHWM, PICTURE_HIGH_WATER)
        for socket, address in (
            (self._commands, commands),
            (self._taps, taps),
            (self._pictures, pictures),
        ):
            socket.setsockopt(zmq.LINGER, LINGER_MS)
            socket.connect(address)
        self._tapped: list[bytes] = []  # channel, datagram, channel, datagram ...
        self.dropped_taps = 0
        self.dropped_pictures = 0

    def fileno(self) -> int:
        """For select; edge-triggered, so drain until nothing is left."""
        return int(self._commands.getsockopt(zmq.FD))

    def drain(self) -> Iterator[Command | None]:
        """Commands waiting now; None is a heartbeat."""
        while True:
            try:
                data = self._commands.recv(zmq.NOBLOCK)
            except zmq.Again:
                return
            yield msgspec.json.decode(data, type=Command) if data else None

    def hello(self) -> None:
        """Our sockets are open."""
        self._commands.send_multipart([b"hello"])

    def farewell(self) -> None:
        """Everything is said, and everything is tapped."""
        self.flush_taps()
        with suppress(zmq.Again):
            self._taps.send_multipart([b"farewell", self._name], zmq.NOBLOCK)
        self._commands.send_multipart([b"farewell"])

    def reply(self, reply: Reply) -> None:
        """Answer the operator."""
        self._commands.send_multipart([b"reply", _encode(reply)])

    def record(self, record: Receipts | TaskTiming | LinkRow | Event) -> None:
        """Something for the log that must not be lost."""
        self._commands.send_multipart([type(record).__name__.encode(), _encode(record)])

    def tap(self, channel: str, data: bytes) -> None:
        """A message just sent, for the log; it leaves with the next flush_taps."""
        self._tapped += (channel.encode(), data)

    def flush_taps(self) -> None:
        """Send what was tapped; dropped and counted when the operator cannot follow."""
        if not self._tapped:
            return
        try:
            self._taps.send_multipart(self._tapped, zmq.NOBLOCK)
        except zmq.Again:
            self.dropped_taps += len(self._tapped) // 2
        self._tapped = []

    def picture(self, channel: str, data: bytes, pixels: bytes) -> None:
        """A picture for the log, on a queue of its own that drops first."""
        try:
            self._pictures.send_multipart([channel.encode(), data, pixels], zmq.NOBLOCK)
        except zmq.Again:
            self.dropped_pictures += 1

    def close(self) -> None:
        """Give the sockets back, after what was said is delivered."""
        for socket in (self._commands, self._taps, self._pictures):
            socket.close()


class OperatorBus:
    """The operator's end; addresses are handed to the tasks."""

    def __init__(self, context: Context, host: str, port: int = 0) -> None:
        """port 0 takes free ports; else port, port + 1 and port + 2."""
        self._commands = context.socket(zmq.ROUTER)
        self._taps, self._pictures = context.socket(zmq.PULL), context.socket(zmq.PULL)
        self._taps.setsockopt(zmq.RCVHWM, TAP_HIGH_WATER)
        self._pictures.setsockopt(zmq.RCVHWM, PICTURE_HIGH_WATER)
        try:
            self.commands = _bind(self._commands, host, port)
            self.taps = _bind(self._taps, host, port and port + 1)
            self.pictures = _bind(self._pictures, host, port and port + 2)
        except PortInUse:
            self.close()
            raise

    def send(self, command: Command) -> None:
        """To a task that has spoken before; to others it goes nowhere."""
        self._commands.send_multipart([command.to.encode(), _encode(command)])

    def heartbeat(self, task: str) -> None:
        """Tell a task that the operator lives."""
        self._commands.send_multipart([task.encode(), b""])

    def answer(self, client: bytes, text: str) -> None:
        """Answer a second terminal."""
        self._commands.send_multipart([client, b"", text.encode()])

    def wait(self, timeout_ms: int) -> None:
        """Return when something arrives, or after timeout_ms."""
        zmq.select([self._commands, self._taps, self._pictures], [], [], timeout_ms / 1000)

    def drain(self) -> Iterator[tuple[bytes, Hello | StreamEnd | Reply | Record | Telemetry | str]]:
        """What tasks and terminals said, with who said it; a str is a request of a second terminal."""
        yield from _drain_taps(self._taps, parts_each=2)
        yield from _drain_taps(self._pictures, parts_each=3)
        yield from self._drain_commands()

    def close(self) -> None:
        """Give the ports back."""
        for socket in (self._commands, self._taps, self._pictures):
            socket.close(200)

    def _drain_commands(self) -> Iterator[tuple[bytes, Hello | StreamEnd | Reply | Record | str]]:
        while True:
            try:
                who, *parts = self._commands.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            said = _understand(parts)
            if said is not None:
                yield who, said


def _understand(parts: list[bytes]) -> Hello | StreamEnd | Reply | Record | str | None:
    try:
        if parts == [b"hello"]:
            return Hello()
        if parts == [b"farewell"]:
            return StreamEnd("words")
        if len(parts) == 2 and parts[0] == b"":
            return parts[1].decode()
        if len(parts) == 2 and parts[0] == b"reply":
            return msgspec.json.decode(parts[1], type=Reply)
        if len(parts) == 2 and parts[0].decode() in _RECORDS:
            return Record(msgspec.json.decode(parts[1], type=_RECORDS[parts[0].decode()]))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    return None


def _drain_taps(
    socket: zmq.Socket[bytes], parts_each: int
) -> Iterator[tuple[bytes, StreamEnd | Telemetry]]:
    """Taps are channel and datagram, pictures have their pixels as a third part; several may come in one message."""
    while True:
        try:
            parts = socket.recv_multipart(zmq.NOBLOCK)
        except zmq.Again:
            return
        if parts[0] == b"farewell" and len(parts) == 2:
            yield parts[1], StreamEnd("taps")
            continue
        for k in range(0, len(parts) - parts_each + 1, parts_each):
            channel = parts[k].decode("ascii", "replace")
            if channel in CHANNELS and CHANNELS[channel].message in LAYOUTS:
                yield (
                    b"",
                    Telemetry(channel, parts[k + 1], parts[k + 2] if parts_each == 3 else None),
                )


def _bind(socket: zmq.Socket[bytes], host: str, port: int) -> str:
    try:
        socket.bind(f"tcp://{host}:{port or '*'}")
    except zmq.ZMQError as error:
        raise PortInUse(
            f"TCP port {port} on {host} for the operator's bus: {error}; "
            "stop what uses it, or set network.base_port to another range (0 = free ports)"
        ) from error
    return bytes(socket.getsockopt(zmq.LAST_ENDPOINT)).rstrip(b"\0").decode()
