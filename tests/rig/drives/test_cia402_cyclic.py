"""Cyclic synchronous modes, supervision and units."""

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.drives.cia402.errors import Cia402Error
from rig.drives.cia402.modes.interpolator import LinearInterpolator
from rig.drives.cia402.node import DriveNode
from rig.drives.cia402.signals import DriveFeedback, DriveUnits
from tests.rig.drives.cia402_bench import MS, NodeBench

LIMITED, FOLLOWS, FOLLOWING_ERROR = 1 << 11, 1 << 12, 1 << 13
PERIOD = 4  # samples between two SYNCs


def cyclic(mode, **options):
    bench = NodeBench(**options).enable(mode)
    bench.nmt(1)
    bench.write(0x60C2, PERIOD, 1)
    return bench


def cycle(bench, target, index=2):
    """One period: target by RPDO, SYNC, four samples."""
    bench.send(0x205 + 0x100 * index, b"\x0f\0" + target.to_bytes(4, "little", signed=True))
    bench.sync()
    return bench.run(PERIOD)


@given(targets=st.lists(st.integers(-(10**6), 10**6), min_size=1, max_size=6))
def test_positions_are_interpolated_linearly_and_exactly_reached_one_period_later(targets):
    bench = cyclic(8)
    last = 0
    for target in targets:
        demands = cycle(bench, target)
        expected = [last + (target - last) * k / PERIOD for k in range(PERIOD)]
        assert [d.position for d in demands] == pytest.approx(expected)
        last = target
    assert [d.position for d in bench.run(2)] == [last, last]
    assert bench.read(0x6064, signed=True) == last


def test_the_velocity_of_a_position_ramp_is_its_slope():
    bench = cyclic(8)
    for k in range(1, 5):
        demands = cycle(bench, 100 * k)
    assert [d.velocity for d in demands] == pytest.approx([100 / (PERIOD * 1e-3)] * PERIOD)
    assert bench.status & FOLLOWS


def test_a_late_sync_holds_the_last_target():
    bench = cyclic(8)
    cycle(bench, 100)
    demands = bench.run(10)
    assert {d.position for d in demands} == {100.0}
    assert demands[-1].velocity == 0.0


def test_an_early_sync_causes_no_jump_and_keeps_the_grid():
    bench = cyclic(8)
    cycle(bench, 400)
    bench.send(0x405, b"\x0f\0" + (800).to_bytes(4, "little"))
    bench.t_ns -= MS
    bench.sync()
    bench.t_ns += MS
    positions = [d.position for d in bench.run(4)]
    assert positions == pytest.approx([400, 500, 600, 700], abs=0.1)


def test_jitter_of_the_sync_does_not_show_in_the_speed():
    """The first late target moves the grid; the later ones come before they are due."""
    interpolator = LinearInterpolator()
    rng = random.Random(5)
    arrivals_ns = [k * MS + rng.randrange(MS) for k in range(1, 2001)]
    values = []
    for t_ns in range(0, 2000 * MS, MS):
        while arrivals_ns and arrivals_ns[0] < t_ns:
            interpolator.aim(float(2000 - len(arrivals_ns)), arrivals_ns.pop(0), MS)
        values.append(interpolator.value_at(t_ns))
    speeds = [b - a for a, b in pairwise(values[200:])]
    assert max(speeds) < 1.02
    assert min(speeds) > 0.8
    assert values[-1] > 2000 - 4, "the drive is at most four targets behind the master"


def test_a_burst_of_targets_is_reached_two_periods_later():
    interpolator = LinearInterpolator()
    for target in (1.0, 2.0, 3.0, 4.0):
        interpolator.aim(target, 10 * MS, MS)
    assert interpolator.value_at(12 * MS) == 4.0
    assert interpolator.value_at(20 * MS) == 4.0


def test_a_torque_offset_goes_with_its_target():
    bench = cyclic(8)
    bench.write(0x60B2, 30)
    assert [d.torque for d in bench.run(3)] == [0.0, 30.0, 30.0], "on the way to the target"


def test_targets_without_sync_are_interpolated_from_their_write_on():
    bench = cyclic(8)
    bench.write(0x607A, 40)
    assert [d.position for d in bench.run(6)] == [0, 10, 20, 30, 40, 40]


