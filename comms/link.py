"""Link model (delay, jitter, loss in bursts) and packet ledger.

The random numbers are keyed by (seed, channel, sequence number): wall and virtual time lose the
same packets.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

import msgspec
from msgspec import Meta

from comms.can_errors import ErrorConfinement
from comms.channels import MS

_MASK = 2**64 - 1
_ATTEMPTS = 0x9D39_247E_3377_6D41  # random numbers of their own
WINDOW_PACKETS = 4096  # sequence numbers stored: at 200 Hz those of 20 s
NEWEST, SUPERSEDED, DUPLICATE, OLD = "", "superseded", "duplicate", "old"  # outcomes of a packet
_WINDOW_MASK = 2**WINDOW_PACKETS - 1


class LinkFaults(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Delay, jitter and loss of the packets of a channel (`[links.NAME]`)."""

    delay_ms: Annotated[float, Meta(ge=0, le=10_000)] = 0.0
    jitter_ms: Annotated[float, Meta(ge=0, le=10_000)] = 0.0  # uniform in 0..jitter_ms, may reorder
    loss: Annotated[float, Meta(ge=0, lt=1)] = 0.0  # share of packets lost
    burst: Annotated[int, Meta(ge=1, le=1000)] = 1  # packets lost in a row
    # share of frames corrupted on a field bus, which repeats them; 1/9 leads to bus-off
    corrupt: Annotated[float, Meta(ge=0, lt=1)] = 0.0


def longest_delay_ns(faults: Iterable[LinkFaults]) -> int:
    """Find the longest delay that the links of a run may add; 0 without any."""
    return round(max((one.delay_ms + one.jitter_ms for one in faults), default=0.0) * MS)


class LinkModel:
    """Model of a link: delay or loss of each packet of a channel."""

    def __init__(self, faults: LinkFaults, seed: int, channel_id: int) -> None:
        self._delay_ns = round(faults.delay_ms * MS)
        self._jitter_ns = round(faults.jitter_ms * MS)
        self._burst = faults.burst
        self._p = 1.0 - (1.0 - faults.loss) ** (1.0 / faults.burst)
        self._key = _mix(_mix(seed & _MASK) ^ channel_id)
        self.confinement: ErrorConfinement | None = None
        if faults.corrupt:
            self.confinement = ErrorConfinement(faults.corrupt, self._attempt)

    def delay_ns(self, seq: int) -> int | None:
        """Compute the delay of packet seq [ns], or None if the packet is lost.

        Packet n is lost if u(seed, link, k) < p for any k in (n - burst, n], with
        p = 1 - (1 - loss)^(1/burst).
        """
        if self._p > 0.0 and self._is_lost(seq):
            return None
        delay_ns = self._delay_ns
        if self._jitter_ns:
            delay_ns += int(self._uniform(seq, 1) * self._jitter_ns)
        if self.confinement is None:
            return delay_ns
        repeated_ns = self.confinement.delay_ns(seq)
        return None if repeated_ns is None else delay_ns + repeated_ns

    def _is_lost(self, seq: int) -> bool:
        return any(self._uniform(k, 0) < self._p for k in range(seq, seq - self._burst, -1))

    def _attempt(self, seq: int, attempt: int) -> float:
        return _mix(_mix(self._key ^ _ATTEMPTS) ^ (seq << 16 | attempt)) / 2.0**64

    def _uniform(self, k: int, stream: int) -> float:
        return _mix(self._key ^ ((2 * k + stream) & _MASK)) / 2.0**64


def _mix(x: int) -> int:
    """Hash a 64-bit number by SplitMix64 (Steele, Lea, Flood 2014)."""
    x = (x + 0x9E3779B97F4A7C15) & _MASK
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & _MASK
    return x ^ (x >> 31)


class LinkCount(msgspec.Struct, kw_only=True):
    """Row of the ledger: sent = delivered + lost + rejected.

    Copies and packets of foreign senders count in duplicated and foreign alone.
    """

    sent: int = 0
    delivered: int = 0  # accepted, including the late and the superseded ones
    lost_link: int = 0  # by the link model
    lost_kernel: int = 0  # receive buffer full, counted by the kernel
    lost_queue: int = 0  # queue of the sender full
    duplicated: int = 0
    late: int = 0
    superseded: int = 0  # overtaken by a newer one, so not used
    foreign: int = 0  # not from the sender of this link
    bus_errors: int = 0  # frames corrupted on a field bus, and repeated
    bus_off: bool = False  # the sender left the field bus after too many of them
    rejected: dict[str, int] = msgspec.field(default_factory=dict)

    @property
    def lost(self) -> int:
        """Number of lost packets, of all causes."""
        return self.lost_link + self.lost_kernel + self.lost_queue

    @property
    def unaccounted(self) -> int:
        """Packets sent - delivered - lost - rejected; 0 if the row balances."""
        return self.sent - self.delivered - self.lost - sum(self.rejected.values())

    def confine(self, confinement: ErrorConfinement | None) -> None:
        """Take the error counters of the sender on a field bus."""
        if confinement is not None:
            self.bus_errors, self.bus_off = confinement.errors, confinement.is_off

    def reject(self, reason: str) -> None:
        """Count a packet that was read and rejected."""
        self.rejected[reason] = self.rejected.get(reason, 0) + 1


def merge_counts(sender: LinkCount, receiver: LinkCount) -> LinkCount:
    """Merge the counts of both ends of a link into one row.

    Each end counts what it observes; a packet that neither counted is unaccounted.
    """
    return LinkCount(
        sent=sender.sent,
        delivered=receiver.delivered,
        lost_link=sender.lost_link,
        lost_queue=sender.lost_queue,
        bus_errors=sender.bus_errors,
        bus_off=sender.bus_off,
        lost_kernel=receiver.lost_kernel,
        duplicated=receiver.duplicated,
        late=receiver.late,
        superseded=receiver.superseded,
        foreign=receiver.foreign,
        rejected=dict(receiver.rejected),
    )


class SequenceWindow:
    """Window of received sequence numbers, the newest and WINDOW_PACKETS - 1 before it."""

    def __init__(self) -> None:
        self._newest = -1
        self._seen = 0  # bit k: newest - k was received

    def register(self, seq: int) -> str:
        """Register a sequence number; return the outcome.

        NEWEST, SUPERSEDED by a newer one, DUPLICATE of one that was received, or OLD: before the
        window, so that nothing tells a copy from a packet that was overtaken.
        """
        ahead = seq - self._newest
        if ahead > 0:
            shifted = self._seen << ahead if ahead < WINDOW_PACKETS else 0
            self._seen = (shifted | 1) & _WINDOW_MASK
            self._newest = seq
            return NEWEST
        if -ahead >= WINDOW_PACKETS:
            return OLD
        bit = 1 << -ahead
        if self._seen & bit:
            return DUPLICATE
        self._seen |= bit
        return SUPERSEDED
