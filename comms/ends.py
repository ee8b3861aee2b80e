"""The two ends of a channel on the wall clock: sockets, faults, and exactly one counter for each packet."""

from __future__ import annotations

from typing import Any

import msgspec

from comms.channels import CHANNELS, MS, Transport
from comms.clock import Clock
from comms.codec import Closing, Reject, decode, encode_closing
from comms.frames import FrameReceiver, FrameSender
from comms.link import LinkCount, LinkFaults, LinkModel, SequenceWindow
from comms.messages import Frame, Message, Reference
from comms.operator_bus import Context
from comms.udp import UdpReceiver, UdpSender

CLOSINGS = 3  # copies of the closing datagram


class Wiring(msgspec.Struct, frozen=True, kw_only=True):
    """Where a task's channels go; made by the operator, handed over on standard input."""

    session: int
    seed: int
    zero_ns: int
    host: str
    ports: dict[str, int]
    commands: str
    taps: str
    pictures: str
    faults: dict[str, LinkFaults] = {}
    pictures_hz: float = 2.0
    priority: int = 0  # SCHED_FIFO to ask for, 1..99; 0 = ordinary


class Out:
    """The sending end of a channel."""

    def __init__(self, name: str, wiring: Wiring, context: Context) -> None:
        self.name, self._session = name, wiring.session
        self.count = LinkCount()
        self._on_wire = 0
        faults = wiring.faults.get(name)
        self._model = LinkModel(faults, wiring.seed, CHANNELS[name].id) if faults else None
        self._endpoint: Any
        if CHANNELS[name].transport is Transport.UDP:
            self._endpoint = UdpSender(wiring.host, wiring.ports[name])
        else:
            self._endpoint = FrameSender(
                context, wiring.host, wiring.ports[name], name, wiring.session
            )

    def fate(self, seq: int) -> int | None:
        """Delay of a packet [ns], or None: lost. Counts it as sent."""
        self.count.sent += 1
        delay_ns = self._model.delay_ns(seq) if self._model else 0
        self.count.lost_link += delay_ns is None
        return delay_ns

    def send(self, payload: Frame | bytes) -> None:
        """Put it on the wire now."""
        taken = self._endpoint.send(payload)
        self._on_wire += taken
        self.count.lost_queue += not taken

    def close(self, t_ns: int) -> None:
        """Tell the receiver how much was put on the wire."""
        if isinstance(self._endpoint, UdpSender):
            for _ in range(CLOSINGS):
                self._endpoint.send(encode_closing(self.name, self._on_wire, t_ns, self._session))
            self._endpoint.close()
        else:
            self._endpoint.close(self._on_wire, t_ns)


class In:
    """The receiving end of a channel."""

    def __init__(self, name: str, wiring: Wiring, context: Context) -> None:
        self.name, self._session = name, wiring.session
        self.count = LinkCount()
        self.receipts: list[tuple[int, int, str]] = []
        self.closed = False
        self._window = SequenceWindow()
        self._late_ns = round(CHANNELS[name].late_after_ms * MS)
        faults = wiring.faults.get(name)
        self.delay_ns = round((faults.delay_ms + faults.jitter_ms) * MS) if faults else 0
        self.endpoint: UdpReceiver | FrameReceiver
        if CHANNELS[name].transport is Transport.UDP:
            self.endpoint = UdpReceiver(wiring.host, wiring.ports[name], name)
        else:
            self.endpoint = FrameReceiver(
                context, wiring.host, wiring.ports[name], name, wiring.session
            )

    def fileno(self) -> int:
        """For select."""
        return self.endpoint.fileno()

    def read(self, clock: Clock) -> list[Message]:
        """Messages that arrived and are to be believed; everything is counted."""
        taken = []
        for item in self.endpoint.drain():
            got = decode(self.name, item, self._session) if isinstance(item, bytes) else item
            message = admit(
                got, self._window, self.count, self._late_ns, clock.now_ns(), self.receipts
            )
            if message is not None:
                taken.append(message)
            elif isinstance(got, Closing):
                self.closed = True
        if isinstance(self.endpoint, UdpReceiver):
            self.count.lost_kernel = self.endpoint.kernel_drops
        return taken


def admit(
    got: Message | Closing | Reject,
    window: SequenceWindow,
    count: LinkCount,
    late_ns: int,
    t_ns: int,
    receipts: list[tuple[int, int, str]],
) -> Message | None:
    """The one gate every received packet passes: exactly one counter goes up, and a receipt is written."""
    if isinstance(got, Closing):
        return None
    if isinstance(got, Reject):
        count.reject(got.value)
        return None
    outcome = window.verdict(got.seq)
    receipts.append((got.seq, t_ns, outcome or ""))
    if outcome == "duplicate":
        count.duplicated += 1
        return None
    if outcome is not None:
        count.reject(outcome)
        return None
    count.delivered += 1
    count.late += t_ns - (got.t_target_ns if isinstance(got, Reference) else got.t_ns) > late_ns
    return got
