"""The one transition function of controller and streamer, pair by pair."""

from __future__ import annotations

from itertools import product

import pytest

from comms.messages import Phase, Verb
from rig.run.tasks.controller.phase import ORDERS, Trigger, next_phase, refusal

TABLE = """
          arm     start   stop    estop reference_stale robot_stale envelope_left not_following
  idle    armed   idle    stopped fault idle            idle        idle          idle
  armed   armed   running stopped fault armed           fault       armed         fault
  running running running stopped fault stopped         fault       fault         fault
  stopped stopped stopped stopped fault stopped         stopped     stopped       stopped
  fault   fault   fault   fault   fault fault           fault       fault         fault
"""
TRIGGERS, *ROWS = [line.split() for line in TABLE.strip().splitlines()]
TRANSITIONS = [
    (Phase(row[0]), Trigger(trigger), Phase(after))
    for row in ROWS
    for trigger, after in zip(TRIGGERS, row[1:], strict=True)
]


def test_the_table_names_every_pair_of_phase_and_trigger_once() -> None:
    pairs = [(phase, trigger) for phase, trigger, _ in TRANSITIONS]
    assert sorted(pairs, key=str) == sorted(product(Phase, Trigger), key=str)


@pytest.mark.parametrize(("phase", "trigger", "after"), TRANSITIONS)
def test_a_phase_is_followed_by_the_one_in_the_table(
    phase: Phase, trigger: Trigger, after: Phase
) -> None:
    assert next_phase(phase, trigger) is after


@pytest.mark.parametrize("phase", Phase)
def test_an_emergency_stop_always_ends_in_fault(phase: Phase) -> None:
    assert next_phase(phase, Trigger.ESTOP) is Phase.FAULT


@pytest.mark.parametrize("trigger", Trigger)
def test_nothing_leaves_fault(trigger: Trigger) -> None:
    assert next_phase(Phase.FAULT, trigger) is Phase.FAULT


@pytest.mark.parametrize("trigger", [h for h in Trigger if h is not Trigger.ESTOP])
def test_only_an_emergency_stop_leaves_stopped(trigger: Trigger) -> None:
    assert next_phase(Phase.STOPPED, trigger) is Phase.STOPPED


def test_no_trigger_after_a_stop_makes_the_robot_run_again() -> None:
    for phase, later in product(Phase, product(Trigger, repeat=3)):
        now = next_phase(phase, Trigger.STOP)
        for trigger in later:
            now = next_phase(now, trigger)
        assert now in (Phase.STOPPED, Phase.FAULT)


@pytest.mark.parametrize(("phase", "verb"), list(product(Phase, Verb)))
def test_arm_and_start_are_taken_only_where_they_change_something_or_repeat_it(
    phase: Phase, verb: Verb
) -> None:
    allowed = {Verb.ARM: {Phase.IDLE, Phase.ARMED}, Verb.START: {Phase.ARMED}}.get(verb, set(Phase))
    why = refusal(phase, verb)
    assert (why is None) == (phase in allowed)


def test_a_refusal_names_order_phase_and_bound() -> None:
    assert (
        refusal(Phase.STOPPED, Verb.START)
        == "start refused: stopped; must be armed: end this run and start a new one"
    )


@pytest.mark.parametrize("verb", [Verb.STOP, Verb.ESTOP])
def test_a_stop_is_taken_in_every_phase(verb: Verb) -> None:
    assert all(refusal(phase, verb) is None for phase in Phase)
    assert ORDERS[verb] in (Trigger.STOP, Trigger.ESTOP)
