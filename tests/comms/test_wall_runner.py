"""Runner with real sockets: start, commands, replies, ledger, and the loss of the operator."""

from __future__ import annotations

import gc
import os
import re
import select
import threading
from collections.abc import Iterator

import msgspec
import pytest
import zmq

from comms import frames, operator_bus, runner
from comms.bus_content import Hello, Record, StreamEnd, Telemetry
from comms.clock import MonotonicClock, new_run_clock
from comms.codec import Closing, decode, encode, encode_closing
from comms.endpoints import choose_ports, endpoints
from comms.ends import ChannelReceiver, Wiring
from comms.link import LinkCount, LinkFaults, LinkModel, merge_counts
from comms.messages import (
    Command,
    LinkMotion,
    Message,
    Phase,
    Reference,
    Reply,
    RobotState,
    Truth,
    Verb,
)
from comms.operator_bus import Context, OperatorBus
from comms.records import Event, LinkRow, Receipts, TaskTiming
from comms.runner import ORPHANED, WallRunner
from comms.stop_port import send_stop
from comms.task import NO_STEP, Send, Step
from comms.udp import UdpReceiver, UdpSender
from tests.comms.wire_reference import SESSION, Gate

HOST, MS = "127.0.0.1", 1_000_000
LOOKS, LOOK_MS = 250, 20  # five seconds in all; only a failure takes them
PACKETS = 40
LOSSY = LinkFaults(loss=0.3, delay_ms=15.0)
ZERO = (0.0, 0.0, 0.0)


class Echo:
    """Controller that answers each Reference with a RobotState of the same sequence number.

    It sends a last one when stopped.
    """

    name = "controller"

    def __init__(self) -> None:
        self.late_ticks = 0
        self.started = self.stopped = False
        self.wakes: list[tuple[int, int]] = []  # (requested, served) [ns]
        self.verbs: list[Verb] = []
        self.stop_order_ns = self.stop_ns = 0

    def start(self, t_ns: int) -> Step:
        """Request the first tick."""
        self.started = True
        self._wake_ns = t_ns + 5 * MS
        return Step(wake_ns=self._wake_ns)

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Answer commands by their verb, references by their number; estop exits with code 4."""
        if isinstance(message, Command):
            self.verbs.append(message.verb)
            if message.verb is Verb.STOP:
                self.stop_order_ns = t_ns
            text = message.verb.value
            reply = Reply(
                seq=0,
                t_ns=t_ns,
                id=message.id,
                sender=self.name,
                ok=True,
                phase=Phase.ARMED,
                text=text,
            )
            return Step(
                [Send("reply", reply, t_ns)], exit=4 if message.verb is Verb.ESTOP else None
            )
        return Step([Send("robot_state", state(message.seq, t_ns), t_ns)])

    def on_tick(self, t_ns: int) -> Step:
        """Record the time and request the next tick."""
        self.wakes.append((self._wake_ns, t_ns))
        self._wake_ns = t_ns + 5 * MS
        return Step(wake_ns=self._wake_ns)

    def stop(self, t_ns: int) -> Step:
        """Send the last state."""
        self.stopped, self.stop_ns = True, t_ns
        return Step([Send("robot_state", state(PACKETS, t_ns), t_ns)])


class Bench(Echo):
    """Simulated bench that sends one truth on each message."""

    name = "bench"

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Send a truth, and the reply of Echo."""
        link = LinkMotion(angle_x_rad=0.1, angle_y_rad=0.0, rate_x_rad_s=0.0, rate_y_rad_s=0.0)
        truth = Truth(seq=0, t_ns=t_ns, position_m=ZERO, velocity_m_s=ZERO, links=(link,))
        step = super().on_message(channel, message, t_ns)
        return step._replace(sends=[Send("truth", truth, t_ns), *step.sends])

    def stop(self, t_ns: int) -> Step:
        """No shutdown action."""
        return NO_STEP


def state(seq: int, t_ns: int) -> RobotState:
    """A robot that stands still."""
    return RobotState(
        seq=seq,
        t_ns=t_ns,
        t_actual_ns=t_ns,
        commanded_m=ZERO,
        actual_m=ZERO,
        actual_velocity_m_s=ZERO,
        phase=Phase.ARMED,
    )


def reference(seq: int) -> bytes:
    """An encoded reference."""
    return encode("reference", Reference(seq=seq, t_ns=0, t_target_ns=0, position_m=ZERO), SESSION)


