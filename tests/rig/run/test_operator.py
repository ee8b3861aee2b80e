"""The sequence of the operator: connect, arm, start, run, close; and every way to end early."""

from __future__ import annotations

import pytest

from comms.messages import Command, Phase, Reply, RobotState, Verb
from comms.task import NO_STEP, Step
from rig.run.tasks.operator import (
    ANSWER_TIMEOUT_NS,
    CONNECT_TIMEOUT_NS,
    MIN_START_DELAY_NS,
    RETRY_PERIOD_NS,
    START_GRID_NS,
    Operator,
    Stage,
)

MS = 1_000_000
S = 1_000 * MS
TASKS = ("bench", "controller", "vision", "streamer")
MOVERS = ("controller", "streamer")  # of these tasks
DURATION_NS = 15 * S


def orders(step: Step) -> list[Command]:
    """Commands of a step."""
    return [send.message for send in step.sends if isinstance(send.message, Command)]


def said(step: Step) -> list[tuple[Verb, str]]:
    """Verb and receiver of each order of a step."""
    return [(order.verb, order.to) for order in orders(step)]


def to_all(verb: Verb, tasks: tuple[str, ...] = TASKS) -> list[tuple[Verb, str]]:
    """One order to every task."""
    return [(verb, task) for task in tasks]


class Hand:
    """Operator with hand-fed replies, and a run clock set by the test."""

    def __init__(self, tasks: tuple[str, ...] = TASKS, stop_ns: int = 0) -> None:
        self.operator = Operator(tasks, DURATION_NS, stop_ns)
        self.t_ns = 0
        self.id = 0  # of the last order

    def do(self, step: Step) -> Step:
        """Keep the id of the last order."""
        for order in orders(step):
            self.id = order.id
        return step

    def tick(self, t_ns: int) -> Step:
        """Wake the operator at t_ns."""
        self.t_ns = t_ns
        return self.do(self.operator.on_tick(t_ns))

    def reply(
        self,
        sender: str,
        ok: bool = True,
        text: str = "",
        exit: int | None = None,
        id: int | None = None,
    ) -> Step:
        """Answer the last order, or report with id 0."""
        message = Reply(
            seq=0,
            t_ns=self.t_ns,
            id=self.id if id is None else id,
            sender=sender,
            ok=ok,
            phase=Phase.ARMED,
            text=text,
            exit=exit,
        )
        return self.do(self.operator.on_message("reply", message, self.t_ns))

    def all_reply(self, tasks: tuple[str, ...] = TASKS) -> Step:
        """Confirm for every task; return the last step."""
        id, step = self.id, NO_STEP
        for task in tasks:
            step = self.reply(task, id=id)
        return step

    def until(self, stage: Stage) -> Hand:
        """Confirm all orders up to a stage."""
        self.operator.start(0)
        self.tick(0)
        while self.operator.stage is not stage:
            self.all_reply()
        return self


def test_a_good_run_connects_arms_starts_watches_and_closes() -> None:
    hand = Hand()
    assert hand.operator.start(0) == Step(wake_ns=0)
    assert sorted(said(hand.tick(0))) == sorted(to_all(Verb.STATUS))
    hand.t_ns = 100 * MS
    assert said(hand.all_reply()) == to_all(Verb.ARM)
    starting = hand.all_reply()
    assert said(starting) == to_all(Verb.START)
    t_start_ns = orders(starting)[0].t_start_ns
    assert {order.t_start_ns for order in orders(starting)} == {
        t_start_ns,
        hand.operator.t_start_ns,
    }
    assert [event.text for event in hand.operator.events] == [
        f"armed; t_start = {t_start_ns * 1e-9:.3f} s"
    ]
    running = hand.all_reply()
    assert (hand.operator.stage, running.wake_ns) == (Stage.RUNNING, t_start_ns + DURATION_NS)
    assert hand.tick(t_start_ns + DURATION_NS - 1) == Step(wake_ns=t_start_ns + DURATION_NS)
    closing = hand.tick(t_start_ns + DURATION_NS)
    assert (said(closing), closing.exit) == (to_all(Verb.CLOSE), 0)
    assert (hand.operator.stage, hand.operator.exit_code, hand.operator.reasons) == (
        Stage.CLOSED,
        0,
        [],
    )


@pytest.mark.parametrize("t_ns", [0, 1, 40 * MS, 59 * MS + 999_999, 60 * MS, 12_345_678_901])
def test_t_start_lies_at_least_half_a_second_ahead_on_a_common_multiple_of_all_periods(
    t_ns: int,
) -> None:
    hand = Hand().until(Stage.ARMING)
    hand.t_ns = t_ns
    hand.all_reply()
    t_start_ns = hand.operator.t_start_ns
    assert t_start_ns is not None
    assert MIN_START_DELAY_NS <= t_start_ns - t_ns < MIN_START_DELAY_NS + START_GRID_NS
    assert all(t_start_ns % (period_ms * MS) == 0 for period_ms in (5, 10, 20, 30))


