"""Outbox of a task: packets that wait for their send time."""

from __future__ import annotations

import heapq
from typing import NamedTuple

from comms.ends import ChannelSender
from comms.messages import CanMessage, Frame


class _Packet(NamedTuple):
    """Packet in the outbox; ordered by due_ns, then by order."""

    due_ns: int
    order: int
    sender: ChannelSender
    payload: Frame | CanMessage | bytes


class Outbox:
    """Heap of packets, the earliest send time first; equal times keep their order."""

    def __init__(self) -> None:
        self._packets: list[_Packet] = []
        self._order = 0

    @property
    def due_ns(self) -> int | None:
        """Send time of the next packet [ns]; None if the outbox is empty."""
        return self._packets[0].due_ns if self._packets else None

    def add(self, due_ns: int, sender: ChannelSender, payload: Frame | CanMessage | bytes) -> None:
        """Add a packet to send at due_ns."""
        self._order += 1
        heapq.heappush(self._packets, _Packet(due_ns, self._order, sender, payload))

    def send_due(self, t_ns: int) -> bool:
        """Send the next packet if it is due at t_ns; return False if none is due."""
        if not self._packets or self._packets[0].due_ns > t_ns:
            return False
        packet = heapq.heappop(self._packets)
        packet.sender.send(packet.payload)
        return True