class Operator:
    """Test side of a run: the bus, the other ends of the channels, the runner in a thread."""

    def __init__(self, context: Context, task: Echo) -> None:
        self.task = task
        self.ends = endpoints(HOST, choose_ports(HOST, 0), None)
        self.bus = OperatorBus(context, [task.name], SESSION, self.ends.addresses)
        self.clock: MonotonicClock = new_run_clock()
        ports = self.ends.ports["robot_state"]
        self.states = UdpReceiver(HOST, ports.receiver, "robot_state", ports.sender)
        self.heard: list[object] = []
        self.exit_codes: list[int] = []
        self._thread: threading.Thread | None = None

    def launch(self, pipe: int | None = None, **changes: object) -> None:
        """Start the runner in a thread; pipe, changes: of the runner and its wiring."""
        wiring = Wiring(
            session=SESSION,
            seed=5,
            zero_ns=self.clock.zero_ns,
            host=HOST,
            ports=dict(self.ends.ports),
            addresses=dict(self.ends.addresses),
            faults={"robot_state": LOSSY},
        )
        wiring = msgspec.structs.replace(wiring, **changes)
        wall = WallRunner(self.task, wiring, self.clock, pipe)
        self._thread = threading.Thread(target=lambda: self.exit_codes.append(wall.run()))
        self._thread.start()

    def sender(self, channel: str) -> UdpSender:
        """The other end of an input of the task."""
        ports = self.ends.ports[channel]
        return UdpSender(HOST, ports.receiver, ports.sender, channel)

    def order(self, verb: Verb, number: int) -> None:
        """Send a command."""
        self.bus.send(
            Command(seq=number, t_ns=self.clock.now_ns(), id=number, to=self.task.name, verb=verb)
        )

    def hears(self, wanted: type, count: int = 1, *, beat: bool = True) -> None:
        """Read until `count` messages of a type arrived; beat: heartbeats after the Hello."""
        for _ in range(LOOKS):
            self.heard += [message for _, message in self.bus.drain()]
            if len(self.all(wanted)) >= count:
                return
            if beat and self.all(Hello):
                self.bus.heartbeat(self.task.name)
            self.bus.wait(LOOK_MS)
        pytest.fail(f"{count} x {wanted.__name__} expected, received {self.heard}")

    def all(self, wanted: type) -> list[object]:
        """All messages of a type that arrived; a record by its own type."""
        found = [m.record if isinstance(m, Record) else m for m in self.heard]
        return [message for message in found if isinstance(message, wanted)]

    def rows(self) -> dict[str, LinkCount]:
        """The link rows of the closing report."""
        return {row.channel: row.count for row in self.all(LinkRow) if isinstance(row, LinkRow)}

    def exit_code(self) -> int:
        """Exit code that the runner returned."""
        assert self._thread is not None
        self._thread.join(LOOKS * LOOK_MS / 1000)
        assert not self._thread.is_alive()
        return self.exit_codes[0]


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short timeouts for a task whose inputs are not closed and whose frames are not read."""
    monkeypatch.setattr(runner, "DRAIN_NS", 20 * MS)
    monkeypatch.setattr(frames, "LINGER_MS", 0)


@pytest.fixture
def alone(quick: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Short timeouts for a task without an operator."""
    monkeypatch.setattr(operator_bus, "LINGER_MS", 0)
    monkeypatch.setattr(runner, "START_TIMEOUT_NS", 100 * MS)


def operator_of(task: Echo) -> Iterator[Operator]:
    """An operator; its sockets are closed after the test."""
    context: Context = zmq.Context()
    operator = Operator(context, task)
    yield operator
    operator.states.close()
    operator.bus.close()
    context.destroy(0)
    gc.unfreeze()  # the runner freezes the objects of its process


@pytest.fixture
def operator() -> Iterator[Operator]:
    """The operator of an echoing controller."""
    yield from operator_of(Echo())


@pytest.fixture
def bench_operator(quick: None) -> Iterator[Operator]:
    """The operator of a bench."""
    yield from operator_of(Bench())


