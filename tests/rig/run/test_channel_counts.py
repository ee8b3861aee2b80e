"""Ledger of a field bus: frames of others are foreign, missing ones are unaccounted."""

from __future__ import annotations

import pytest

from comms.channels import ALL_TASKS
from comms.link import LinkCount
from rig.run.runtime.channel_counts import ChannelCounts


def settled(channel: str, sent: int, delivered: int) -> LinkCount:
    """Settle one channel of a run with a drive."""
    ends = {"can_down": ("drive", "bench"), "reference": ("streamer", "controller")}[channel]
    counts = ChannelCounts(ALL_TASKS)
    counts.add(channel, ends[0], LinkCount(sent=sent))
    counts.add(channel, ends[1], LinkCount(delivered=delivered))
    return counts.settle(0)[channel]


def test_frames_of_another_master_are_foreign_and_outside_the_sum() -> None:
    count = settled("can_down", sent=100, delivered=137)
    assert (count.delivered, count.foreign, count.unaccounted) == (100, 37, 0)


@pytest.mark.parametrize("channel", ["can_down", "reference"])
def test_what_is_missing_stays_unaccounted(channel: str) -> None:
    count = settled(channel, sent=100, delivered=97)
    assert (count.delivered, count.foreign, count.unaccounted) == (97, 0, 3)


def test_a_datagram_too_many_is_no_frame_of_others() -> None:
    assert settled("reference", sent=100, delivered=101).unaccounted == -1
