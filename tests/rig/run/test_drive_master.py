"""Master of the field bus alone, frame by frame, opposite a scripted node."""

from __future__ import annotations

import itertools
import struct
from itertools import pairwise

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comms.messages import Phase, Verb
from rig.run.tasks.drive.task import build
from tests.rig.run.drive_exchange import (
    BEAT_OF_MASTER,
    BOOTED,
    EMERGENCY,
    ENABLE,
    ENABLED,
    FAULTY,
    HEARTBEAT,
    MS,
    NMT,
    NODE,
    OPERATIONAL,
    PRE_OPERATIONAL,
    QUICK_STOP,
    RPDO_1,
    SDO_ANSWER,
    SDO_REQUEST,
    SETTINGS,
    SHUTDOWN,
    SWITCH_ON,
    SYNC,
    TPDO_1,
    Exchange,
    ScriptedNode,
    can_message,
    replies_of,
)

UNTIMED = settings(deadline=None)  # a busy machine is no failure
RESET, START = bytes([0x81, NODE]), bytes([0x01, NODE])


def motions(exchange: Exchange, since: int = 0) -> list[tuple[int, int]]:
    """Control word and target of each PDO so far."""
    return [
        struct.unpack("<Hi", frame.data)
        for frame in exchange.frames[since:]
        if frame.can_id == RPDO_1
    ]


def gave_up(exchange: Exchange) -> list[tuple[int | None, Phase, str]]:
    """Requests to end the run: exit code, phase and text."""
    return [(r.exit, r.phase, r.text) for r in exchange.replies if r.id == 0 and not r.ok]


def test_the_node_is_reset_every_half_second_until_it_boots_and_then_no_more() -> None:
    exchange = Exchange()
    exchange.node.is_silent = True
    exchange.tick(250)
    resets = [f.t_ns for f in exchange.frames if (f.can_id, f.data) == (NMT, RESET)]
    assert resets == [5 * MS, 505 * MS, 1005 * MS]
    exchange.receive(HEARTBEAT, bytes([BOOTED]))
    exchange.tick(250)
    assert len([f for f in exchange.frames if f.data == RESET]) == 3


def test_a_node_that_runs_already_is_reset_in_spite_of_its_heartbeat() -> None:
    exchange = Exchange()
    exchange.receive(HEARTBEAT, bytes([OPERATIONAL]))
    assert (NMT, RESET) in exchange.tick()
    exchange.until_ready()


def test_the_heartbeat_of_the_master_leaves_every_20_ms_from_the_first_tick_on() -> None:
    exchange = Exchange()
    exchange.tick(40)
    beats = [(f.t_ns, f.data) for f in exchange.frames if f.can_id == BEAT_OF_MASTER]
    assert [data for _, data in beats] == [bytes([OPERATIONAL])] * 10
    assert {later - earlier for (earlier, _), (later, _) in pairwise(beats)} == {20 * MS}


def test_a_skipped_tick_delays_the_heartbeat_by_that_tick_alone() -> None:
    exchange = Exchange().until_ready()
    last_ns = max(f.t_ns for f in exchange.frames if f.can_id == BEAT_OF_MASTER)
    sent = len(exchange.frames)
    for t_ns in range(exchange.t_ns + 5 * MS, last_ns + 40 * MS, 5 * MS):
        if t_ns != last_ns + 20 * MS:
            exchange.tick_at(t_ns)
    beats = [f.t_ns for f in exchange.frames[sent:] if f.can_id == BEAT_OF_MASTER]
    assert beats == [last_ns + 25 * MS]


def test_a_status_is_refused_while_no_node_answers() -> None:
    exchange = Exchange()
    exchange.node.is_silent = True
    exchange.tick(10)
    answer = exchange.order(Verb.STATUS)
    assert answer is not None
    assert not answer.ok
    assert answer.text == f"node {NODE} does not answer on the bus: look for power and bit rate"


def test_a_status_is_refused_while_the_node_is_being_configured() -> None:
    exchange = Exchange()
    exchange.tick(3)
    answer = exchange.order(Verb.STATUS)
    assert answer is not None
    assert (answer.ok, answer.text) == (False, f"node {NODE} is being configured")


def test_a_status_is_refused_with_the_abort_code_its_text_and_the_object() -> None:
    exchange = Exchange()
    exchange.node.aborts[0x6085, 0] = 0x0609_0031
    exchange.tick(60)
    answer = exchange.order(Verb.STATUS)
    assert answer is not None
    assert not answer.ok
    assert answer.text == (
        f"node {NODE}: object 6085:00: the node refuses, 0x06090031 (value too high)"
    )
    assert (NMT, START) not in [(f.can_id, f.data) for f in exchange.frames]


