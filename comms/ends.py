"""Ends of a channel on the wall clock: socket, link faults and the packet counters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import msgspec

from comms.channels import CHANNELS, MS, TASKS, Transport
from comms.clock import Clock
from comms.codec import Closing, Reject, decode, encode_closing
from comms.endpoints import DatagramPorts
from comms.frames import FrameReceiver, FrameSender
from comms.link import (
    DUPLICATE,
    OLD,
    SUPERSEDED,
    LinkCount,
    LinkFaults,
    LinkModel,
    SequenceWindow,
)
from comms.messages import CanMessage, Frame, Message, Reference
from comms.operator_bus import Context
from comms.udp import UdpReceiver, UdpSender

if TYPE_CHECKING:
    from comms.can_bus import CanEnd

CLOSING_COPIES = 3  # of the closing datagram, which may be lost
OPERATOR_SILENT_NS = 2_000 * MS  # longest silence of the operator, for tasks that move nothing
ORPHAN_NS = 800 * MS  # from the loss of the operator to the exit, beside the time of the stop


class Wiring(msgspec.Struct, frozen=True, kw_only=True):
    """Addresses, ports and link faults of a task, sent by the operator on standard input."""

    session: int
    seed: int
    zero_ns: int
    host: str
    ports: dict[str, DatagramPorts]  # by channel
    addresses: dict[str, str]  # of the sockets of the bus, and of the channels without ports
    tasks: tuple[str, ...] = TASKS  # of the run
    can: dict[str, Any] = {}  # settings of the field bus (comms/can_bus.py)
    faults: dict[str, LinkFaults] = {}
    pictures_hz: float = 2.0
    priority: int = 0  # requested SCHED_FIFO priority, 1..99; 0 = normal scheduling
    operator_silent_ns: int = OPERATOR_SILENT_NS  # then the task stops, and exits after orphan_ns
    orphan_ns: int = ORPHAN_NS
    stop_ports: dict[str, int] = {}  # by task
    stop_key: str = ""  # hexadecimal


class ChannelSender:
    """Sending end of a channel."""

    def __init__(self, name: str, wiring: Wiring, context: Context) -> None:
        self.name = name
        self.count = LinkCount()
        self._session = wiring.session
        self._sent_count = 0  # packets that the socket accepted
        self._is_in_order = CHANNELS[name].transport is Transport.CAN
        self._last_due_ns = 0
        faults = wiring.faults.get(name)
        self._model = LinkModel(faults, wiring.seed, CHANNELS[name].id) if faults else None
        self._socket: Any
        if CHANNELS[name].transport is Transport.UDP:
            ports = wiring.ports[name]
            self._socket = UdpSender(wiring.host, ports.receiver, ports.sender, name)
        elif CHANNELS[name].transport is Transport.CAN:
            self._socket = _can_end(wiring)
        else:
            self._socket = FrameSender(context, wiring.addresses[name], name, wiring.session)

    def due_ns(self, seq: int, at_ns: int) -> int | None:
        """Count a packet as sent; return when it leaves by the link model, or None if lost.

        On a field bus no frame of a sender overtakes another.
        """
        delay_ns = self.apply_link(seq)
        if delay_ns is None:
            return None
        due_ns = at_ns + delay_ns
        if self._is_in_order:
            due_ns = self._last_due_ns = max(due_ns, self._last_due_ns)
        return due_ns

    def apply_link(self, seq: int) -> int | None:
        """Count a packet as sent; return its delay by the link model [ns], or None if lost."""
        self.count.sent += 1
        if self._model is None:
            return 0
        delay_ns = self._model.delay_ns(seq)
        self.count.confine(self._model.confinement)
        self.count.lost_link += delay_ns is None
        return delay_ns

    def send(self, payload: Frame | CanMessage | bytes) -> None:
        """Send a packet now; one that the socket does not accept is counted as lost."""
        accepted = self._socket.send(payload)
        self._sent_count += accepted
        self.count.lost_queue += not accepted

    def close(self, t_ns: int) -> None:
        """Send the number of packets sent to the receiver, then close the socket."""
        if isinstance(self._socket, UdpSender):
            closing = encode_closing(self.name, self._sent_count, t_ns, self._session)
            for _ in range(CLOSING_COPIES):
                self._socket.send(closing)
            self._socket.close()
        elif isinstance(self._socket, FrameSender):
            self._socket.close(self._sent_count, t_ns)


class ChannelReceiver:
    """Receiving end of a channel."""

    def __init__(self, name: str, wiring: Wiring, context: Context) -> None:
        self.name = name
        self.count = LinkCount()
        self.receipts: list[tuple[int, int, str]] = []
        self.closed = False  # the sender's closing message arrived
        self._session = wiring.session
        self._window = SequenceWindow()
        self._late_ns = round(CHANNELS[name].late_after_ms * MS)
        faults = wiring.faults.get(name)
        self.max_delay_ns = round((faults.delay_ms + faults.jitter_ms) * MS) if faults else 0
        self.socket: UdpReceiver | FrameReceiver | CanEnd
        if CHANNELS[name].transport is Transport.UDP:
            ports = wiring.ports[name]
            self.socket = UdpReceiver(wiring.host, ports.receiver, name, ports.sender)
        elif CHANNELS[name].transport is Transport.CAN:
            self.socket = _can_end(wiring)
        else:
            self.socket = FrameReceiver(context, wiring.addresses[name], name, wiring.session)

    def fileno(self) -> int:
        """Return the file descriptor, for select."""
        return self.socket.fileno()

    def has_pending(self) -> bool:
        """Tell if packets wait that the last read left and select does not announce."""
        return self.socket.has_pending()

    def _items(self, clock: Clock) -> Iterator[bytes | Message | Closing | Reject]:
        if isinstance(self.socket, UdpReceiver | FrameReceiver):
            return self.socket.drain()
        return self.socket.drain(clock, of_nodes=self.name == "can_up")

    def read(self, clock: Clock) -> list[Message]:
        """Read the packets that arrived; count each, return the messages that are accepted."""
        accepted = []
        for item in self._items(clock):
            got = decode(self.name, item, self._session) if isinstance(item, bytes) else item
            message = admit(
                got, self._window, self.count, self._late_ns, clock.now_ns(), self.receipts
            )
            if message is not None:
                accepted.append(message)
            elif isinstance(got, Closing):
                self.closed = True
        if isinstance(self.socket, UdpReceiver):
            self.count.lost_kernel = self.socket.kernel_drops
        self.count.foreign = self.socket.foreign
        return accepted


def _can_end(wiring: Wiring) -> CanEnd:
    """Open the bus for both directions; python-can is imported where a run has a drive."""
    from comms.can_bus import CanSettings, shared

    return shared(msgspec.convert(wiring.can, CanSettings))


def admit(
    got: Message | Closing | Reject,
    window: SequenceWindow,
    count: LinkCount,
    late_ns: int,
    t_ns: int,
    receipts: list[tuple[int, int, str]],
) -> Message | None:
    """Accept or reject a received packet; return the message if it is the newest.

    Exactly one of delivered, duplicated and rejected increases, and a decoded message gets a
    receipt. A closing message changes nothing. late counts delivered messages older than late_ns,
    superseded those that a newer one overtook.
    """
    if isinstance(got, Closing):
        return None
    if isinstance(got, Reject):
        count.reject(got.value)
        return None
    outcome = window.register(got.seq)
    receipts.append((got.seq, t_ns, outcome))
    if outcome == DUPLICATE:
        count.duplicated += 1
        return None
    if outcome == OLD:
        count.reject(outcome)
        return None
    count.delivered += 1
    due_ns = got.t_target_ns if isinstance(got, Reference) else got.t_ns
    count.late += t_ns - due_ns > late_ns
    if outcome == SUPERSEDED:
        count.superseded += 1
        return None
    return got