def echoes(operator: Operator) -> tuple[Gate, list[RobotState], list[int], Closing]:
    """Messages on robot_state up to the closing datagram, with their counts and ages."""
    gate, got, ages_ns = Gate("robot_state"), list[RobotState](), list[int]()
    for _ in range(LOOKS):
        select.select([operator.states], [], [], LOOK_MS / 1000)
        for data in operator.states.drain():
            now_ns = operator.clock.now_ns()
            item = decode("robot_state", data, SESSION)
            if isinstance(item, Closing):
                return gate, got, ages_ns, item
            message, _ = gate.admit(item, now_ns, late_ns=10**9)
            if isinstance(message, RobotState):
                got.append(message)
                ages_ns.append(now_ns - message.t_ns)
    pytest.fail(f"no closing datagram after {len(got)} echoes")


def close_inputs(operator: Operator, references: UdpSender, count: int) -> None:
    """Send the closing datagram on both inputs of the controller."""
    references.send(encode_closing("reference", count, 0, SESSION))
    joints = operator.sender("joint_state")
    joints.send(encode_closing("joint_state", 0, 0, SESSION))
    joints.close()


def test_a_task_starts_answers_commands_and_leaves_a_balanced_ledger(
    operator: Operator,
) -> None:
    operator.launch()
    operator.hears(Hello)
    assert not operator.task.started  # not before the first heartbeat
    operator.bus.heartbeat("controller")
    operator.order(Verb.STATUS, 7)
    operator.hears(Reply)
    assert [(r.id, r.text) for r in operator.all(Reply) if isinstance(r, Reply)] == [(7, "status")]

    references = operator.sender("reference")
    sent = [reference(seq) for seq in range(PACKETS)]
    copy = sent[-1]
    cut = sent[0][:-1]
    wrong_crc = reference(0)[:-4] + b"\0\0\0\0"
    for data in (*sent, copy, cut, wrong_crc):
        references.send(data)
    operator.hears(Telemetry, PACKETS)
    close_inputs(operator, references, PACKETS + 3)
    references.close()
    operator.order(Verb.CLOSE, 8)
    gate, got, ages_ns, closing = echoes(operator)
    operator.hears(StreamEnd, 2)
    assert operator.exit_code() == 0
    assert operator.task.stopped

    rows = operator.rows()
    assert rows.keys() == {"reference", "joint_state", "setpoint", "robot_state", "platform_1"}
    assert rows["reference"] == LinkCount(
        delivered=PACKETS,
        late=rows["reference"].late,
        duplicated=1,
        rejected={"length": 1, "crc": 1},
    )
    # sent once each, the cut and the damaged one too: the copy is outside the sum
    assert merge_counts(LinkCount(sent=PACKETS + 2), rows["reference"]).unaccounted == 0
    model = LinkModel(LOSSY, 5, 6)
    kept = [seq for seq in range(PACKETS + 1) if model.delay_ns(seq) is not None]
    assert [message.seq for message in got] == kept  # with the last one, sent at the stop
    assert rows["robot_state"] == LinkCount(sent=PACKETS + 1, lost_link=PACKETS + 1 - len(kept))
    assert closing == Closing(len(kept))
    assert merge_counts(rows["robot_state"], gate.count).unaccounted == 0
    assert min(ages_ns) >= 15 * MS  # the configured delay; never early


def test_every_message_is_copied_to_telemetry_once_and_every_receipt_is_written(
    operator: Operator,
) -> None:
    operator.launch()
    operator.hears(Hello)
    references = operator.sender("reference")
    for seq in (0, 2, 1, 2):
        references.send(reference(seq))
    operator.hears(Telemetry, 2)
    close_inputs(operator, references, 4)
    references.close()
    operator.order(Verb.CLOSE, 1)
    operator.hears(StreamEnd, 2)
    assert operator.exit_code() == 0
    operator.hears(Telemetry, 3)
    copies = [
        decode(copy.channel, copy.data, SESSION)
        for copy in operator.all(Telemetry)
        if isinstance(copy, Telemetry)
    ]
    numbers = [copy.seq for copy in copies if isinstance(copy, RobotState)]
    assert numbers == [0, 2, PACKETS]  # including those that the link loses
    rows = []
    for record in operator.all(Receipts):
        assert isinstance(record, Receipts)
        rows += record.rows
    assert [(seq, outcome) for seq, _, outcome in rows] == [
        (0, ""),
        (2, ""),
        (1, "superseded"),
        (2, "duplicate"),
    ]
    row = operator.rows()["reference"]
    assert (row.delivered, row.superseded, row.duplicated, row.rejected) == (3, 1, 1, {})
    assert merge_counts(LinkCount(sent=3), row).unaccounted == 0


