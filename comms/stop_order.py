"""Stop order of a task that did not come from its operator."""

from __future__ import annotations

import msgspec

from comms.messages import Command, Reply, Verb
from comms.task import Send, Step, Task


def stop_order(task: Task, verb: Verb, reason: str, code: int, t_ns: int) -> Step:
    """Give a task a stop order that the operator did not send; its reply tells the reason."""
    order = Command(seq=0, t_ns=t_ns, id=0, to=task.name, verb=verb)
    step = task.on_message("command", order, t_ns)
    sends: list[Send] = []
    for send in step.sends:
        message = send.message
        if isinstance(message, Reply):
            message = msgspec.structs.replace(message, ok=False, text=reason, exit=code)
        sends.append(send._replace(message=message))
    return step._replace(sends=sends)
