"""What a task says to the operator: answers to orders, and news nobody asked for."""

from __future__ import annotations

from comms.messages import Command, Phase, Reply
from comms.task import Send


class Replies:
    """Words one task's replies and counts them."""

    def __init__(self, sender: str) -> None:
        self._sender = sender
        self._seq = 0

    def answer(self, order: Command, phase: Phase, t_ns: int, text: str = "") -> Send:
        """The order is carried out."""
        return self._send(order.id, True, phase, t_ns, text, None)

    def refuse(
        self, order: Command, phase: Phase, t_ns: int, text: str, exit: int | None = None
    ) -> Send:
        """The order is not carried out, and why; exit = the code a run that ends over it should have."""
        return self._send(order.id, False, phase, t_ns, text, exit)

    def tell(self, phase: Phase, t_ns: int, text: str) -> Send:
        """News that change nothing."""
        return self._send(0, True, phase, t_ns, text, None)

    def give_up(self, phase: Phase, t_ns: int, text: str, exit: int) -> Send:
        """News that end the run with an exit code."""
        return self._send(0, False, phase, t_ns, text, exit)

    def _send(
        self, id: int, ok: bool, phase: Phase, t_ns: int, text: str, exit: int | None
    ) -> Send:
        reply = Reply(
            seq=self._seq,
            t_ns=t_ns,
            id=id,
            sender=self._sender,
            ok=ok,
            phase=phase,
            text=text,
            exit=exit,
        )
        self._seq += 1
        return Send("reply", reply, t_ns)
