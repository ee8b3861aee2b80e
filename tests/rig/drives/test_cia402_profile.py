"""Profile position: trapezoid, set-point handshake, halt, limits."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.rig.drives.cia402_bench import NodeBench

ENABLED = 0x0F
NEW, IMMEDIATE, RELATIVE, HALT = 0x10, 0x20, 0x40, 0x100
REACHED, LIMITED, ACKNOWLEDGED, FOLLOWING = 1 << 10, 1 << 11, 1 << 12, 1 << 13
SPEED, ACCELERATION, DECELERATION = 1000, 10_000, 20_000  # increments, seconds


def profile(**options):
    bench = NodeBench(**options).enable(1)
    bench.write(0x6081, SPEED)
    bench.write(0x6083, ACCELERATION)
    bench.write(0x6084, DECELERATION)
    bench.write(0x6085, 4 * DECELERATION)
    bench.run(1)
    return bench


def move(bench, target, flags=0):
    """Give a set-point with the full handshake."""
    bench.write(0x607A, target)
    bench.command(ENABLED | NEW | flags)
    acknowledged = bench.status & ACKNOWLEDGED
    bench.command(ENABLED)
    return bool(acknowledged)


@settings(max_examples=30)
@given(target=st.integers(-1000, 1000), speed=st.integers(500, 5000))
def test_a_move_reaches_its_target_within_its_limits(target, speed):
    bench = profile()
    bench.write(0x6081, speed)
    assert move(bench, target)
    demands = []
    while not bench.status & REACHED:
        demands += bench.run(1)
        assert len(demands) < 30_000
    assert bench.read(0x6064, signed=True) == target
    velocities = [d.velocity for d in demands]
    assert max(map(abs, velocities)) <= speed * (1 + 1e-9)
    changes = [b - a for a, b in zip([0.0, *velocities], velocities, strict=False)]
    assert max(map(abs, changes)) <= DECELERATION * 1e-3 * (1 + 1e-6)
    assert all(d.kind == "position" for d in demands)


def test_a_move_takes_the_time_of_the_trapezoid():
    bench = profile()
    move(bench, 1000)
    samples = 0
    while not bench.status & REACHED:
        bench.run(1)
        samples += 1
    assert samples == pytest.approx(1000 * (1.0 + 0.1 / 2 + 0.05 / 2), abs=2)


def test_the_handshake_acknowledges_a_set_point_and_is_ready_for_the_next():
    bench = profile()
    bench.write(0x607A, 500)
    bench.command(ENABLED | NEW)
    assert bench.status & (ACKNOWLEDGED | REACHED) == ACKNOWLEDGED
    bench.run(3)
    assert bench.status & ACKNOWLEDGED
    bench.command(ENABLED)
    assert not bench.status & ACKNOWLEDGED


def test_a_second_set_point_waits_for_the_first_and_a_third_is_not_accepted():
    bench = profile()
    move(bench, 300)
    bench.run(10)
    move(bench, 600)
    assert bench.status & ACKNOWLEDGED  # the buffer is full
    bench.write(0x607A, 900)
    bench.command(ENABLED | NEW)
    bench.command(ENABLED)
    demands = bench.run(1500)
    stops = [d.position for d in demands if d.velocity == 0.0]
    assert stops[-1] == 600.0
    assert any(abs(d.position - 300.0) < 1.0 and abs(d.velocity) < 25 for d in demands)
    assert bench.status & (REACHED | ACKNOWLEDGED) == REACHED


def test_a_set_point_that_changes_immediately_replaces_the_active_one_without_a_stop():
    bench = profile()
    move(bench, 1000)
    bench.run(300)
    assert move(bench, 2000, IMMEDIATE)
    demands = bench.run(600)
    assert min(d.velocity for d in demands) == pytest.approx(SPEED)
    bench.run(1500)
    assert bench.position == 2000.0


def test_a_set_point_behind_the_axis_turns_it_round():
    bench = profile()
    move(bench, 1000)
    bench.run(300)
    move(bench, -100, IMMEDIATE)
    demands = bench.run(2000)
    velocities = [d.velocity for d in demands]
    changes = [abs(b - a) for a, b in itertools.pairwise(velocities)]
    assert max(changes) <= DECELERATION * 1e-3 * (1 + 1e-6)
    assert bench.position == -100.0


def test_a_relative_set_point_starts_from_the_last_one():
    bench = profile()
    move(bench, 300)
    bench.run(1000)
    move(bench, -50, RELATIVE)
    bench.run(1000)
    assert bench.position == 250.0
    move(bench, 100)
    move(bench, 25, RELATIVE | IMMEDIATE)
    bench.run(1000)
    assert bench.position == 125.0


@pytest.mark.parametrize(("option", "deceleration"), [(1, DECELERATION), (2, 4 * DECELERATION)])
def test_a_halt_stops_on_the_ramp_of_605d_and_the_move_continues_after_it(option, deceleration):
    bench = profile()
    bench.write(0x605D, option)
    move(bench, 1000)
    bench.run(300)
    start = bench.position
    bench.command(ENABLED | HALT)
    demands = bench.run(200)
    assert bench.position - start == pytest.approx(SPEED**2 / (2 * deceleration), abs=1e-6)
    assert demands[-1].kind == "brake"
    assert bench.status & REACHED
    bench.command(ENABLED)
    bench.run(1)
    assert not bench.status & REACHED
    bench.run(1500)
    assert bench.position == 1000.0


def test_a_set_point_during_a_halt_starts_after_it():
    bench = profile()
    bench.command(ENABLED | HALT)
    bench.run(1)
    bench.write(0x607A, 40)
    bench.command(ENABLED | HALT | NEW)
    bench.run(50)
    assert bench.position == 0.0
    bench.command(ENABLED)
    bench.run(500)
    assert bench.position == 40.0


def test_a_set_point_beyond_a_software_limit_is_limited_and_shown():
    bench = profile()
    bench.write(0x607D, -100, 1)
    bench.write(0x607D, 200, 2)
    move(bench, 500)
    bench.run(1000)
    assert bench.position == 200.0
    assert bench.status & LIMITED
    move(bench, 100)
    bench.run(1)
    assert not bench.status & LIMITED


def test_equal_software_limits_are_off():
    bench = profile()
    bench.write(0x607D, 0, 1)
    bench.write(0x607D, 0, 2)
    move(bench, 500)
    bench.run(1000)
    assert bench.position == 500.0


@pytest.mark.parametrize("index", [0x607F, 0x6080])
def test_the_speed_is_limited_by_the_drive_and_by_the_motor(index):
    bench = profile()
    bench.write(index, 400)
    move(bench, 500)
    assert max(d.velocity for d in bench.run(1500)) == pytest.approx(400)
    assert bench.position == 500.0


def test_a_target_counts_as_reached_after_the_window_time_in_the_window():
    bench = profile()
    bench.write(0x6067, 2)
    bench.write(0x6068, 20)
    move(bench, 0)
    bench.run(20)
    assert not bench.status & REACHED
    bench.run(2)
    assert bench.status & REACHED
    bench.is_stuck = True
    bench.position = 3.0
    bench.run(1)
    assert not bench.status & REACHED


def test_a_set_point_is_ignored_unless_operation_is_enabled():
    bench = profile()
    bench.command(0x07)
    bench.write(0x607A, 500)
    bench.command(0x07 | NEW)
    bench.command(0x0F | NEW)  # no rising edge
    bench.run(50)
    assert bench.position == 0.0


def test_a_change_of_the_mode_in_motion_stops_on_the_profile_ramp():
    bench = profile()
    move(bench, 5000)
    bench.run(300)
    start = bench.position
    bench.write(0x6060, 0)
    demands = bench.run(100)
    assert bench.position - start == pytest.approx(SPEED**2 / (2 * DECELERATION), abs=1e-6)
    assert demands[-1].kind == "brake"


def test_a_quick_stop_takes_v_squared_over_twice_6085():
    bench = profile()
    move(bench, 5000)
    bench.run(300)
    start = bench.position
    bench.command(0x02)
    demands = bench.run(100)
    expected = SPEED**2 / (2 * 4 * DECELERATION)
    assert bench.position - start == pytest.approx(expected, abs=1e-6)
    positions = [d.position for d in demands if d.kind == "position"]
    assert positions == sorted(positions)
    assert bench.node.state.name == "SWITCH_ON_DISABLED"


def test_operation_that_is_disabled_and_enabled_in_motion_starts_at_the_actual_position():
    bench = profile()
    move(bench, 5000)
    bench.is_stuck = True
    bench.run(300)
    bench.command(0x07, 0x0F)
    (demand,) = bench.run(1)
    assert (demand.position, demand.velocity) == (bench.position, 0.0)


def test_operation_may_be_enabled_again_during_a_quick_stop():
    bench = profile()
    bench.write(0x605A, 6)
    move(bench, 5000)
    bench.run(300)
    bench.command(0x02)
    bench.run(5)
    bench.command(0x0F)
    demands = bench.run(100)
    steps = [b.velocity - a.velocity for a, b in itertools.pairwise(demands)]
    assert max(map(abs, steps)) <= DECELERATION * 1e-3 * (1 + 1e-6)
    move(bench, 400)
    bench.run(1000)
    assert bench.position == 400.0