def test_the_offsets_add_to_position_velocity_and_torque():
    bench = cyclic(8)
    bench.write(0x60B0, 7)
    bench.write(0x60B1, 11)
    bench.write(0x60B2, 13)
    cycle(bench, 100)
    (demand,) = bench.run(1)
    assert demand.position == 107.0
    (demand,) = bench.run(1)
    assert (demand.velocity, demand.torque) == (11.0, 13.0)


def test_a_cyclic_position_is_limited_by_607d_and_by_6080():
    bench = cyclic(8)
    bench.write(0x607D, 0, 1)
    bench.write(0x607D, 50, 2)
    bench.write(0x6080, 5000)
    demands = cycle(bench, 100)
    assert bench.status & (LIMITED | FOLLOWS) == LIMITED
    assert max(d.velocity for d in demands) == 5000.0
    demands = bench.run(20)
    assert demands[-1].position == 50.0


def test_velocities_are_interpolated_and_limited_by_6080():
    bench = cyclic(9)
    demands = cycle(bench, 400, index=3)
    assert [d.velocity for d in demands] == pytest.approx([0, 100, 200, 300])
    assert [d.acceleration for d in demands[1:]] == pytest.approx([100e3] * 3)
    assert {d.kind for d in demands} == {"velocity"}
    bench.write(0x6080, 500)
    bench.write(0x60B1, 300)
    cycle(bench, 400, index=3)
    assert bench.run(1)[0].velocity == 500.0
    assert bench.status & LIMITED


def test_torques_are_interpolated_and_limited_by_6072():
    bench = cyclic(10)
    bench.write(0x6072, 150)
    bench.write(0x6071, 100)
    assert [d.torque for d in bench.run(5)] == pytest.approx([0, 25, 50, 75, 100])
    bench.write(0x60B2, 90)
    demand = bench.run(5)[-1]
    assert (demand.kind, demand.torque, demand.torque_limit) == ("torque", 150.0, 150.0)
    assert bench.status & LIMITED


def test_the_interpolation_period_of_60c2_is_exact_for_every_exponent():
    for exponent, value in ((-6, 250), (-4, 10), (-3, 1), (-1, 1)):
        bench = cyclic(8)
        bench.write(0x60C2, exponent, 2)
        bench.write(0x60C2, value, 1)
        bench.run(1)
        bench.write(0x607A, 1000)
        bench.run(1)
        period_ns = value * 10 ** (9 + exponent)
        start_ns = bench.t_ns - MS
        before = bench.node.step(start_ns + period_ns - 1, bench.feedback()).position
        assert before < 1000.0
        assert bench.node.step(start_ns + period_ns, bench.feedback()).position == 1000.0


@given(
    target=st.integers(-(2**31), 2**31 - 1),
    period_ns=st.integers(0, 10**9),
    elapsed_ns=st.integers(0, 2 * 10**9),
)
def test_an_interpolated_value_lies_between_start_and_target(target, period_ns, elapsed_ns):
    interpolator = LinearInterpolator()
    interpolator.hold(5.0)
    interpolator.aim(float(target), 10**18, period_ns)
    value = interpolator.value_at(10**18 + elapsed_ns)
    assert min(5.0, target) <= value <= max(5.0, target)
    if elapsed_ns >= period_ns:
        assert value == target


@pytest.mark.parametrize("velocity", [300, -300])
@pytest.mark.parametrize("mode", [8, 9, 10])
def test_a_quick_stop_takes_v_squared_over_twice_6085_in_every_cyclic_mode(mode, velocity):
    bench = cyclic(mode)
    bench.write(0x6085, 10_000)
    bench.write(0x605A, 6)
    bench.torque_gain = 100.0
    if mode == 8:
        for k in range(1, 100):
            cycle(bench, round(velocity * k * PERIOD * 1e-3))
    elif mode == 9:
        bench.write(0x60FF, velocity)
        bench.run(50)
    else:
        bench.run(1)
        bench.velocity = float(velocity)
        bench.run(10)
    start, speed = bench.position, bench.demand.velocity if mode == 8 else bench.velocity
    bench.command(0x02)
    demands = bench.run(100)
    expected = speed * abs(speed) / (2 * 10_000)
    rounding = 1e-6 if mode == 8 else abs(speed) * 1e-3  # the axis of the test moves in samples
    assert bench.position - start == pytest.approx(expected, abs=rounding)
    assert demands[-1].kind == "brake"


