"""Where controller and streamer stand: one total function, and which orders are taken where."""

from __future__ import annotations

import enum

from comms.messages import Phase, Verb


class Trigger(enum.Enum):
    """What can change the phase."""

    ARM = "arm"
    START = "start"
    STOP = "stop"
    ESTOP = "estop"
    REFERENCE_STALE = "reference_stale"  # the streamer fell silent
    ROBOT_STALE = "robot_stale"  # the robot's encoders fell silent


ORDERS = {
    Verb.ARM: Trigger.ARM,
    Verb.START: Trigger.START,
    Verb.STOP: Trigger.STOP,
    Verb.ESTOP: Trigger.ESTOP,
}
_TAKEN_IN = {
    Verb.ARM: (Phase.IDLE, Phase.ARMED),
    Verb.START: (Phase.ARMED,),
}  # a stop is taken anywhere
_NEXT: dict[tuple[Phase, Trigger], Phase] = {
    (Phase.IDLE, Trigger.ARM): Phase.ARMED,
    (
        Phase.IDLE,
        Trigger.STOP,
    ): Phase.STOPPED,  # an order to arm that comes after the stop is refused
    (Phase.ARMED, Trigger.ARM): Phase.ARMED,
    (Phase.ARMED, Trigger.START): Phase.RUNNING,
    (Phase.ARMED, Trigger.STOP): Phase.STOPPED,
    (Phase.RUNNING, Trigger.STOP): Phase.STOPPED,
    (Phase.RUNNING, Trigger.REFERENCE_STALE): Phase.STOPPED,
    (Phase.ARMED, Trigger.ROBOT_STALE): Phase.FAULT,
    (Phase.RUNNING, Trigger.ROBOT_STALE): Phase.FAULT,
}


def next_phase(phase: Phase, happening: Trigger) -> Phase:
    """The phase after a happening. An emergency stop always ends in FAULT, which nothing leaves but a new run."""
    if happening is Trigger.ESTOP:
        return Phase.FAULT
    return _NEXT.get((phase, happening), phase)


def refusal(phase: Phase, verb: Verb) -> str | None:
    """Why an order cannot be taken in a phase; None when it can."""
    taken_in = _TAKEN_IN.get(verb, tuple(Phase))
    if phase in taken_in:
        return None
    bound = " or ".join(p.value for p in taken_in)
    return f"{verb.value} refused: {phase.value}; must be {bound}: end this run and start a new one"
