"""Intake of a task: the sockets that it reads, and the wait for them or for a deadline."""

from __future__ import annotations

import select
from collections.abc import Mapping
from typing import Protocol

from comms.channels import CHANNELS, MS
from comms.clock import Clock
from comms.ends import ChannelReceiver

# longest wait, and period of reading all sockets: the edge of a ZeroMQ descriptor can be missed
MAX_WAIT_NS = 50 * MS


class Source(Protocol):
    """Socket whose descriptor wakes the task."""

    def fileno(self) -> int:
        """Return the descriptor, for select."""

    def has_pending(self) -> bool:
        """Tell if data wait that the descriptor does not announce; False if it always does."""


class Intake:
    """Sockets of a task: sources that wake it, and receivers that are read at every wake."""

    def __init__(self, receivers: Mapping[str, ChannelReceiver], clock: Clock) -> None:
        self.polled: list[ChannelReceiver] = []
        self._clock = clock
        self._by_descriptor: dict[int, Source] = {}
        self._read_all_ns = 0
        for name, receiver in receivers.items():
            if CHANNELS[name].wakes:
                self.add(receiver)
            else:
                self.polled.append(receiver)

    def add(self, source: Source) -> None:
        """Add a source that wakes the task."""
        self._by_descriptor[source.fileno()] = source

    def remove(self, source: Source) -> None:
        """Wait no longer for a source."""
        del self._by_descriptor[source.fileno()]

    def wait(self, until_ns: int) -> list[Source]:
        """Wait for data until an instant, at most MAX_WAIT_NS; return the sources to read.

        A drain that ended at its bound left data, which no descriptor announces again.
        """
        now_ns = self._clock.now_ns()
        sources = self._by_descriptor
        pending = [source for source in sources.values() if source.has_pending()]
        timeout_ns = 0
        if not pending:
            timeout_ns = max(0, min(until_ns - now_ns, MAX_WAIT_NS))
        ready = select.select(sources, [], [], timeout_ns * 1e-9)[0]
        if now_ns >= self._read_all_ns:
            self._read_all_ns = now_ns + MAX_WAIT_NS
            return list(sources.values())
        announced = [sources[descriptor] for descriptor in ready]
        return announced + [source for source in pending if source not in announced]
