"""Phase transitions of controller and streamer: one total function, and the orders per phase."""

from __future__ import annotations

import enum

from comms.messages import Phase, Verb


class Trigger(enum.Enum):
    """Event that may cause a phase transition."""

    ARM = "arm"
    START = "start"
    STOP = "stop"
    ESTOP = "estop"
    REFERENCE_STALE = "reference_stale"  # no reference from the streamer
    ROBOT_STALE = "robot_stale"  # no joint state from the encoders
    ENVELOPE_LEFT = "envelope_left"  # a setpoint beyond the bounds of [safety]
    NOT_FOLLOWING = "not_following"  # the encoders are far from the setpoint


ORDERS = {
    Verb.ARM: Trigger.ARM,
    Verb.START: Trigger.START,
    Verb.STOP: Trigger.STOP,
    Verb.ESTOP: Trigger.ESTOP,
}
_ALLOWED_PHASES = {  # a stop is allowed in all
    Verb.ARM: (Phase.IDLE, Phase.ARMED),
    Verb.START: (Phase.ARMED,),
}
_NEXT: dict[tuple[Phase, Trigger], Phase] = {
    (Phase.IDLE, Trigger.ARM): Phase.ARMED,
    (Phase.IDLE, Trigger.STOP): Phase.STOPPED,  # refuses an order to arm after the stop
    (Phase.ARMED, Trigger.ARM): Phase.ARMED,
    (Phase.ARMED, Trigger.START): Phase.RUNNING,
    (Phase.ARMED, Trigger.STOP): Phase.STOPPED,
    (Phase.RUNNING, Trigger.STOP): Phase.STOPPED,
    (Phase.RUNNING, Trigger.REFERENCE_STALE): Phase.STOPPED,
    (Phase.ARMED, Trigger.ROBOT_STALE): Phase.FAULT,
    (Phase.RUNNING, Trigger.ROBOT_STALE): Phase.FAULT,
    (Phase.RUNNING, Trigger.ENVELOPE_LEFT): Phase.FAULT,
    (Phase.ARMED, Trigger.NOT_FOLLOWING): Phase.FAULT,
    (Phase.RUNNING, Trigger.NOT_FOLLOWING): Phase.FAULT,
}


def next_phase(phase: Phase, trigger: Trigger) -> Phase:
    """Compute the phase after a trigger.

    An emergency stop always leads to FAULT, which only a new run leaves.
    """
    if trigger is Trigger.ESTOP:
        return Phase.FAULT
    return _NEXT.get((phase, trigger), phase)


def refusal(phase: Phase, verb: Verb) -> str | None:
    """Check an order against the phase; return the reason of a refusal, None if allowed."""
    allowed = _ALLOWED_PHASES.get(verb, tuple(Phase))
    if phase in allowed:
        return None
    bound = " or ".join(p.value for p in allowed)
    return f"{verb.value} refused: {phase.value}; must be {bound}: end this run and start a new one"
