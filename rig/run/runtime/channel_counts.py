"""Packet counts of the two ends of each channel, and the ledger settled from them."""

from __future__ import annotations

from comms.channels import CHANNELS, DATA
from comms.link import LinkCount, merge_counts


class ChannelCounts:
    """Counts reported by the tasks at both ends of the channels."""

    def __init__(self) -> None:
        self._rows: dict[tuple[str, str], LinkCount] = {}  # channel, task

    def add(self, channel: str, task: str, count: LinkCount) -> None:
        """Keep the count of one end."""
        self._rows[channel, task] = count

    @property
    def uncounted(self) -> list[str]:
        """Ends of channels without a count, as "channel: task"."""
        return [
            f"{channel}: {task}"
            for name in DATA
            for channel, task in _ends(name)
            if (channel, task) not in self._rows
        ]

    def settle(self, truths_recorded: int) -> dict[str, LinkCount]:
        """Settle the channels counted at both ends; `truth` against what the recorder received."""
        settled = {}
        for name in DATA:
            sending, receiving = _ends(name)
            if sending in self._rows and receiving in self._rows:
                settled[name] = merge_counts(self._rows[sending], self._rows[receiving])
        truths_sent = self._rows.get(("truth", "bench"))
        if truths_sent is not None:
            settled["truth"] = merge_counts(truths_sent, LinkCount(delivered=truths_recorded))
        return settled


def _ends(channel: str) -> tuple[tuple[str, str], tuple[str, str]]:
    row = CHANNELS[channel]
    return (channel, row.sender), (channel, row.receiver)