@pytest.mark.parametrize("subindex", [1, 2, 3])
def test_a_node_of_another_vendor_product_or_revision_is_refused(subindex: int) -> None:
    exchange = Exchange()
    exchange.node.objects[0x1018, subindex] = 0x99
    exchange.tick(60)
    answer = exchange.order(Verb.STATUS)
    assert answer is not None
    assert not answer.ok
    assert f"object 1018:0{subindex} = 0x99; must be 0x{0x11 * subindex:X}" in answer.text
    assert exchange.node.writes == []
    assert motions(exchange) == []


def test_an_answer_that_does_not_come_is_asked_for_five_times_and_then_named() -> None:
    exchange = Exchange()
    exchange.tick(5)
    exchange.node.is_silent = True
    exchange.tick(200)
    asked = [frame for frame in exchange.frames if frame.can_id == SDO_REQUEST][-5:]
    assert len({frame.data for frame in asked}) == 1
    gaps_ns = [b.t_ns - a.t_ns for a, b in itertools.pairwise(asked)]
    assert gaps_ns == [105 * MS] * 4  # the tick after 100 ms
    told = exchange.order(Verb.STATUS).text  # type: ignore[union-attr]
    assert "no answer to 5 requests within 100 ms each" in told


@pytest.mark.parametrize(
    "answer",
    [
        "4b18100111000000"[:14],  # 7 bytes
        "6018100111000000",  # to a write
        "4118100111000000",  # announces segments
        "4318100222000000",  # of another subindex
        "4300200111000000",  # of another object
    ],
)
def test_an_answer_to_another_request_is_not_taken(answer: str) -> None:
    exchange = Exchange()
    exchange.node.is_silent = True
    exchange.tick()
    exchange.receive(HEARTBEAT, bytes([BOOTED]))
    exchange.tick(2)
    exchange.receive(SDO_ANSWER, bytes.fromhex(answer))
    exchange.tick(2)
    requests = [f.data for f in exchange.frames if f.can_id == SDO_REQUEST]
    assert requests == [bytes.fromhex("4018100100000000")]
    exchange.receive(SDO_ANSWER, bytes.fromhex("4318100111000000"))
    exchange.tick()
    requests = [f.data for f in exchange.frames if f.can_id == SDO_REQUEST]
    assert requests[1:] == [bytes.fromhex("4018100200000000")]


def test_the_master_is_not_ready_before_it_knows_the_position() -> None:
    exchange = Exchange(node=ScriptedNode(position=50_000))
    for _ in range(100):
        exchange.tick()
        if exchange.states:
            break
        answer = exchange.order(Verb.ARM)
        assert answer is not None
        assert not answer.ok
    assert exchange.order(Verb.STATUS).ok  # type: ignore[union-attr]


def test_a_lost_start_is_repeated_with_the_next_heartbeat() -> None:
    exchange = Exchange()
    for _ in range(100):
        if (NMT, START) in exchange.tick():
            break
    exchange.node.is_operational = False  # it was lost
    exchange.until_ready()
    assert [f.data for f in exchange.frames if f.can_id == NMT].count(START) == 2


def test_arming_is_answered_only_once_the_drive_is_enabled() -> None:
    exchange = Exchange().until_ready()
    sent = len(exchange.frames)
    assert exchange.order(Verb.ARM) is None
    exchange.tick()
    assert [r for r in exchange.replies if r.phase is Phase.ARMED] == []
    exchange.tick()
    (answer,) = [r for r in exchange.replies if r.phase is Phase.ARMED]
    assert answer.ok
    assert answer.id > 0
    assert [word for word, _ in motions(exchange, sent)] == [SWITCH_ON, ENABLE]


def test_a_drive_that_is_not_armed_is_never_enabled() -> None:
    exchange = Exchange().until_ready()
    exchange.tick(40)
    stopped = exchange.order(Verb.STOP)
    assert stopped is not None
    exchange.tick(40)
    assert {word for word, _ in motions(exchange)} == {SHUTDOWN}
    assert exchange.node.status != ENABLED


@given(position=st.integers(-(2**31) + 1, 2**31 - 1))
@UNTIMED
def test_until_the_drive_is_armed_the_target_is_where_it_stands(position: int) -> None:
    exchange = Exchange(SETTINGS_FINE, ScriptedNode(position=position)).until_ready()
    exchange.tick()
    exchange.order(Verb.ARM)
    exchange.tick(6)
    assert motions(exchange)[-6:] == [
        *[(SWITCH_ON, position), (ENABLE, position)],
        *[(ENABLE, position)] * 4,
    ]
    assert exchange.node.position == position