def test_an_overtaken_reference_is_counted_and_does_not_reach_the_task(
    operator: Operator,
) -> None:
    operator.launch()
    operator.hears(Hello)
    references = operator.sender("reference")
    for seq in (5, 3, 4, 9):
        references.send(reference(seq))
    operator.hears(Telemetry, 2)
    close_inputs(operator, references, 4)
    references.close()
    operator.order(Verb.CLOSE, 1)
    operator.hears(StreamEnd, 2)
    assert operator.exit_code() == 0
    operator.hears(Telemetry, 3)
    copies = [copy for copy in operator.all(Telemetry) if isinstance(copy, Telemetry)]
    answers = [decode(copy.channel, copy.data, SESSION) for copy in copies]
    assert [a.seq for a in answers if isinstance(a, RobotState)] == [5, 9, PACKETS]
    row = operator.rows()["reference"]
    assert (row.delivered, row.superseded) == (4, 2)
    assert merge_counts(LinkCount(sent=4), row).unaccounted == 0


def test_a_stranger_on_the_machine_reaches_neither_task_nor_ledger(
    operator: Operator, quick: None
) -> None:
    operator.launch()
    operator.hears(Hello)
    operator.bus.heartbeat("controller")
    references = operator.sender("reference")
    stranger = UdpSender(HOST, operator.ends.ports["reference"].receiver, 0, "a stranger")
    for seq in range(5):
        stranger.send(reference(100 + seq))  # knows even the session
        stranger.send(b"junk")
        references.send(reference(seq))
    operator.hears(Telemetry, 5)
    operator.order(Verb.CLOSE, 1)
    operator.hears(StreamEnd, 2)
    assert operator.exit_code() == 0
    row = operator.rows()["reference"]
    assert (row.delivered, row.rejected, row.duplicated, row.foreign) == (5, {}, 0, 0)
    references.close()
    stranger.close()


class AtTheClose(MonotonicClock):
    """Clock that stands from the close on, but for a step at each look."""

    stands_at_ns, steps_ns = 0, 0

    def now_ns(self) -> int:
        """Read the time."""
        if not self.stands_at_ns:
            return super().now_ns()
        self.stands_at_ns += self.steps_ns
        return self.stands_at_ns


def drained_ms(
    operator: Operator, monkeypatch: pytest.MonkeyPatch, closed: list[str], **changes: object
) -> float:
    """Time that the controller goes on reading after its close; closed: inputs that end."""
    clock = AtTheClose(operator.clock.zero_ns)

    class Stopped(Echo):
        """Task at whose stop the clock is stopped as well."""

        def stop(self, t_ns: int) -> Step:
            clock.stands_at_ns, clock.steps_ns = t_ns, MS
            self.stop_ns = t_ns
            return NO_STEP

    monkeypatch.setattr(runner, "DRAIN_POLL_S", 0.0)
    operator.clock, operator.task = clock, Stopped()
    operator.launch(None, operator_silent_ns=3_600_000 * MS, **changes)
    operator.hears(Hello)
    operator.bus.heartbeat("controller")
    for name in closed:
        sender = operator.sender(name)
        sender.send(encode_closing(name, 0, 0, SESSION))
        sender.close()
    operator.order(Verb.STATUS, 1)
    operator.hears(Reply)
    operator.order(Verb.CLOSE, 2)
    operator.hears(StreamEnd, 2)
    assert operator.exit_code() == 0
    return (clock.stands_at_ns - operator.task.stop_ns) / MS


INPUTS = ["reference", "joint_state"]
LOOKS_AT_THE_CLOSE_MS = 30  # looks at the clock beside those of the wait


@pytest.mark.parametrize("closed", [[], INPUTS[:1], INPUTS[1:]])
def test_a_task_reads_for_200_ms_after_its_close_while_an_input_is_open(
    operator: Operator, monkeypatch: pytest.MonkeyPatch, closed: list[str]
) -> None:
    waited_ms = drained_ms(operator, monkeypatch, closed)
    assert 200 <= waited_ms <= 200 + LOOKS_AT_THE_CLOSE_MS