@pytest.mark.parametrize("missing", TASKS)
@pytest.mark.parametrize("stage", [Stage.CONNECTING, Stage.ARMING, Stage.STARTING])
def test_nothing_goes_on_before_the_last_task_has_answered(stage: Stage, missing: str) -> None:
    hand = Hand().until(stage)
    others = tuple(task for task in TASKS if task != missing)
    assert hand.all_reply(others) == NO_STEP
    assert hand.all_reply(others) == NO_STEP, "who answers twice does not answer for another"
    assert hand.operator.stage is stage
    hand.reply(missing)
    assert hand.operator.stage is not stage


def test_while_connecting_it_asks_again_only_those_who_have_not_answered() -> None:
    hand = Hand()
    hand.operator.start(0)
    assert hand.tick(0).wake_ns == RETRY_PERIOD_NS
    hand.all_reply(("bench", "vision"))
    assert sorted(said(hand.tick(RETRY_PERIOD_NS))) == [
        (Verb.STATUS, "controller"),
        (Verb.STATUS, "streamer"),
    ]


def test_an_answer_slower_than_the_retry_is_still_an_answer() -> None:
    hand = Hand()
    hand.operator.start(0)
    first = orders(hand.tick(0))[0].id
    for k in range(1, 4):
        hand.tick(k * RETRY_PERIOD_NS)
    for task in TASKS:
        hand.reply(task, id=first)
    assert hand.operator.stage is Stage.ARMING


def test_an_answer_to_an_earlier_order_does_not_count() -> None:
    hand = Hand().until(Stage.CONNECTING)
    asked = hand.id
    hand.all_reply()
    for task in TASKS:
        assert hand.reply(task, id=asked) == NO_STEP
    assert hand.operator.stage is Stage.ARMING


def test_orders_are_counted_and_those_of_one_round_share_an_id() -> None:
    hand = Hand()
    hand.operator.start(0)
    rounds = [hand.tick(0), hand.all_reply(), hand.all_reply()]
    sent = [order for step in rounds for order in orders(step)]
    assert [order.seq for order in sent] == list(range(1, len(sent) + 1))
    assert [len({order.id for order in orders(step)}) for step in rounds] == [1, 1, 1]
    assert len({order.id for order in sent}) == 3


@pytest.mark.parametrize("stage", [Stage.ARMING, Stage.STARTING])
@pytest.mark.parametrize(
    ("exit", "code", "verb"),
    [
        pytest.param(None, 5, Verb.ESTOP, id="a_refusal_without_a_code_is_a_fault"),
        pytest.param(3, 3, Verb.STOP, id="a_refusal_with_a_code_ends_with_it"),
    ],
)
def test_a_refused_order_stops_the_movers_and_says_why(
    stage: Stage, exit: int | None, code: int, verb: Verb
) -> None:
    hand = Hand().until(stage)
    step = hand.reply("streamer", ok=False, text="the robot stands elsewhere", exit=exit)
    assert said(step) == to_all(verb, ("controller", "streamer"))
    assert (hand.operator.exit_code, hand.operator.reasons) == (
        code,
        ["streamer: the robot stands elsewhere"],
    )
    assert (said(hand.all_reply(MOVERS)), hand.operator.stage) == (to_all(Verb.CLOSE), Stage.CLOSED)


def test_a_task_that_is_not_ready_yet_is_asked_again() -> None:
    hand = Hand().until(Stage.CONNECTING)
    assert hand.reply("controller", ok=False, text="encoders are silent") == NO_STEP
    assert (Verb.STATUS, "controller") in said(hand.tick(RETRY_PERIOD_NS))


def test_a_task_that_never_answers_is_named_with_its_last_refusal() -> None:
    hand = Hand().until(Stage.CONNECTING)
    hand.all_reply(("bench", "vision"))
    hand.reply("controller", ok=False, text="encoders are silent")
    assert hand.tick(CONNECT_TIMEOUT_NS - 1).wake_ns is not None
    assert hand.operator.stage is Stage.CONNECTING
    assert said(hand.tick(CONNECT_TIMEOUT_NS)) == to_all(Verb.ESTOP, ("controller", "streamer"))
    assert hand.operator.exit_code == 5
    assert hand.operator.reasons == [
        "connecting: no answer in time from controller (encoders are silent), streamer"
    ]


