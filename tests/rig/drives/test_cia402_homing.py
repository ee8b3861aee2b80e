"""Homing on the end switches and at the actual position."""

import itertools

import pytest

from tests.rig.drives.cia402_bench import NodeBench

ENABLED, START, HALT = 0x0F, 0x10, 0x100
IN_PROGRESS, NOT_STARTED, ATTAINED = 0x0000, 0x0400, 0x1400
MOVING_ATTAINED, FAILED = 0x1000, 0x2400
FAST, SLOW, RATE = 2000, 100, 20_000


def homing(method, **options):
    bench = NodeBench(negative_end=-200.0, positive_end=300.0, **options).enable(6)
    bench.write(0x6098, method)
    bench.write(0x6099, FAST, 1)
    bench.write(0x6099, SLOW, 2)
    bench.write(0x609A, RATE)
    bench.run(1)
    return bench


def progress(bench):
    return bench.status & 0x3400


def run_to_end(bench):
    demands = []
    while progress(bench) in (IN_PROGRESS, MOVING_ATTAINED):
        demands += bench.run(1)
        assert len(demands) < 20_000
    return demands


@pytest.mark.parametrize(("method", "end", "side"), [(17, -200.0, 1), (18, 300.0, -1)])
@pytest.mark.parametrize("start", [0.0, -205.0, 305.0])
def test_homing_finds_the_edge_of_its_switch_from_anywhere(method, end, side, start):
    bench = homing(method)
    bench.command(0x07)
    bench.position = start
    bench.run(1)
    bench.command(ENABLED)
    assert progress(bench) == NOT_STARTED
    bench.command(ENABLED | START)
    assert progress(bench) == IN_PROGRESS
    demands = run_to_end(bench)
    assert progress(bench) == ATTAINED
    home = bench.position - bench.read(0x6064, signed=True)  # encoder at user position 0
    assert abs(home - end) <= SLOW * 1e-3 + 0.5
    assert 0 <= side * (bench.position - end) <= SLOW * 1e-3 + SLOW**2 / (2 * RATE) + 1
    changes = [abs(b.velocity - a.velocity) for a, b in itertools.pairwise(demands)]
    assert max(changes) <= RATE * 1e-3 * (1 + 1e-9)
    assert max(abs(d.velocity) for d in demands) <= FAST
    assert bench.node.state.name == "OPERATION_ENABLED"
    assert bench.emergencies() == []


@pytest.mark.parametrize("method", [35, 37])
@pytest.mark.parametrize("offset", [0, 250])
def test_homing_at_the_actual_position_moves_nothing_and_applies_the_offset(method, offset):
    bench = homing(method)
    bench.position = 77.0
    bench.command(0x07)
    bench.run(1)
    bench.command(ENABLED)
    bench.write(0x607C, offset)
    bench.command(ENABLED | START)
    assert progress(bench) == ATTAINED
    assert bench.read(0x6064, signed=True) == -offset  # zero = home + offset
    assert {d.position for d in bench.run(20)} == {77.0}


def test_positions_after_homing_are_relative_to_the_zero_position():
    bench = homing(17)
    bench.write(0x607C, 50)
    bench.command(ENABLED | START)
    run_to_end(bench)
    bench.write(0x6060, 1)
    bench.run(5)
    bench.write(0x607A, 0)
    bench.command(ENABLED, ENABLED | START)
    bench.run(2000)
    assert bench.read(0x6064, signed=True) == 0
    assert bench.position == pytest.approx(-200.0 + 50.0, abs=SLOW * 1e-3)


def test_clearing_bit_4_interrupts_the_homing():
    bench = homing(17)
    bench.command(ENABLED | START)
    bench.run(20)
    bench.command(ENABLED)
    bench.run(100)
    assert progress(bench) == NOT_STARTED
    assert bench.position > -200.0
    assert bench.demand.velocity == 0.0


def test_a_halt_stops_the_homing_until_it_ends():
    bench = homing(17)
    bench.command(ENABLED | START)
    bench.run(20)
    bench.command(ENABLED | START | HALT)
    bench.run(200)
    assert bench.demand.velocity == 0.0
    assert progress(bench) == IN_PROGRESS
    bench.command(ENABLED | START)
    run_to_end(bench)
    assert progress(bench) == ATTAINED


def test_the_switch_of_the_other_end_is_a_homing_error():
    bench = homing(17)
    bench.ends = (None, -10.0)  # the wires of the switches are swapped
    bench.position = -11.0
    bench.command(0x07)
    bench.run(1)
    bench.command(ENABLED, ENABLED | START)
    bench.run(20)
    bench.ends = (None, -1e9)
    bench.run(1)
    assert bench.status & 0x2000
    bench.run(300)
    assert progress(bench) == FAILED
    assert bench.node.state.name == "OPERATION_ENABLED"
    assert bench.demand.velocity == 0.0


def test_a_new_start_after_an_error_may_succeed():
    test_bench = homing(37)
    test_bench.command(ENABLED | START, ENABLED)
    test_bench.write(0x6098, 17)
    test_bench.command(ENABLED | START)
    assert progress(test_bench) == IN_PROGRESS
    run_to_end(test_bench)
    assert progress(test_bench) == ATTAINED


def test_a_home_position_stays_attained_through_a_change_of_the_mode():
    bench = homing(37)
    bench.command(ENABLED | START)
    bench.write(0x6060, 8)
    bench.run(2)
    bench.write(0x6060, 6)
    bench.run(1)
    assert progress(bench) == ATTAINED
    bench.nmt(0x81)
    bench.enable(6)
    assert progress(bench) == NOT_STARTED