def test_a_following_error_beyond_its_window_and_time_is_a_fault():
    bench = cyclic(8)
    bench.write(0x6065, 10)
    bench.write(0x6066, 5)
    bench.is_stuck = True
    bench.write(0x607A, 11)
    bench.run(4)
    assert bench.read(0x60F4, signed=True) == 6
    bench.run(6)
    assert bench.node.state.name == "OPERATION_ENABLED"
    assert bench.read(0x60F4, signed=True) == 11
    bench.run(1)
    assert bench.status & FOLLOWING_ERROR
    assert bench.emergencies() == [(0x8611, 0x21)]
    bench.run(2)
    assert bench.node.state.name == "FAULT"
    bench.command(0x80)
    assert not bench.status & FOLLOWING_ERROR


def test_a_following_error_that_ends_in_time_is_no_fault():
    bench = cyclic(8)
    bench.write(0x6065, 10)
    bench.write(0x6066, 5)
    for _ in range(5):
        bench.is_stuck = True
        bench.write(0x607A, round(bench.position) + 11)
        bench.run(8)
        bench.is_stuck = False
        bench.run(3)
    assert bench.node.state.name == "OPERATION_ENABLED"


def test_the_reaction_to_a_following_error_starts_where_the_axis_is():
    bench = cyclic(8)
    bench.write(0x6065, 10)
    bench.is_stuck = True
    bench.write(0x607A, 1000)
    demands = bench.run(10)
    assert bench.node.state.name == "FAULT"
    assert demands[-1].position == 0.0


@pytest.mark.parametrize("jump", [1000.0, -1000.0])
def test_the_reaction_to_an_encoder_that_jumps_does_not_follow_its_velocity(jump):
    """1000 increments within a sample are a velocity of a million per second."""
    bench = cyclic(8)
    bench.write(0x6065, 100)
    bench.write(0x6066, 0)
    for target in range(1, 21):
        bench.write(0x607A, target)
        bench.run(1)
    bench.position += jump
    bench.velocity = jump / 1e-3
    before = bench.position
    demands = bench.run(50)
    assert bench.emergencies() == [(0x8611, 0x21)]
    assert abs(demands[0].velocity) <= 1000.0
    assert abs(demands[-1].position - before) <= 1000.0**2 / (2 * 10_000)
    assert demands[-1].velocity == 0.0


@pytest.mark.parametrize("mode", [1, 8, 9, 10])
@pytest.mark.parametrize("direction", [-1, 1])
def test_motion_into_an_end_switch_is_a_fault(mode, direction):
    bench = cyclic(mode, negative_end=-50.0, positive_end=50.0)
    bench.torque_gain = 100.0
    if mode == 1:
        bench.write(0x607A, 1000 * direction)
        bench.command(0x1F)
    elif mode == 8:
        bench.write(0x60C2, 100, 1)
        bench.write(0x607A, 1000 * direction)
    elif mode == 9:
        bench.write(0x60FF, 1000 * direction)
    else:
        bench.write(0x6071, 100 * direction)
    bench.run(300)
    assert bench.node.state.name == "FAULT"
    assert bench.read(0x603F) == 0x8612
    assert bench.emergencies() == [(0x8612, 0x21)]
    assert abs(bench.position) >= 50.0
    assert bench.read(0x60FD) == (1 if direction < 0 else 2)
    assert bench.status & LIMITED


def test_an_axis_on_an_end_switch_may_move_away_from_it():
    bench = cyclic(9, positive_end=50.0)
    bench.position = 55.0
    bench.run(5)
    bench.write(0x60FF, -1000)
    bench.run(100)
    assert bench.node.state.name == "OPERATION_ENABLED"
    assert bench.position < 50.0