def test_the_time_to_connect_counts_from_the_first_status_order() -> None:
    hand = Hand()
    hand.operator.start(20 * S)
    hand.tick(20 * S + CONNECT_TIMEOUT_NS - 1)
    assert hand.operator.stage is Stage.CONNECTING
    hand.tick(20 * S + CONNECT_TIMEOUT_NS)
    assert hand.operator.stage is Stage.STOPPING


@pytest.mark.parametrize("stage", [Stage.ARMING, Stage.STARTING])
def test_an_order_without_an_answer_in_two_seconds_ends_the_run(stage: Stage) -> None:
    hand = Hand().until(stage)
    assert hand.tick(ANSWER_TIMEOUT_NS - 1) == Step(wake_ns=ANSWER_TIMEOUT_NS)
    assert said(hand.tick(ANSWER_TIMEOUT_NS)) == to_all(Verb.ESTOP, ("controller", "streamer"))
    assert hand.operator.reasons == [
        f"{stage.value}: no answer in time from bench, controller, streamer, vision"
    ]


def test_movers_that_do_not_answer_a_stop_are_closed_all_the_same() -> None:
    hand = Hand().until(Stage.RUNNING)
    hand.operator.end("stopped by the operator", 4, S)
    assert hand.tick(S + ANSWER_TIMEOUT_NS - 1) == Step(wake_ns=S + ANSWER_TIMEOUT_NS)
    assert said(hand.tick(S + ANSWER_TIMEOUT_NS)) == to_all(Verb.CLOSE)
    assert hand.operator.exit_code == 4
    assert hand.operator.reasons[-1] == "stopping: no answer in time from controller, streamer"


@pytest.mark.parametrize("stage", [Stage.CONNECTING, Stage.ARMING, Stage.STARTING, Stage.RUNNING])
@pytest.mark.parametrize(("code", "verb"), [(4, Verb.STOP), (3, Verb.STOP), (5, Verb.ESTOP)])
def test_a_stop_goes_to_both_movers_in_any_stage_and_the_run_closes_when_both_obeyed(
    stage: Stage, code: int, verb: Verb
) -> None:
    hand = Hand().until(stage)
    assert said(hand.do(hand.operator.end("enough", code, hand.t_ns))) == to_all(
        verb, ("controller", "streamer")
    )
    assert hand.reply("controller") == NO_STEP
    closing = hand.reply("streamer")
    assert (said(closing), closing.exit) == (to_all(Verb.CLOSE), code)
    assert hand.operator.reasons == ["enough"]


def test_a_second_stop_while_stopping_changes_nothing() -> None:
    hand = Hand().until(Stage.RUNNING)
    hand.operator.end("first", 4, 0)
    assert hand.operator.end("second", 4, 1) == NO_STEP
    assert hand.operator.reasons == ["first"]


def test_an_emergency_while_stopping_in_order_still_goes_out_and_makes_the_exit_code() -> None:
    hand = Hand().until(Stage.RUNNING)
    hand.operator.end("stop from another terminal", 4, 0)
    assert said(hand.operator.end("estop from another terminal", 5, 1)) == to_all(
        Verb.ESTOP, ("controller", "streamer")
    )
    assert hand.operator.end("estop from another terminal", 5, 2) == NO_STEP
    assert hand.operator.exit_code == 5
    assert hand.operator.reasons == ["stop from another terminal", "estop from another terminal"]


def test_a_closed_run_ignores_messages() -> None:
    hand = Hand().until(Stage.RUNNING)
    hand.operator.stop_now("now", 4, 0)
    assert hand.operator.end("again", 5, 1) == NO_STEP
    assert hand.operator.stop_now("again", 5, 1).sends == ()
    assert hand.tick(100 * S) == NO_STEP
    assert hand.operator.exit_code == 4


@pytest.mark.parametrize("stage", [Stage.CONNECTING, Stage.ARMING, Stage.STARTING, Stage.RUNNING])
def test_stopping_now_sends_the_stop_before_the_close_without_waiting(stage: Stage) -> None:
    hand = Hand().until(stage)
    step = hand.operator.stop_now("second Ctrl-C", 4, hand.t_ns)
    assert said(step) == to_all(Verb.STOP, ("controller", "streamer")) + to_all(Verb.CLOSE)
    assert (step.exit, hand.operator.stage) == (4, Stage.CLOSED)


def test_stopping_now_after_an_orderly_stop_closes_at_once() -> None:
    hand = Hand().until(Stage.RUNNING)
    hand.operator.end("first Ctrl-C", 4, 0)
    assert said(hand.operator.stop_now("second Ctrl-C", 4, 1)) == to_all(Verb.CLOSE)