SETTINGS_FINE = msgspec.structs.replace(
    SETTINGS, increments_per_unit=2.0**31, velocity_units_per_unit_s=2.0**31
)  # any position of 32 bits is within 1 m


@given(x_m=st.floats(-10.0, 10.0))
@UNTIMED
def test_a_setpoint_becomes_the_nearest_increment(x_m: float) -> None:
    exchange = Exchange().until_running()
    exchange.setpoint(x_m)
    exchange.tick()
    word, target = motions(exchange)[-1]
    assert word == ENABLE
    assert abs(target - x_m * 500_000.0) <= 0.5
    if abs(x_m * 500_000.0 % 1.0 - 0.5) > 1e-6:
        assert target == int(x_m * 500_000.0 + (0.5 if x_m > 0 else -0.5))


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_setpoint_beyond_32_bits_is_limited_to_them(sign: int) -> None:
    fine = msgspec.structs.replace(SETTINGS, increments_per_unit=1e9)
    exchange = Exchange(fine).until_running()
    exchange.setpoint(9.0 * sign)
    exchange.tick()
    assert motions(exchange)[-1] == (ENABLE, sign * (2**31 - 1))


@pytest.mark.parametrize("beside", [{"y_m": 1e-9}, {"z_m": -0.1}])
def test_a_setpoint_beside_the_axis_is_a_fault_and_a_quick_stop(beside: dict[str, float]) -> None:
    exchange = Exchange().until_running()
    exchange.setpoint(0.1)
    exchange.setpoint(0.2, **beside)
    exchange.tick()
    text = "a setpoint beside the axis; must be x alone, in m"
    assert gave_up(exchange) == [(5, Phase.FAULT, text)]
    assert motions(exchange)[-1] == (QUICK_STOP, 50_000)
    exchange.setpoint(0.3)
    exchange.tick()
    assert motions(exchange)[-1] == (QUICK_STOP, 50_000)


def test_a_joint_state_is_in_metres_and_stamped_with_the_sync_before_it() -> None:
    exchange = Exchange(node=ScriptedNode(position=-125_000)).until_ready()
    exchange.node.velocity = 50_000
    exchange.tick()
    sync_ns = [f.t_ns for f in exchange.frames if f.can_id == SYNC][-1]
    exchange.t_ns = sync_ns + 3 * MS  # the frame is late
    exchange.receive(TPDO_1, struct.pack("<ii", -125_000, 50_000))
    for state in exchange.states[-2:]:
        assert state.t_ns == sync_ns
        assert state.position_m == (-0.25, 0.0, 0.0)
        assert state.velocity_m_s == (0.2, 0.0, 0.0)
    assert [state.seq for state in exchange.states] == list(range(len(exchange.states)))


def test_each_sync_follows_its_target_at_a_fixed_period() -> None:
    exchange = Exchange().until_running()
    exchange.setpoint(0.0)
    sent = len(exchange.frames)
    exchange.tick(10)
    cyclic = [f for f in exchange.frames[sent:] if f.can_id in (RPDO_1, SYNC)]
    assert [f.can_id for f in cyclic] == [RPDO_1, SYNC] * 10
    assert [f.length for f in cyclic] == [6, 0] * 10
    syncs = [f.t_ns for f in cyclic if f.can_id == SYNC]
    assert {b - a for a, b in pairwise(syncs)} == {5 * MS}
    assert [f.seq for f in exchange.frames] == list(range(len(exchange.frames)))


def test_a_node_without_a_heartbeat_is_a_fault_with_the_figure() -> None:
    exchange = Exchange().until_running()
    last_ns = exchange.t_ns
    exchange.receive(HEARTBEAT, bytes([OPERATIONAL]))
    exchange.node.is_silent = True
    while exchange.t_ns < last_ns + 60 * MS:
        exchange.setpoint(0.0)
        exchange.tick()
    assert gave_up(exchange) == []
    exchange.tick()
    text = (
        f"no heartbeat of node {NODE} for 65 ms; must be <= 60 ms: "
        "look for its power and for the bus"
    )
    assert gave_up(exchange) == [(5, Phase.FAULT, text)]
    assert motions(exchange)[-1][0] == QUICK_STOP
    exchange.tick(50)
    assert len(gave_up(exchange)) == 1


