"""Loss and delay of a link, and the balance of the ledger."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comms import link
from comms.codec import Reject
from comms.link import (
    LinkCount,
    LinkFaults,
    LinkModel,
    SequenceWindow,
    merge_counts,
)

UNTIMED = settings(deadline=None)  # a busy machine is no failure
MS = 1_000_000
PACKETS = 20_000
LOSSES = [(0.01, 1), (0.2, 1), (0.7, 1), (0.05, 3), (0.3, 5), (0.5, 20)]
SPLITMIX64 = (  # the published sequence for the seed 1234567
    *(6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431),
    16408922859458223821,
)
faults = st.builds(
    LinkFaults,
    delay_ms=st.floats(0, 100),
    jitter_ms=st.floats(0, 100),
    loss=st.floats(0, 0.95),
    burst=st.integers(1, 8),
)
seqs = st.integers(0, 2**32 - 1)


def lost(model: LinkModel, packets: int = PACKETS) -> list[bool]:
    """Loss of each packet."""
    return [model.delay_ns(seq) is None for seq in range(packets)]


def test_the_hash_is_splitmix64() -> None:
    golden_gamma = 0x9E3779B97F4A7C15  # increment of the generator's state; the hash adds it once
    states = ((1234567 + k * golden_gamma) % 2**64 for k in range(5))
    assert tuple(link._mix(state) for state in states) == SPLITMIX64


@UNTIMED
@given(faults, st.integers(-(2**70), 2**70), st.integers(1, 10), st.lists(seqs, max_size=20))
def test_delay_and_loss_of_a_packet_depend_on_seed_channel_and_number_alone(
    configured: LinkFaults, seed: int, channel_id: int, order: list[int]
) -> None:
    model = LinkModel(configured, seed, channel_id)
    in_this_order = {seq: model.delay_ns(seq) for seq in order}
    assert {
        seq: LinkModel(configured, seed, channel_id).delay_ns(seq) for seq in reversed(order)
    } == in_this_order


def test_other_seeds_and_other_channels_lose_other_packets() -> None:
    configured = LinkFaults(loss=0.5)
    patterns = {
        tuple(lost(LinkModel(configured, seed, channel), 64))
        for seed in range(-5, 5)
        for channel in range(1, 11)
    }
    assert len(patterns) == 100


@pytest.mark.parametrize(("loss", "burst"), LOSSES)
def test_the_share_of_lost_packets_is_the_configured_one(loss: float, burst: int) -> None:
    """A packet is kept if none of `burst` draws is a loss.

    Packets at lag k share draws, which correlates them; the variance is exact.
    """
    keep = (1 - loss) ** (1 / burst)
    covariances = [keep ** (burst + lag) - (1 - loss) ** 2 for lag in range(burst)]
    sigma = math.sqrt(
        (covariances[0] + 2 * sum(covariances[1:])) / PACKETS
    )  # burst = 1: the binomial's
    share = sum(lost(LinkModel(LinkFaults(loss=loss, burst=burst), 7, 3))) / PACKETS
    assert share == pytest.approx(loss, abs=4 * sigma)


@pytest.mark.parametrize(("loss", "burst"), LOSSES)
def test_losses_come_in_bursts_of_the_configured_length(loss: float, burst: int) -> None:
    """A run of losses begins with a loss after a kept packet, probability (1 - loss) p.

    Its mean length is therefore loss / ((1 - loss) p).
    """
    p = 1 - (1 - loss) ** (1 / burst)
    losses = lost(LinkModel(LinkFaults(loss=loss, burst=burst), 11, 4))
    runs = [len(list(run)) for is_lost, run in itertools.groupby(losses) if is_lost]
    runs = runs[1:-1]  # the outer ones may be cut
    assert min(runs) >= burst
    mean = loss / ((1 - loss) * p)
    sigma = math.sqrt(sum((n - mean) ** 2 for n in runs)) / len(runs)
    assert sum(runs) / len(runs) == pytest.approx(mean, abs=4 * sigma)


@UNTIMED
@given(faults, st.integers(0, 2**32), seqs)
def test_a_packet_is_late_by_the_delay_and_at_most_the_jitter_more(
    configured: LinkFaults, seed: int, seq: int
) -> None:
    delay_ns = LinkModel(configured, seed, 5).delay_ns(seq)
    if delay_ns is not None:
        low, high = (
            round(configured.delay_ms * MS),
            round(configured.delay_ms * MS) + round(configured.jitter_ms * MS),
        )
        assert low <= delay_ns <= high


@pytest.mark.parametrize("loss", [0.0, 0.3])
def test_jitter_is_uniform_over_its_width_whatever_is_lost(loss: float) -> None:
    model = LinkModel(LinkFaults(delay_ms=3, jitter_ms=8, loss=loss), 1, 1)
    delays = (model.delay_ns(seq) for seq in range(PACKETS))
    shares = sorted((delay_ns - 3 * MS) / (8 * MS) for delay_ns in delays if delay_ns is not None)
    gap = max(abs(share - (k + 0.5) / len(shares)) for k, share in enumerate(shares))
    assert gap < 1.95 / math.sqrt(len(shares))  # Kolmogorov-Smirnov, 0.1 %


@pytest.mark.parametrize("loss", [0.05, 0.5, 0.95])
@pytest.mark.parametrize("burst", [1, 7])
def test_the_delay_of_a_packet_is_the_same_whatever_is_lost(loss: float, burst: int) -> None:
    """Loss and jitter draw from streams of their own: a loss takes packets, and moves none."""
    lossless = LinkModel(LinkFaults(jitter_ms=8), 5, 2)
    lossy = LinkModel(LinkFaults(jitter_ms=8, loss=loss, burst=burst), 5, 2)
    kept = [seq for seq in range(2000) if lossy.delay_ns(seq) is not None]
    assert 0 < len(kept) < 2000
    assert all(lossy.delay_ns(seq) == lossless.delay_ns(seq) for seq in kept)


@pytest.mark.parametrize(("loss", "burst"), [(0.5, 1), (0.9, 1), (0.9, 4)])
def test_the_delays_of_the_packets_that_survive_are_uniform(loss: float, burst: int) -> None:
    """One stream for both would leave them the long delays alone: those above the threshold."""
    model = LinkModel(LinkFaults(jitter_ms=8, loss=loss, burst=burst), 3, 6)
    delays = (model.delay_ns(seq) for seq in range(PACKETS))
    shares = sorted(delay_ns / (8 * MS) for delay_ns in delays if delay_ns is not None)
    gap = max(abs(share - (k + 0.5) / len(shares)) for k, share in enumerate(shares))
    assert gap < 1.95 / math.sqrt(len(shares))  # Kolmogorov-Smirnov, 0.1 %


def test_jitter_does_not_choose_which_packets_are_lost() -> None:
    plain, late = LinkFaults(loss=0.3), LinkFaults(loss=0.3, delay_ms=5, jitter_ms=40)
    assert lost(LinkModel(plain, 2, 9), 2000) == lost(LinkModel(late, 2, 9), 2000)


def test_without_faults_everything_arrives_at_once() -> None:
    assert {LinkModel(LinkFaults(), 3, 3).delay_ns(seq) for seq in range(1000)} == {0}


# around the end of the window too: 4096 numbers, those of 20 s at 200 Hz
numbers_around = st.one_of(st.integers(0, 300), st.integers(4000, 4200), st.integers(8100, 8300))


@UNTIMED
@given(st.lists(numbers_around, max_size=200))
def test_a_number_is_the_newest_or_overtaken_or_a_copy_or_before_the_window(
    arrivals: list[int],
) -> None:
    window, seen, newest = SequenceWindow(), set[int](), -1
    for seq in arrivals:
        if seq > newest:
            expected = ""
        elif newest - seq >= 4096:
            expected = "old"
        else:
            expected = "duplicate" if seq in seen else "superseded"
        assert window.register(seq) == expected
        seen.add(seq)
        newest = max(newest, seq)


@UNTIMED
@given(st.sets(seqs, min_size=1, max_size=50))
def test_increasing_numbers_are_all_accepted_whatever_their_distance(numbers: set[int]) -> None:
    window = SequenceWindow()
    assert [window.register(seq) for seq in sorted(numbers)] == [""] * len(numbers)


def test_a_number_from_the_far_past_is_old_and_so_is_its_copy() -> None:
    window = SequenceWindow()
    assert [window.register(seq) for seq in (2**32 - 1, 0, 0, 2**32 - 1)] == [
        "",
        "old",
        "old",
        "duplicate",
    ]


def test_a_copy_of_a_packet_that_is_not_the_newest_is_a_duplicate() -> None:
    window = SequenceWindow()
    assert [window.register(seq) for seq in range(10)] == [""] * 10
    assert [window.register(seq) for seq in (3, 0, 9, 3)] == ["duplicate"] * 4


def test_a_packet_that_was_overtaken_is_superseded_once_and_then_a_copy() -> None:
    window = SequenceWindow()
    arrivals = [window.register(seq) for seq in (0, 1, 4, 3, 3, 2, 5, 4)]
    assert arrivals == ["", "", "", "superseded", "duplicate", "superseded", "", "duplicate"]


@pytest.mark.parametrize("jump", [1, 4095, 4096, 4097, 2**31])
def test_a_jump_forgets_what_is_before_the_window_and_nothing_else(jump: int) -> None:
    window = SequenceWindow()
    assert [window.register(seq) for seq in (10, 10 + jump)] == ["", ""]
    assert window.register(10) == ("duplicate" if jump < 4096 else "old")
    assert window.register(10 + jump) == "duplicate"


outcomes = st.sampled_from(
    [
        *("delivered", "late", "overtaken", "copied"),
        *("crc", "old", "lost_link", "lost_queue", "lost_kernel"),
    ]
)


@UNTIMED
@given(st.lists(outcomes, max_size=60))
def test_the_ledger_balances_for_any_mix_of_outcomes(packets: list[str]) -> None:
    sender, receiver = LinkCount(), LinkCount()
    for outcome in packets:
        sender.sent += 1
        sender.lost_link += outcome == "lost_link"
        sender.lost_queue += outcome == "lost_queue"
        receiver.delivered += outcome in ("delivered", "late", "overtaken", "copied")
        receiver.late += outcome == "late"
        receiver.superseded += outcome == "overtaken"
        receiver.duplicated += outcome == "copied"
        receiver.lost_kernel += outcome == "lost_kernel"
        if outcome in ("crc", "old"):
            receiver.reject(outcome)
    row = merge_counts(sender, receiver)
    assert row.unaccounted == 0
    assert row.lost_kernel == packets.count("lost_kernel")
    assert row.lost == sum(outcome.startswith("lost") for outcome in packets)
    assert row.sent == len(packets)
    assert (row.late, row.duplicated) == (packets.count("late"), packets.count("copied"))
    assert row.superseded == packets.count("overtaken")
    assert row.rejected == {
        reason: packets.count(reason) for reason in ("crc", "old") if reason in packets
    }


@UNTIMED
@given(st.integers(0, 50), st.integers(1, 5))
def test_foreign_packets_are_counted_and_do_not_unbalance_the_ledger(
    sent: int, foreign: int
) -> None:
    row = merge_counts(LinkCount(sent=sent), LinkCount(delivered=sent, foreign=foreign))
    assert (row.unaccounted, row.foreign, row.rejected) == (0, foreign, {})


@pytest.mark.parametrize(
    "reason", [*(r.value for r in Reject), "old", "a reason of a later version"]
)
def test_a_rejected_packet_of_the_own_sender_is_in_the_sum_whatever_the_reason(reason: str) -> None:
    sender, receiver = LinkCount(sent=5), LinkCount(delivered=3)
    receiver.reject(reason)
    assert merge_counts(sender, receiver).unaccounted == 1
    receiver.reject(reason)
    row = merge_counts(sender, receiver)
    assert (row.unaccounted, row.rejected) == (0, {reason: 2})


def test_a_packet_that_no_end_counted_is_unaccounted() -> None:
    row = merge_counts(LinkCount(sent=9, lost_link=1), LinkCount(delivered=5, superseded=4))
    assert row.unaccounted == 3


def test_merging_leaves_both_counts_unchanged() -> None:
    sender, receiver = LinkCount(sent=3), LinkCount(delivered=1, rejected={"crc": 1})
    merge_counts(sender, receiver).reject("crc")
    assert (sender, receiver) == (LinkCount(sent=3), LinkCount(delivered=1, rejected={"crc": 1}))