def test_the_closing_datagrams_of_all_inputs_end_the_wait_at_once(
    operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert drained_ms(operator, monkeypatch, INPUTS) <= LOOKS_AT_THE_CLOSE_MS


def test_the_wait_after_the_close_lasts_the_longest_delay_of_a_link_more(
    operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    faults = {
        "reference": LinkFaults(delay_ms=300.0, jitter_ms=150.0),
        "joint_state": LinkFaults(delay_ms=20.0),
        "angle_1": LinkFaults(delay_ms=5000.0),  # of another task
    }
    waited_ms = drained_ms(operator, monkeypatch, [], faults=faults)
    assert 650 <= waited_ms <= 650 + LOOKS_AT_THE_CLOSE_MS


def test_no_tick_is_early_and_the_lateness_of_each_is_recorded(
    operator: Operator, quick: None
) -> None:
    operator.launch()
    operator.hears(Hello)
    operator.hears(TaskTiming)
    operator.order(Verb.CLOSE, 1)
    operator.hears(StreamEnd, 2)
    assert operator.exit_code() == 0
    lateness_ns = []
    for record in operator.all(TaskTiming):
        assert isinstance(record, TaskTiming)
        lateness_ns += record.lateness_ns
    wakes = operator.task.wakes
    assert all(requested_ns <= served_ns for requested_ns, served_ns in wakes)
    assert lateness_ns == [served_ns - requested_ns for requested_ns, served_ns in wakes]


def test_a_task_may_end_the_run_with_a_code_of_its_own(operator: Operator, quick: None) -> None:
    operator.launch()
    operator.hears(Hello)
    operator.bus.heartbeat("controller")
    operator.order(Verb.ESTOP, 1)
    operator.hears(StreamEnd, 2)
    assert operator.exit_code() == 4


def test_the_truth_goes_to_the_operator_and_into_the_ledger(bench_operator: Operator) -> None:
    operator = bench_operator
    operator.launch()
    operator.hears(Hello)
    operator.bus.heartbeat("bench")
    operator.order(Verb.STATUS, 1)
    operator.hears(Telemetry)
    operator.order(Verb.CLOSE, 2)
    operator.hears(StreamEnd, 2)
    assert operator.exit_code() == 0
    copies = [copy for copy in operator.all(Telemetry) if isinstance(copy, Telemetry)]
    assert [copy.channel for copy in copies] == ["truth"]
    assert operator.rows()["truth"] == LinkCount(sent=1)


def started_controller(operator: Operator, pipe: int | None = None, **changes: object) -> None:
    """Launch the task and wait until it is started."""
    operator.launch(pipe, **changes)
    operator.hears(Hello)
    operator.bus.heartbeat("controller")
    operator.order(Verb.STATUS, 1)
    operator.hears(Reply)


def test_a_task_that_loses_its_operator_stops_and_exits(
    operator: Operator, alone: None, capsys: pytest.CaptureFixture[str]
) -> None:
    started_controller(operator, operator_silent_ns=100 * MS, orphan_ns=20 * MS)
    operator.bus.close()
    assert operator.exit_code() == ORPHANED == 5
    said = capsys.readouterr().err
    assert re.search(
        r"controller: no message from the operator for \d+ ms; must be <= 100 ms "
        r"\(safety.operator_silent_ms\)",
        said,
    )
    assert operator.task.stopped


def test_a_task_whose_operator_is_silent_stops_the_robot_and_reports_it_before_it_exits(
    operator: Operator, alone: None
) -> None:
    started_controller(operator, operator_silent_ns=100 * MS, orphan_ns=100 * MS)
    operator.hears(StreamEnd, 2, beat=False)
    assert operator.exit_code() == ORPHANED
    _, report = [r for r in operator.all(Reply) if isinstance(r, Reply)]
    assert (report.id, report.ok, report.exit) == (0, False, ORPHANED)
    assert report.text.startswith("no message from the operator for")
    assert operator.task.verbs == [Verb.STATUS, Verb.STOP]
    stop_ns, close_ns = operator.task.stop_order_ns, operator.task.stop_ns
    assert close_ns - stop_ns >= 100 * MS  # the robot has the time to come to rest


def test_the_death_of_the_operators_process_stops_the_robot_whatever_the_bound_of_its_silence(
    operator: Operator, alone: None, capsys: pytest.CaptureFixture[str]
) -> None:
    reading, writing = os.pipe()
    started_controller(operator, reading, operator_silent_ns=3_600_000 * MS, orphan_ns=20 * MS)
    operator.hears(TaskTiming, 2)  # an open pipe keeps it from nothing
    os.close(writing)
    assert operator.exit_code() == ORPHANED
    os.close(reading)
    assert operator.task.verbs[-1] is Verb.STOP
    assert "controller: the process of the operator has exited" in capsys.readouterr().err


def test_the_death_of_the_operators_process_ends_a_task_that_waits_for_its_start(
    operator: Operator, quick: None, capsys: pytest.CaptureFixture[str]
) -> None:
    reading, writing = os.pipe()
    operator.launch(reading)
    operator.hears(Hello, beat=False)
    os.close(writing)
    assert operator.exit_code() == ORPHANED
    os.close(reading)
    assert not operator.task.started
    assert "the process of the operator has exited" in capsys.readouterr().err


def test_a_task_without_a_heartbeat_exits_without_having_started(
    operator: Operator, alone: None, capsys: pytest.CaptureFixture[str]
) -> None:
    operator.launch()
    assert operator.exit_code() == ORPHANED
    assert "no heartbeat of the operator within 100 ms" in capsys.readouterr().err
    assert not operator.task.started


def test_more_commands_than_one_drain_reads_are_all_answered(
    operator: Operator, quick: None
) -> None:
    operator.launch()
    operator.hears(Hello)
    operator.bus.heartbeat("controller")
    count = 3 * operator_bus.DRAIN_LIMIT
    for number in range(1, count + 1):
        operator.order(Verb.STATUS, number)
    operator.hears(Reply, count)
    operator.order(Verb.CLOSE, count + 1)
    operator.hears(StreamEnd, 2)
    assert operator.exit_code() == 0
    answered = [r.id for r in operator.all(Reply) if isinstance(r, Reply)]
    assert answered == list(range(1, count + 1))


def test_a_tick_that_is_due_is_served_before_every_read(
    operator: Operator, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each read takes longer than the period of the ticks, as under a flood."""
    served: list[str] = []

    class Ticking(Echo):
        """Task that notes its ticks."""

        def on_tick(self, t_ns: int) -> Step:
            served.append("tick")
            return super().on_tick(t_ns)

    class SlowClock(MonotonicClock):
        """Clock on which the reads take their time."""

        reads_ns = 0

        def now_ns(self) -> int:
            return super().now_ns() + self.reads_ns

    def read(receiver: ChannelReceiver, clock: SlowClock) -> list[Message]:
        clock.reads_ns += 6 * MS
        served.append(receiver.name)
        return []

    monkeypatch.setattr(ChannelReceiver, "read", read)
    operator.task = Ticking()
    operator.clock = SlowClock(operator.clock.zero_ns)
    operator.launch()
    operator.hears(Hello)
    operator.hears(TaskTiming, 2)
    operator.order(Verb.CLOSE, 1)
    operator.hears(StreamEnd, 2)
    assert operator.exit_code() == 0
    while served[-1] != "tick":  # the reads after the last tick are those of the shutdown
        served.pop()
    first = served.index("tick")
    reads_between_ticks = "".join(name[0] for name in served[first:]).split("t")
    assert {"reference", "joint_state"} <= set(served)
    assert max(len(reads) for reads in reads_between_ticks) == 1


@pytest.mark.parametrize(
    ("request_name", "verb", "code"), [("stop", Verb.STOP, 4), ("estop", Verb.ESTOP, 5)]
)
def test_a_stop_datagram_stops_the_task_once_and_reports_it_and_junk_does_nothing(
    operator: Operator, alone: None, request_name: str, verb: Verb, code: int
) -> None:
    key, port = bytes(range(16)), operator.ends.stop_ports["controller"]
    started_controller(operator, stop_ports={"controller": port}, stop_key=key.hex())
    send_stop(port, key[:-1] + b"x", request_name)
    send_stop(port, key, "start")
    for _ in range(3):
        send_stop(port, key, request_name)
    operator.hears(Reply, 2)
    if verb is Verb.STOP:  # an estop ends this task
        operator.hears(TaskTiming, len(operator.all(TaskTiming)) + 2)
        operator.order(Verb.CLOSE, 2)
    operator.hears(StreamEnd, 2)
    _, report = [r for r in operator.all(Reply) if isinstance(r, Reply)]
    assert operator.task.verbs == [Verb.STATUS, verb]
    assert (report.ok, report.exit, report.id) == (False, code, 0)
    assert report.text == f"{request_name} at the stop port, past the operator"
    texts = [e.text for e in operator.all(Event) if isinstance(e, Event)]
    assert texts == ["2 foreign datagrams at the stop port were ignored"]
    operator.exit_code()
