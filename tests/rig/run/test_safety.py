"""The safety gate: each bound is necessary, and no jump is accepted."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from comms.messages import Position
from rig.run.tasks.safety import Envelope, Gate

MS = 1_000_000
PERIOD_S = 0.01
BOUNDS = Envelope(
    position_min_m=-0.25,
    position_max_m=0.25,
    depth_m=0.25,
    height_m=0.25,
    speed_m_s=1.0,
    acceleration_m_s2=5.0,
)


def along_x(*places_m: float) -> list[Position]:
    """Positions 10 ms apart."""
    return [(x, 0.0, 0.0) for x in places_m]


def first_refusal(
    envelope: Envelope, positions: list[Position], period_ns: int = 10 * MS
) -> str | None:
    """First refusal of references on an even grid; None when all are accepted."""
    gate = Gate(envelope)
    return next(
        (said for k, p in enumerate(positions) if (said := gate.refusal(k * period_ns, p))), None
    )


def speeding_up(acceleration_m_s2: float, top_m_s: float, from_m: float = -0.2) -> list[Position]:
    """From rest at constant acceleration up to a top speed, until 0.4 m are covered."""
    x, v, out = from_m, 0.0, [from_m]
    while x < from_m + 0.4:
        v = min(v + acceleration_m_s2 * PERIOD_S, top_m_s)
        x += v * PERIOD_S
        out.append(x)
    return along_x(*out)


INTRUDERS = {
    "position_max_m": (along_x(0.2501), "x = 0.2501 m; must be -0.25 to 0.25 m"),
    "position_min_m": (along_x(-0.2501), "x = -0.2501 m; must be -0.25 to 0.25 m"),
    "depth_m": ([(0.0, 0.2501, 0.0)], "y = 0.2501 m; must be within +-0.25 m"),
    "height_m": ([(0.0, 0.0, -0.2501)], "z = -0.2501 m; must be within +-0.25 m"),
    "speed_m_s": (speeding_up(4.9, 1.01), "speed 1.010 m/s; must be <= 1.000 m/s"),
    "acceleration_m_s2": (speeding_up(5.05, 0.9), "acceleration 5.05 m/s2; must be <= 5.00 m/s2"),
}


def without(bound: str) -> Envelope:
    """Envelope without one bound."""
    return msgspec.structs.replace(
        BOUNDS, **{bound: -math.inf if bound == "position_min_m" else math.inf}
    )


@pytest.mark.parametrize("bound", INTRUDERS)
def test_an_intruder_is_refused_with_the_value_and_the_bound(bound: str) -> None:
    positions, said = INTRUDERS[bound]
    assert first_refusal(BOUNDS, positions) == said


@pytest.mark.parametrize("bound", INTRUDERS)
def test_each_bound_alone_keeps_its_intruder_out(bound: str) -> None:
    assert first_refusal(without(bound), INTRUDERS[bound][0]) is None


def test_the_table_has_an_intruder_for_every_bound() -> None:
    assert set(INTRUDERS) == {field.name for field in msgspec.structs.fields(Envelope)}


@pytest.mark.parametrize("place_m", [-0.2501, 0.2501, math.nan, math.inf, -math.inf])
def test_places_along_x_are_bounded(place_m: float) -> None:
    said = Gate(BOUNDS).refusal(0, (place_m, 0.0, 0.0))
    assert said is not None
    assert said.startswith("x = ")


@pytest.mark.parametrize("place_m", [math.nan, math.inf, -math.inf])
def test_a_place_that_is_no_number_is_refused_along_the_other_axes_too(place_m: float) -> None:
    assert Gate(BOUNDS).refusal(0, (0.0, place_m, 0.0)) is not None
    assert Gate(BOUNDS).refusal(0, (0.0, 0.0, place_m)) is not None


def test_bounds_on_x_say_nothing_about_the_other_axes() -> None:
    envelope = msgspec.structs.replace(BOUNDS, position_min_m=0.05)
    assert Gate(envelope).refusal(0, (0.1, 0.0, 0.0)) is None


@pytest.mark.parametrize("bound", INTRUDERS)
def test_a_bound_that_is_no_number_refuses_instead_of_passing(bound: str) -> None:
    envelope = msgspec.structs.replace(BOUNDS, **{bound: math.nan})
    assert first_refusal(envelope, along_x(0.0, 1e-4)) is not None


def test_only_the_depth_and_the_height_of_an_envelope_have_defaults() -> None:
    made = Envelope(position_min_m=-1.0, position_max_m=1.0, speed_m_s=2.0, acceleration_m_s2=3.0)
    assert (made.depth_m, made.height_m) == (0.25, 0.1)
    defaults = {f.name: f.default for f in msgspec.structs.fields(Envelope) if not f.required}
    assert defaults == {"depth_m": 0.25, "height_m": 0.1}


NARROW = msgspec.structs.replace(BOUNDS, position_min_m=-0.2, depth_m=0.15, height_m=0.1)
EDGES = [(0, -0.2), (0, 0.25), (1, -0.15), (1, 0.15), (2, -0.1), (2, 0.1)]


@pytest.mark.parametrize(("axis", "edge_m"), EDGES)
def test_a_place_exactly_at_a_bound_passes_and_the_next_number_is_refused(
    axis: int, edge_m: float
) -> None:
    def place(value: float) -> Position:
        x, y, z = (value if k == axis else 0.0 for k in range(3))
        return (x, y, z)

    assert Gate(NARROW).refusal(0, place(edge_m)) is None
    beyond = math.nextafter(edge_m, math.copysign(math.inf, edge_m))
    said = Gate(NARROW).refusal(0, place(beyond))
    assert str(said).startswith(f"{'xyz'[axis]} = ")


# rounding of the positions, 1 nm: of two in a speed, of four in an acceleration, 10 ms apart
@pytest.mark.parametrize(
    ("speed_m_s", "passes"), [(1.0, True), (1.0 + 9e-8, True), (1.0 + 3e-7, False)]
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_speed_exactly_at_its_bound_passes_and_one_beyond_is_refused(
    speed_m_s: float, passes: bool, sign: float
) -> None:
    gate = Gate(msgspec.structs.replace(BOUNDS, acceleration_m_s2=math.inf))
    gate.refusal(0, (0.0, 0.0, 0.0))
    said = gate.refusal(10 * MS, (sign * speed_m_s * 0.01, 0.0, 0.0))
    assert said is None if passes else str(said).startswith("speed 1.000 m/s; must be <= 1.000")


@pytest.mark.parametrize(
    ("acceleration_m_s2", "passes"), [(5.0, True), (5.0 + 3e-5, True), (5.0 + 1e-4, False)]
)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_an_acceleration_exactly_at_its_bound_passes_and_one_beyond_is_refused(
    acceleration_m_s2: float, passes: bool, sign: float
) -> None:
    gate = Gate(BOUNDS)
    gate.refusal(0, (0.0, 0.0, 0.0))
    said = gate.refusal(10 * MS, (sign * acceleration_m_s2 * 0.01**2, 0.0, 0.0))
    assert said is None if passes else str(said).startswith("acceleration 5.00 m/s2; must be <=")


@pytest.mark.parametrize("edge_m", [-0.25, 0.25])
def test_the_edge_itself_is_inside(edge_m: float) -> None:
    assert first_refusal(BOUNDS, along_x(edge_m, edge_m)) is None


@pytest.mark.parametrize(
    "positions",
    [
        pytest.param(speeding_up(5.0, 1.0), id="exactly_at_both_bounds"),
        pytest.param([(x, -x, x) for x in np.linspace(0, 1e-4, 3)], id="slowly_along_all_axes"),
    ],
)
def test_what_keeps_to_the_bounds_passes(positions: list[Position]) -> None:
    assert first_refusal(BOUNDS, positions) is None


def test_speed_counts_over_all_axes_together() -> None:
    slow_each = [
        (0.006 * k, 0.006 * k, 0.006 * k) for k in range(5)
    ]  # 0.6 m/s an axis, 1.04 m/s in space
    high_acceleration = msgspec.structs.replace(BOUNDS, acceleration_m_s2=1000.0)
    assert first_refusal(high_acceleration, slow_each) == "speed 1.039 m/s; must be <= 1.000 m/s"


def test_the_first_step_is_judged_from_standstill() -> None:
    assert (
        first_refusal(BOUNDS, along_x(0.0, 0.0006))
        == "acceleration 6.00 m/s2; must be <= 5.00 m/s2"
    )


def test_braking_harder_than_the_bound_is_refused() -> None:
    cruise = speeding_up(4.9, 0.5)[:30]
    assert "acceleration 50.00" in str(first_refusal(BOUNDS, [*cruise, cruise[-1]]))


def test_a_jump_is_refused_however_long_the_gap_before_it() -> None:
    """50 mm after a gap of 1 s are 0.05 m/s, but the controller covers them in 30 ms."""
    for gap_ns in (10 * MS, 100 * MS, 1_000 * MS, 10_000 * MS):
        gate = Gate(msgspec.structs.replace(BOUNDS, acceleration_m_s2=1e6))
        assert gate.refusal(0, (0.0, 0.0, 0.0)) is None
        assert "speed" in str(gate.refusal(gap_ns, (0.05, 0.0, 0.0)))


def test_a_few_late_ticks_in_a_slow_move_are_no_jump() -> None:
    gate, move = Gate(BOUNDS), speeding_up(4.9, 0.2)
    for tick in (*range(10), *range(15, 30)):
        assert gate.refusal(tick * 10 * MS, move[tick]) is None


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_move_at_the_bounds_passes_along_every_axis(axis: int) -> None:
    turned = [(p[-axis], p[1 - axis], p[2 - axis]) for p in speeding_up(5.0, 1.0)]
    assert max(place[axis] for place in turned) > 0.19
    assert first_refusal(BOUNDS, turned) is None


@pytest.mark.parametrize(("step_ns", "back_ms"), [(0, "0.0"), (-10 * MS, "10.0")])
def test_a_reference_that_is_not_later_than_the_last_is_refused(step_ns: int, back_ms: str) -> None:
    gate = Gate(BOUNDS)
    assert gate.refusal(50 * MS, (0.0, 0.0, 0.0)) is None
    said = gate.refusal(50 * MS + step_ns, (0.0, 0.0, 0.0))
    assert said == f"reference {back_ms} ms back in time; must be later than the one before"


def test_a_refused_reference_leaves_no_trace_in_the_gate() -> None:
    gate = Gate(BOUNDS)
    gate.refusal(0, (0.0, 0.0, 0.0))
    assert gate.refusal(10 * MS, (0.2, 0.0, 0.0)) is not None
    assert gate.refusal(20 * MS, (0.0, 0.0, 0.0)) is None


@given(
    st.lists(st.tuples(st.integers(1, 60), *[st.floats(-0.3, 0.3)] * 3), min_size=2, max_size=40),
    st.sampled_from([1e-3, 1e-2, 1.0]),
)
def test_every_accepted_reference_keeps_to_every_bound(
    walk: list[tuple[int, float, float, float]], scale: float
) -> None:
    gate, t_ns = Gate(BOUNDS), 0
    passed: list[tuple[float, np.ndarray]] = []
    for ticks, *place in walk:
        t_ns += ticks * 10 * MS
        position = scale * np.array(place)
        if gate.refusal(t_ns, (position[0], position[1], position[2])) is None:
            passed.append((t_ns * 1e-9, position))
    t_s, places = np.array([t for t, _ in passed]), np.array([p for _, p in passed]).reshape(-1, 3)
    dt, steps = np.diff(t_s), np.diff(places, axis=0)
    velocity = np.vstack([np.zeros((1, 3)), steps / dt[:, None]])
    assert np.all(np.abs(places[:, 0]) <= 0.25)
    assert np.all(np.linalg.norm(steps, axis=1) <= 1.0 * np.minimum(dt, 0.03) + 2e-9)
    assert np.all(np.linalg.norm(np.diff(velocity, axis=0), axis=1) <= 5.0 * dt + 4.1e-9 / dt)
