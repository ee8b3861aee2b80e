"""Short forms of the long trials in endurance/, which `make endurance` runs in full."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from comms.channels import CHANNELS
from comms.layouts import LAYOUTS
from endurance import fuzz, mutants
from endurance.stops import TICK_NS, stop_once

CODED = [name for name, row in CHANNELS.items() if row.message in LAYOUTS]


@pytest.mark.parametrize("channel", CODED)
def test_no_datagram_without_the_session_is_taken(channel: str) -> None:
    outcomes = fuzz.fuzz_channel(channel, 3000, random.Random(2))
    assert outcomes["taken"] == 0
    assert outcomes["refused"] >= 3000


def test_only_the_two_stop_datagrams_stop() -> None:
    assert fuzz.fuzz_stop_port(3000, random.Random(3))["taken"] == 0


def test_junk_on_the_bus_raises_nothing() -> None:
    outcomes = fuzz.fuzz_bus(5000, random.Random(4))
    assert outcomes["understood"] > 0
    assert outcomes["telemetry"] == 0


@pytest.mark.parametrize("seed", range(1, 13))
def test_a_stop_past_the_operator_shows_in_two_ticks_whatever_the_links_lose(
    seed: int, tmp_path: Path
) -> None:
    found = stop_once(seed, tmp_path)
    assert found.arrived_ns is not None
    assert found.phase_ns is not None
    assert 0 <= found.phase_ns - found.arrived_ns <= 2 * TICK_NS


def test_a_mutant_is_one_small_change() -> None:
    source = "def f(a: int = 3) -> bool:\n    '''Text 1.'''\n    return a < 2 and not a + 1 == 0\n"
    changes = [mutant.change for mutant in mutants.mutants(source)]
    assert changes == [
        "3 -> 4",
        "a < 2 and (not a + 1 == 0) -> a < 2 or not a + 1 == 0",
        "a < 2 -> a <= 2",
        "a < 2 -> a >= 2",
        "2 -> 3",
        "not a + 1 == 0 -> a + 1 == 0",
        "a + 1 == 0 -> a + 1 != 0",
        "a + 1 -> a - 1",
        "1 -> 2",
        "0 -> 1",
    ]
