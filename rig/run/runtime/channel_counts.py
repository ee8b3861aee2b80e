"""Packet counts of the two ends of each channel, and the ledger settled from them."""

from __future__ import annotations

from collections.abc import Collection

from comms.channels import CHANNELS, Transport, data_channels, ends
from comms.link import LinkCount, merge_counts


class ChannelCounts:
    """Counts reported by the tasks at both ends of the channels."""

    def __init__(self, tasks: Collection[str]) -> None:
        """tasks: of the run."""
        self._tasks = tasks
        self._rows: dict[tuple[str, str], LinkCount] = {}  # channel, task

    def add(self, channel: str, task: str, count: LinkCount) -> None:
        """Keep the count of one end."""
        self._rows[channel, task] = count

    @property
    def uncounted(self) -> list[str]:
        """Ends of channels without a count, as "channel: task"."""
        return [
            f"{channel}: {task}"
            for name in data_channels(self._tasks)
            for channel, task in self._ends(name)
            if (channel, task) not in self._rows
        ]

    def settle(self, truths_recorded: int) -> dict[str, LinkCount]:
        """Settle the channels counted at both ends; `truth` against what the recorder received."""
        settled = {}
        for name in data_channels(self._tasks):
            sending, receiving = self._ends(name)
            if sending in self._rows and receiving in self._rows:
                settled[name] = merge_counts(self._rows[sending], self._rows[receiving])
                if CHANNELS[name].transport is Transport.CAN:
                    _leave_out_others(settled[name])
        truths_sent = self._rows.get(("truth", "bench"))
        if truths_sent is not None:
            settled["truth"] = merge_counts(truths_sent, LinkCount(delivered=truths_recorded))
        return settled

    def _ends(self, channel: str) -> tuple[tuple[str, str], tuple[str, str]]:
        sender, receiver = ends(channel, self._tasks)
        return (channel, sender), (channel, receiver)


def _leave_out_others(count: LinkCount) -> None:
    """Count what arrived beyond what was sent as foreign: others may speak on a field bus.

    A frame does not name its sender, so a loss that another's frame makes up for is not seen.
    """
    beyond = max(0, -count.unaccounted)
    count.delivered -= beyond
    count.foreign += beyond