def test_an_emergency_is_a_fault_at_once_and_a_quick_stop_with_the_next_sync() -> None:
    exchange = Exchange().until_running()
    exchange.receive(EMERGENCY, bytes.fromhex("1086210000000000"))
    text = f"emergency of node {NODE}: error 0x8610, register 0x21"
    assert gave_up(exchange) == [(5, Phase.FAULT, text)]
    exchange.tick()
    assert motions(exchange)[-1][0] == QUICK_STOP
    exchange.receive(EMERGENCY, bytes.fromhex("1123010000000000"))
    assert len(gave_up(exchange)) == 1  # the first one is the cause


def test_the_end_of_an_error_is_no_fault() -> None:
    exchange = Exchange().until_running()
    exchange.receive(EMERGENCY, bytes(8))
    assert gave_up(exchange) == []


def test_a_node_that_restarts_while_it_is_armed_is_a_fault() -> None:
    exchange = Exchange().until_running()
    exchange.receive(HEARTBEAT, bytes([BOOTED]))
    assert gave_up(exchange) == [(5, Phase.FAULT, f"node {NODE} has restarted")]
    exchange.tick(60)
    assert motions(exchange)[-1][0] == QUICK_STOP


def test_a_node_that_restarts_before_it_is_armed_is_configured_anew() -> None:
    exchange = Exchange().until_ready()
    written = len(exchange.node.writes)
    exchange.node.is_operational = False
    exchange.receive(HEARTBEAT, bytes([BOOTED]))
    assert not exchange.order(Verb.STATUS).ok  # type: ignore[union-attr]
    exchange.until_ready()
    assert exchange.node.writes[written:] == exchange.node.writes[:written]
    assert gave_up(exchange) == []


def test_a_node_that_leaves_operational_while_it_is_armed_is_a_fault() -> None:
    exchange = Exchange().until_running()
    exchange.receive(HEARTBEAT, bytes([PRE_OPERATIONAL]))
    text = f"node {NODE} left the state operational: its state is 0x7F"
    assert gave_up(exchange) == [(5, Phase.FAULT, text)]


def test_a_drive_that_leaves_operation_by_itself_is_a_fault() -> None:
    exchange = Exchange().until_running()
    exchange.node.status = FAULTY
    exchange.tick()
    assert gave_up(exchange) == [(5, Phase.FAULT, "the drive left operation: fault")]


def test_setpoints_that_do_not_arrive_any_more_are_a_fault_and_a_quick_stop() -> None:
    exchange = Exchange().until_running()
    exchange.setpoint(0.1)
    last_ns = exchange.t_ns
    while exchange.t_ns < last_ns + 100 * MS:
        exchange.tick()
    assert gave_up(exchange) == []
    exchange.tick()
    text = "no setpoint for 105 ms; must be <= 100 ms: the controller does not send"
    assert gave_up(exchange) == [(5, Phase.FAULT, text)]
    assert motions(exchange)[-1] == (QUICK_STOP, 50_000)


def test_after_a_stop_the_drive_stays_enabled_and_follows() -> None:
    exchange = Exchange().until_running()
    assert exchange.order(Verb.STOP).phase is Phase.STOPPED  # type: ignore[union-attr]
    exchange.setpoint(0.01)
    exchange.tick()
    assert motions(exchange)[-1] == (ENABLE, 5000)


def test_an_emergency_stop_is_a_quick_stop_that_no_order_ends() -> None:
    exchange = Exchange().until_running()
    assert exchange.order(Verb.ESTOP).phase is Phase.FAULT  # type: ignore[union-attr]
    sent = len(exchange.frames)
    exchange.tick()
    for verb in (Verb.ARM, Verb.START):
        answer = exchange.order(verb)
        assert answer is not None
        assert not answer.ok
        assert answer.phase is Phase.FAULT
        exchange.tick(2)
    exchange.order(Verb.STOP)
    exchange.tick()
    assert {word for word, _ in motions(exchange, sent)} == {QUICK_STOP}
    assert gave_up(exchange) == []  # ordered, so no request to end


def test_the_end_of_the_task_stops_the_drive_with_a_last_sync() -> None:
    exchange = Exchange().until_running()
    frames = exchange.keep(exchange.master.stop(exchange.t_ns))
    assert [can_id for can_id, _ in frames] == [RPDO_1, SYNC]
    assert struct.unpack("<Hi", frames[0][1])[0] == QUICK_STOP
    silent = Exchange()
    assert list(silent.master.stop(0).sends) == []


