"""What a link does to packets (delay, jitter, loss in bursts) and the ledger that accounts for each one.

Randomness is keyed by (seed, channel, sequence number): wall and virtual time lose the same packets.
"""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from comms.channels import MS

_MASK = 2**64 - 1
FOREIGN = frozenset(
    ("length", "magic", "version", "channel", "session")
)  # reasons that say: no packet of this link and run
WINDOW = 64  # sequence numbers remembered behind the newest


class LinkFaults(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """`[links.NAME]`: what happens to the packets of one channel."""

    delay_ms: Annotated[float, Meta(ge=0, le=10_000)] = 0.0
    jitter_ms: Annotated[float, Meta(ge=0, le=10_000)] = 0.0  # uniform in 0..jitter_ms, may reorder
    loss: Annotated[float, Meta(ge=0, lt=1)] = 0.0  # share of packets lost
    burst: Annotated[int, Meta(ge=1, le=1000)] = 1  # packets lost together


class LinkModel:
    """The fate of each packet of one channel."""

    def __init__(self, faults: LinkFaults, seed: int, channel_id: int) -> None:
        self._delay_ns = round(faults.delay_ms * MS)
        self._jitter_ns = round(faults.jitter_ms * MS)
        self._burst = faults.burst
        self._p = 1.0 - (1.0 - faults.loss) ** (1.0 / faults.burst)
        self._key = _mix(_mix(seed & _MASK) ^ channel_id)

    def delay_ns(self, seq: int) -> int | None:
        """Nanoseconds packet seq is under way, or None: it is lost.

        Packet n is lost if u(seed, link, k) < p for any k in (n - burst, n], p = 1 - (1 - loss)^(1/burst).
        """
        if self._p > 0.0 and any(
            self._uniform(k, 0) < self._p for k in range(seq, seq - self._burst, -1)
        ):
            return None
        if self._jitter_ns == 0:
            return self._delay_ns
        return self._delay_ns + int(self._uniform(seq, 1) * self._jitter_ns)

    def _uniform(self, k: int, stream: int) -> float:
        return _mix(self._key ^ ((2 * k + stream) & _MASK)) / 2.0**64


def _mix(x: int) -> int:
    """SplitMix64 (Steele, Lea, Flood 2014): a 64-bit hash with good avalanche."""
    x = (x + 0x9E3779B97F4A7C15) & _MASK
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & _MASK
    return x ^ (x >> 31)


class LinkCount(msgspec.Struct, kw_only=True):
    """One row of the ledger: sent = delivered + lost + rejected, always; extra copies only in duplicated."""

    sent: int = 0
    delivered: int = 0  # accepted, late ones among them
    lost_link: int = 0  # by the link model
    lost_kernel: int = 0  # by the kernel's own count: no room in the receiver's buffer
    lost_queue: int = 0  # the sender's queue was full
    duplicated: int = 0
    late: int = 0
    rejected: dict[str, int] = msgspec.field(default_factory=dict)

    @property
    def lost(self) -> int:
        """Packets that never arrived, whatever the cause."""
        return self.lost_link + self.lost_kernel + self.lost_queue

    @property
    def unexplained(self) -> int:
        """Zero when the row balances."""
        ours = sum(n for reason, n in self.rejected.items() if reason not in FOREIGN)
        return self.sent - self.delivered - self.lost - ours

    def reject(self, reason: str) -> None:
        """Count one packet that was read and not taken."""
        self.rejected[reason] = self.rejected.get(reason, 0) + 1


def settle(sender: LinkCount, receiver: LinkCount) -> LinkCount:
    """One row from its two ends: each counts what it knows, so whatever nobody counted stays unexplained."""
    return LinkCount(
        sent=sender.sent,
        delivered=receiver.delivered,
        lost_link=sender.lost_link,
        lost_queue=sender.lost_queue,
        lost_kernel=receiver.lost_kernel,
        duplicated=receiver.duplicated,
        late=receiver.late,
        rejected=dict(receiver.rejected),
    )


class SequenceWindow:
    """Takes each sequence number once, newest first: older ones are `old`, copies are `duplicate`."""

    def __init__(self) -> None:
        self._newest = -1
        self._seen = 0  # bit k: newest - k was seen

    def verdict(self, seq: int) -> str | None:
        """None when seq is new, else why it is not taken."""
        ahead = seq - self._newest
        if ahead > 0:
            self._seen = ((self._seen << ahead) | 1) & _MASK if ahead < WINDOW else 1
            self._newest = seq
            return None
        if -ahead >= WINDOW:
            return "old"
        bit = 1 << -ahead
        if self._seen & bit:
            return "duplicate"
        self._seen |= bit
        return "old"