def test_a_torque_demand_at_rest_on_an_end_switch_is_no_fault():
    bench = cyclic(10, positive_end=50.0)
    bench.position = 55.0
    bench.velocity = 100.0  # 606F: noise of the encoder
    bench.run(20)
    assert bench.node.state.name == "OPERATION_ENABLED"
    bench.velocity = 101.0
    bench.run(2)
    assert bench.read(0x603F) == 0x8612


@pytest.mark.parametrize("mode", [9, 10])
def test_a_software_limit_in_a_mode_without_position_is_a_fault(mode):
    bench = cyclic(mode)
    bench.torque_gain = 100.0
    bench.write(0x607D, -20, 1)
    bench.write(0x607D, 20, 2)
    bench.write(0x60FF, -1000)
    bench.write(0x6071, -100)
    bench.run(300)
    assert bench.read(0x603F) == 0x8612
    assert bench.node.state.name == "FAULT"


def test_actual_values_are_in_the_units_of_the_wire():
    units = DriveUnits(
        increments_per_unit=1000.0,
        velocity_units_per_unit_s=10.0,
        acceleration_units_per_unit_s2=1.0,
        rated_torque=2.5,
    )
    bench = NodeBench(units)
    feedback = DriveFeedback(units.to_increments(3.0), units.to_increments(-2.0), 123.4)
    bench.node.step(0, feedback)
    assert bench.read(0x6064, signed=True) == 3000
    assert bench.read(0x606C, signed=True) == -20
    assert bench.read(0x6077, signed=True) == 123
    assert bench.read(0x6076) == 2500
    assert units.from_permille(1000.0) == 2.5
    assert units.to_permille(2.5) == 1000.0
    assert units.from_increments(500.0) == 0.5


def test_a_velocity_target_has_the_unit_of_the_wire():
    units = DriveUnits(increments_per_unit=1000.0, velocity_units_per_unit_s=10.0)
    bench = cyclic(9, units=units)
    bench.write(0x60FF, 20)  # 2 rad/s
    assert bench.run(10)[-1].velocity == pytest.approx(2000.0)
    assert bench.read(0x606B, signed=True) == 20


@pytest.mark.parametrize("name", ["increments_per_unit", "velocity_units_per_unit_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_a_factor_must_be_positive_and_finite(name, value):
    with pytest.raises(Cia402Error, match=f"{name} = {value}; must be > 0 and finite"):
        DriveUnits(**{name: value})


def test_a_sample_before_the_last_one_is_refused():
    node = DriveNode(1)
    node.step(5, DriveFeedback(0.0))
    with pytest.raises(Cia402Error, match="t_ns = 4 of a drive sample; must be >= 5"):
        node.step(4, DriveFeedback(0.0))


@pytest.mark.parametrize(
    ("name", "value"),
    [("position", math.nan), ("velocity", math.inf), ("torque", -math.inf), ("drive_fault", 2**16)],
)
def test_a_feedback_out_of_range_is_refused(name, value):
    feedback = DriveFeedback(0.0)._replace(**{name: value})
    with pytest.raises(Cia402Error, match=f"{name} = {value} in the feedback; must be"):
        DriveNode(1).step(0, feedback)


@pytest.mark.parametrize("mode", [9, 10])
def test_a_quick_stop_beyond_a_software_limit_is_no_fault(mode):
    bench = cyclic(mode)
    bench.write(0x605A, 6)
    bench.velocity = 1000.0
    bench.write(0x60FF, 1000)
    bench.run(10)
    bench.command(0x02)
    bench.write(0x607D, -20, 1)
    bench.write(0x607D, 1, 2)
    bench.run(5)
    assert bench.node.state.name == "QUICK_STOP_ACTIVE"


def test_a_drive_without_mode_holds_its_position():
    bench = NodeBench().enable(0)
    bench.position = 0.0
    assert {(d.kind, d.position) for d in bench.run(5)} == {("brake", 0.0)}


@pytest.mark.parametrize("mode", [0, 1, 6, 8, 9, 10])
def test_enabling_causes_no_jump_wherever_the_axis_is(mode):
    bench = NodeBench()
    bench.position = 12345.0
    bench.enable(mode)
    for demand in bench.run(5):
        assert (demand.velocity, demand.torque) == (0.0, 0.0)
        assert demand.position == 12345.0