def test_late_ticks_are_counted_and_not_repeated() -> None:
    exchange = Exchange().until_running()
    sent = len(exchange.frames)
    exchange.setpoint(0.0)
    exchange.tick_at(exchange.t_ns + 23 * MS)
    assert exchange.master.late_ticks == 3
    assert [f.can_id for f in exchange.frames[sent:]].count(SYNC) == 1
    late_ns = exchange.t_ns
    exchange.tick()
    assert exchange.t_ns == late_ns + 2 * MS  # back on the grid
    assert exchange.master.late_ticks == 3


def test_a_sync_of_1_ms_has_a_heartbeat_every_20_ms() -> None:
    exchange = Exchange(msgspec.structs.replace(SETTINGS, sync_ns=MS)).until_running()
    sent = len(exchange.frames)
    for _ in range(60):
        exchange.setpoint(0.0)
        exchange.tick()
    ids = [f.can_id for f in exchange.frames[sent:]]
    assert (ids.count(SYNC), ids.count(BEAT_OF_MASTER)) == (60, 3)
    assert (0x60C2, 1, b"\x01") in exchange.node.writes


def test_between_two_setpoints_the_targets_of_a_faster_sync_are_on_a_line() -> None:
    exchange = Exchange(msgspec.structs.replace(SETTINGS, sync_ns=MS)).until_running()
    for x_m in (0.001, 0.002, 0.002, -0.001):
        exchange.setpoint(x_m)
        exchange.tick(5)
    targets = [target for _, target in motions(exchange)][-20:]
    assert targets == [
        *range(100, 1001, 100),
        *[1000] * 5,
        *range(700, -501, -300),
    ]


def test_the_task_is_made_from_its_settings_in_json() -> None:
    task = build(msgspec.json.encode(SETTINGS))
    assert task.start(0).wake_ns == 5 * MS


UNEXPECTED = st.builds(
    can_message,
    st.integers(0, 2**29 - 1),
    st.binary(max_size=8),
    is_extended=st.just(True),
    is_remote=st.booleans(),
) | st.builds(
    can_message,
    st.integers(0, 0x7FF),
    st.binary(max_size=8),
    is_remote=st.just(True),
)
OTHERS = st.builds(
    can_message,
    st.integers(0, 0x7FF).filter(lambda can_id: can_id & 0x7F != NODE),
    st.binary(max_size=8),
)
WRONG_LENGTH = st.builds(
    can_message, st.just(TPDO_1) | st.just(EMERGENCY) | st.just(SDO_ANSWER), st.binary(max_size=7)
) | st.builds(can_message, st.just(HEARTBEAT), st.just(b""))


@given(st.lists(UNEXPECTED | OTHERS | WRONG_LENGTH, min_size=1, max_size=30))
@UNTIMED
def test_frames_that_are_not_of_the_exchange_change_nothing(frames: list) -> None:
    exchange, alone = Exchange().until_running(), Exchange().until_running()
    for run in (exchange, alone):
        run.setpoint(0.05)
    for frame in frames:
        assert exchange.give("can_up", frame) == []
    for run in (exchange, alone):
        run.tick(3)
    assert exchange.sent == alone.sent


ANY = st.builds(
    can_message,
    st.sampled_from([0x080, 0x180, 0x280, 0x580, 0x700]).map(lambda base: base + NODE)
    | st.integers(0, 0x7FF),
    st.binary(max_size=8),
)


@given(st.lists(st.lists(ANY, max_size=5), min_size=1, max_size=20))
@UNTIMED
def test_no_frame_of_the_node_moves_a_drive_that_is_not_armed(rounds: list) -> None:
    exchange = Exchange().until_ready()
    for frames in rounds:
        for frame in frames:
            exchange.give("can_up", frame)
        exchange.tick()
    assert {word for word, _ in motions(exchange)} <= {SHUTDOWN, QUICK_STOP}
    assert exchange.node.status != ENABLED


@given(st.lists(st.lists(ANY, max_size=5), min_size=1, max_size=20))
@UNTIMED
def test_no_frame_of_the_node_changes_the_target_of_a_drive_that_runs(rounds: list) -> None:
    exchange = Exchange().until_running()
    exchange.setpoint(0.05)
    exchange.tick()
    sent = len(exchange.frames)
    for frames in rounds:
        for frame in frames:
            answers = exchange.give("can_up", frame)
            assert all(reply.exit in (None, 5) for reply in replies_of(answers))
        exchange.tick()
    assert {target for _, target in motions(exchange, sent)} <= {25_000}