@pytest.mark.parametrize("gone", TASKS)
def test_an_exited_task_stops_the_remaining_movers_and_is_not_waited_for(gone: str) -> None:
    hand = Hand().until(Stage.RUNNING)
    left = tuple(task for task in TASKS if task != gone)
    movers = tuple(task for task in left if task in MOVERS)
    assert said(hand.do(hand.operator.on_task_exit(gone, f"task '{gone}' died", 0))) == to_all(
        Verb.ESTOP, movers
    )
    assert said(hand.all_reply(movers)) == to_all(Verb.CLOSE, left)
    assert (hand.operator.exit_code, hand.operator.reasons) == (5, [f"task '{gone}' died"])


def test_a_run_with_both_movers_exited_closes_without_waiting() -> None:
    hand = Hand().until(Stage.RUNNING)
    hand.operator.on_task_exit("controller", "task 'controller' died", 0)
    assert said(hand.operator.on_task_exit("streamer", "task 'streamer' died", 1)) == to_all(
        Verb.CLOSE, ("bench", "vision")
    )


def test_the_last_awaited_mover_may_exit_while_stopping() -> None:
    hand = Hand().until(Stage.RUNNING)
    hand.do(hand.operator.end("gate", 5, 0))
    hand.reply("streamer")
    assert said(hand.operator.on_task_exit("controller", "task 'controller' died", 1)) == to_all(
        Verb.CLOSE, ("bench", "vision", "streamer")
    )


@pytest.mark.parametrize(("code", "verb"), [(3, Verb.STOP), (5, Verb.ESTOP)])
def test_a_report_with_an_exit_code_ends_the_run_with_it(code: int, verb: Verb) -> None:
    hand = Hand().until(Stage.RUNNING)
    step = hand.reply("streamer", ok=False, text="the load swings", exit=code, id=0)
    assert said(step) == to_all(verb, ("controller", "streamer"))
    assert (hand.operator.exit_code, hand.operator.reasons) == (code, ["streamer: the load swings"])
    assert [event.text for event in hand.operator.events][-1] == "streamer: the load swings"
    assert [event.text for event in hand.operator.events].count("streamer: the load swings") == 1


def test_a_report_without_an_exit_code_is_only_logged() -> None:
    hand = Hand().until(Stage.RUNNING)
    assert hand.reply("streamer", text="the load swings 0.1 mrad", id=0) == NO_STEP
    event = hand.operator.events[-1]
    assert (event.level, event.text) == ("info", "streamer: the load swings 0.1 mrad")
    assert hand.operator.stage is Stage.RUNNING


def test_a_report_of_a_fault_after_the_stop_is_logged() -> None:
    hand = Hand().until(Stage.RUNNING)
    hand.operator.end("gate", 5, 0)
    assert hand.reply("controller", ok=False, text="no reference", exit=5, id=0) == NO_STEP
    assert hand.operator.events[-1].text == "controller: no reference"


def test_a_stop_of_the_operator_is_a_warning_and_a_fault_an_error() -> None:
    levels = []
    for code in (4, 5):
        hand = Hand().until(Stage.RUNNING)
        hand.operator.end("why", code, 0)
        levels.append(hand.operator.events[-1].level)
    assert levels == ["warning", "error"]


def test_a_message_that_is_no_reply_is_ignored() -> None:
    place = (0.0, 0.0, 0.0)
    state = RobotState(
        seq=0,
        t_ns=0,
        t_actual_ns=0,
        commanded_m=place,
        actual_m=place,
        actual_velocity_m_s=place,
        phase=Phase.FAULT,
    )
    assert Hand().operator.on_message("robot_state", state, 0) == NO_STEP


def test_a_rig_without_vision_runs_too() -> None:
    tasks = ("bench", "controller", "streamer")
    hand = Hand(tasks)
    hand.operator.start(0)
    hand.tick(0)
    for _ in range(3):
        hand.all_reply(tasks)
    assert hand.operator.stage is Stage.RUNNING
    assert hand.operator.stop(0) == NO_STEP


def test_after_a_stop_the_run_is_closed_only_when_the_robot_had_the_time_to_run_out() -> None:
    hand = Hand(stop_ns=700 * MS).until(Stage.RUNNING)
    hand.t_ns = stopped_ns = (hand.operator.t_start_ns or 0) + 100 * MS
    hand.do(hand.operator.end("stop", 4, stopped_ns))
    hand.all_reply(MOVERS)
    assert hand.operator.stage is Stage.RESTING
    assert said(hand.tick(stopped_ns + 1_099 * MS)) == []
    assert said(hand.tick(stopped_ns + 1_100 * MS)) == to_all(Verb.CLOSE)
