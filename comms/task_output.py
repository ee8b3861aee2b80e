"""Output of a task: its data channels behind the link model, and the copies for the log."""

from __future__ import annotations

import select
from collections.abc import Sequence

from comms.channels import sent_by
from comms.clock import Clock
from comms.codec import encode
from comms.ends import ChannelSender, Wiring
from comms.link import LinkCount
from comms.messages import CanMessage, Frame, Message, Reply
from comms.operator_bus import Context, TaskBus
from comms.outbox import Outbox
from comms.task import Send


class TaskOutput:
    """Senders of a task with the queue before them; every message is copied to the telemetry."""

    def __init__(
        self, task: str, wiring: Wiring, context: Context, bus: TaskBus, clock: Clock
    ) -> None:
        self._wiring = wiring
        self._bus = bus
        self._clock = clock
        self._senders = {
            name: ChannelSender(name, wiring, context) for name in sent_by(task, wiring.tasks)
        }
        self._outbox = Outbox()
        self._operator_counts: dict[str, LinkCount] = {}  # of channels to the operator
        self._picture_ns: dict[str, int] = {}  # by channel: end of exposure of the next in the log

    @property
    def due_ns(self) -> int | None:
        """Send time of the next packet [ns]; None if none waits."""
        return self._outbox.due_ns

    @property
    def counts(self) -> dict[str, LinkCount]:
        """Counts of the sent messages by channel."""
        return {name: sender.count for name, sender in self._senders.items()}

    @property
    def operator_counts(self) -> dict[str, LinkCount]:
        """Counts of the messages to the operator by channel."""
        return self._operator_counts

    def take(self, sends: Sequence[Send]) -> None:
        """Send replies at once, and queue data until their send time and link delay."""
        for channel, message, at_ns in sends:
            if isinstance(message, Reply):
                self._bus.reply(message)
            elif channel in self._senders:
                self._queue(self._senders[channel], message, at_ns)
            else:  # truth: to the operator only
                self._operator_counts.setdefault(channel, LinkCount()).sent += 1
                self._bus.add_telemetry(channel, encode(channel, message, self._wiring.session))

    def send_due(self) -> None:
        """Send the packets that are due."""
        while self._outbox.send_due(self._clock.now_ns()):
            pass

    def flush(self) -> None:
        """Wait for the send time of all queued packets and send them."""
        while (due_ns := self._outbox.due_ns) is not None:
            select.select([], [], [], max(0, due_ns - self._clock.now_ns()) * 1e-9)
            self.send_due()

    def close(self) -> None:
        """Send the closing counts and close the sockets of the senders."""
        for sender in self._senders.values():
            sender.close(self._clock.now_ns())

    def _queue(self, sender: ChannelSender, message: Message, at_ns: int) -> None:
        data = encode(sender.name, message, self._wiring.session)
        self._bus.add_telemetry(sender.name, data)
        frame = message if isinstance(message, Frame) else None
        if frame is not None:
            self._send_picture(sender.name, frame, data)
        due_ns = sender.due_ns(message.seq, at_ns)
        if due_ns is not None:
            direct = message if isinstance(message, Frame | CanMessage) else data
            self._outbox.add(due_ns, sender, direct)

    def _send_picture(self, channel: str, frame: Frame, data: bytes) -> None:
        """Send a frame with its pixels to the log, at most pictures_hz times a second a camera."""
        if self._wiring.pictures_hz > 0 and frame.t_ns >= self._picture_ns.get(channel, 0):
            self._picture_ns[channel] = frame.t_ns + round(1e9 / self._wiring.pictures_hz)
            self._bus.picture(channel, data, frame.pixels.tobytes())
