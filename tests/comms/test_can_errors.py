"""Fault confinement on a field bus: repetitions, the error counter, and bus-off."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from comms.can_errors import BUS_OFF, REPEAT_NS, ErrorConfinement
from comms.link import LinkFaults, LinkModel


def confinement(*corrupted: Sequence[bool]) -> ErrorConfinement:
    """Confinement that corrupts these attempts of these frames; further attempts are good."""

    def draw(seq: int, attempt: int) -> float:
        attempts = corrupted[seq] if seq < len(corrupted) else ()
        return 0.0 if attempt < len(attempts) and attempts[attempt] else 1.0

    return ErrorConfinement(0.5, draw)


def test_a_good_frame_is_not_delayed() -> None:
    assert confinement().delay_ns(0) == 0


def test_a_corrupted_frame_is_repeated_until_it_is_good() -> None:
    bus = confinement([True, True, True])
    assert bus.delay_ns(0) == 3 * REPEAT_NS
    assert (bus.errors, bus.counter) == (3, 3 * 8 - 1)


def test_good_frames_lower_the_counter_to_zero_and_no_further() -> None:
    bus = confinement([True])
    bus.delay_ns(0)
    counters = []
    for seq in range(1, 10):
        bus.delay_ns(seq)
        counters.append(bus.counter)
    assert counters == [6, 5, 4, 3, 2, 1, 0, 0, 0]


def test_thirty_two_errors_in_a_row_are_bus_off_and_nothing_is_sent_any_more() -> None:
    bus = confinement([True] * 40)
    assert bus.delay_ns(0) is None
    assert (bus.is_off, bus.errors, bus.counter) == (True, 32, BUS_OFF)
    assert bus.delay_ns(1) is None


@pytest.mark.parametrize(("share", "goes_off"), [(0.05, False), (0.2, True)])
def test_a_ninth_of_corrupted_frames_divides_a_bus_that_lives_from_one_that_does_not(
    share: float, goes_off: bool
) -> None:
    model = LinkModel(LinkFaults(corrupt=share), seed=3, channel_id=11)
    delays = [model.delay_ns(seq) for seq in range(20_000)]
    assert model.confinement is not None
    assert model.confinement.is_off is goes_off
    assert (delays[-1] is None) is goes_off


@given(st.floats(0.01, 0.1), st.integers(0, 2**32))
def test_equal_seeds_corrupt_the_same_frames(share: float, seed: int) -> None:
    twins = [LinkModel(LinkFaults(corrupt=share), seed, 11) for _ in range(2)]
    first, second = ([model.delay_ns(seq) for seq in range(200)] for model in twins)
    assert first == second


def test_corruption_and_loss_draw_their_own_numbers() -> None:
    lossy = LinkModel(LinkFaults(loss=0.3), seed=5, channel_id=11)
    both = LinkModel(LinkFaults(loss=0.3, corrupt=0.05), seed=5, channel_id=11)
    assert [lossy.delay_ns(k) is None for k in range(500)] == [
        both.delay_ns(k) is None for k in range(500)
    ]
