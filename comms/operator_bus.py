"""Operator bus: control socket (request/reply), telemetry socket and picture socket.

A task connects to the sockets of the operator and needs no port of its own. Its identity on the
bus is its name and the session of the run: what comes under another one is foreign, but for the
requests of another terminal. Every part is JSON or a datagram of the codec; no received data is
executed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress

import msgspec
import zmq

from comms.bus_content import (
    HELLO,
    PICTURE_PARTS,
    REPLY,
    STREAM_END,
    TELEMETRY_PARTS,
    Content,
    Request,
    StreamEnd,
    TaskRecord,
    decode_control,
    decode_telemetry,
)
from comms.errors import PortInUse
from comms.messages import Command, Reply

TELEMETRY_HIGH_WATER = 1000  # batches, each of up to 50 ms of a task's messages
PICTURE_HIGH_WATER = 2  # pictures are dropped first
DRAIN_LIMIT = 64  # messages of a socket a call, so that a flood delays neither stop nor tick
# bytes of a part; a larger one ends the connection before it is read
MAX_COMMAND_BYTES = 1 << 20
MAX_TELEMETRY_BYTES = 1 << 16
MAX_PICTURE_BYTES = 64 << 20
LINGER_MS = 1000
CLOSE_LINGER_MS = 200  # of the operator's end
Context = zmq.Context[zmq.Socket[bytes]]

_encode = msgspec.json.encode


def identity(task: str, session: int) -> bytes:
    """Return the identity of a task on the bus of a run."""
    return f"{task}:{session:016x}".encode()


class TaskBus:
    """Task end: receives commands and heartbeats, sends replies, records and telemetry."""

    def __init__(
        self, context: Context, task: str, session: int, addresses: Mapping[str, str]
    ) -> None:
        """addresses: of `commands`, `telemetry` and `pictures`."""
        self._identity = identity(task, session)
        self._commands = context.socket(zmq.DEALER)
        self._telemetry = context.socket(zmq.PUSH)
        self._pictures = context.socket(zmq.PUSH)
        self._commands.setsockopt(zmq.IDENTITY, self._identity)
        self._telemetry.setsockopt(zmq.SNDHWM, TELEMETRY_HIGH_WATER)
        self._pictures.setsockopt(zmq.SNDHWM, PICTURE_HIGH_WATER)
        for socket, address in (
            (self._commands, addresses["commands"]),
            (self._telemetry, addresses["telemetry"]),
            (self._pictures, addresses["pictures"]),
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
        self._commands.send_multipart([HELLO])

    def end_streams(self) -> None:
        """Send the end of stream on the telemetry and the control socket."""
        self.flush_telemetry()
        with suppress(zmq.Again):
            self._telemetry.send_multipart([STREAM_END, self._identity], zmq.NOBLOCK)
        self._commands.send_multipart([STREAM_END])

    def reply(self, reply: Reply) -> None:
        """Send a reply to the operator."""
        self._commands.send_multipart([REPLY, _encode(reply)])

    def record(self, record: TaskRecord) -> None:
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
    """Operator end.

    foreign: messages of no task of this run.
    """

    def __init__(
        self, context: Context, tasks: Collection[str], session: int, addresses: Mapping[str, str]
    ) -> None:
        """Bind the sockets. Raises PortInUse."""
        self._identities = {task: identity(task, session) for task in tasks}
        self._tasks = {known: task for task, known in self._identities.items()}
        self.foreign = 0
        self._commands = context.socket(zmq.ROUTER)
        self._telemetry = context.socket(zmq.PULL)
        self._pictures = context.socket(zmq.PULL)
        self._telemetry.setsockopt(zmq.RCVHWM, TELEMETRY_HIGH_WATER)
        self._pictures.setsockopt(zmq.RCVHWM, PICTURE_HIGH_WATER)
        self._commands.setsockopt(zmq.MAXMSGSIZE, MAX_COMMAND_BYTES)
        self._telemetry.setsockopt(zmq.MAXMSGSIZE, MAX_TELEMETRY_BYTES)
        self._pictures.setsockopt(zmq.MAXMSGSIZE, MAX_PICTURE_BYTES)
        try:
            _bind(self._commands, addresses["commands"])
            _bind(self._telemetry, addresses["telemetry"])
            _bind(self._pictures, addresses["pictures"])
        except PortInUse:
            self.close()
            raise

    def send(self, command: Command) -> None:
        """Send a command to a task; dropped if the task has not sent anything before."""
        self._commands.send_multipart([self._identities[command.to], _encode(command)])

    def heartbeat(self, task: str) -> None:
        """Send a heartbeat to a task."""
        self._commands.send_multipart([self._identities[task], b""])

    def answer(self, client: bytes, text: str) -> None:
        """Answer the request of another terminal."""
        self._commands.send_multipart([client, b"", text.encode()])

    def wait(self, timeout_ms: int) -> None:
        """Wait until something arrives, at most timeout_ms."""
        zmq.select([self._commands, self._telemetry, self._pictures], [], [], timeout_ms / 1000)

    def drain(self) -> Iterator[tuple[str, Content | Request]]:
        """Yield (task, message) of what arrived; the task of telemetry and requests is empty.

        At most DRAIN_LIMIT messages of each socket; the next call goes on.
        """
        yield from self._drain_telemetry(self._telemetry, TELEMETRY_PARTS)
        yield from self._drain_telemetry(self._pictures, PICTURE_PARTS)
        yield from self._drain_commands()

    def close(self) -> None:
        """Close the sockets and free the ports."""
        for socket in (self._commands, self._telemetry, self._pictures):
            socket.close(CLOSE_LINGER_MS)

    def _drain_commands(self) -> Iterator[tuple[str, Content | Request]]:
        for _ in range(DRAIN_LIMIT):
            try:
                sender, *parts = self._commands.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            message = decode_control(parts)
            task = self._tasks.get(sender)
            if isinstance(message, str):
                yield "", Request(sender, message)
            elif message is None or task is None:
                self.foreign += 1
            else:
                yield task, message

    def _drain_telemetry(
        self, socket: zmq.Socket[bytes], parts_each: int
    ) -> Iterator[tuple[str, Content]]:
        """Yield what arrived on a telemetry or picture socket, at most DRAIN_LIMIT messages.

        A multipart message holds several copies of parts_each parts: channel, datagram and, for a
        picture, the pixels.
        """
        for _ in range(DRAIN_LIMIT):
            try:
                parts = socket.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            if parts[0] == STREAM_END and len(parts) == 2 and parts[1] in self._tasks:
                yield self._tasks[parts[1]], StreamEnd("telemetry")
                continue
            for k in range(0, len(parts), parts_each):
                telemetry = decode_telemetry(parts[k : k + parts_each], parts_each)
                if telemetry is None:
                    self.foreign += 1
                else:
                    yield "", telemetry


def _bind(socket: zmq.Socket[bytes], address: str) -> None:
    try:
        socket.bind(address)
    except zmq.ZMQError as error:
        raise PortInUse(
            f"{address} for the operator's bus: {error}; "
            "stop the process that uses it, or set network.base_port to another range "
            "(0 = free ports)"
        ) from error
