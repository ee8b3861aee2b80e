"""Replies of a task to the operator: answers to commands and unsolicited notices."""

from __future__ import annotations

from comms.messages import Command, Phase, Reply
from comms.task import Send


class Replies:
    """Builder of the replies of one task, with their sequence numbers."""

    def __init__(self, sender: str) -> None:
        self._sender = sender
        self._seq = 0

    def answer(self, order: Command, phase: Phase, t_ns: int, text: str = "") -> Send:
        """Confirm a command."""
        return self._send(order.id, True, phase, t_ns, text, None)

    def refuse(
        self, order: Command, phase: Phase, t_ns: int, text: str, exit: int | None = None
    ) -> Send:
        """Refuse a command with the reason; exit: exit code if the run ends because of it."""
        return self._send(order.id, False, phase, t_ns, text, exit)

    def tell(self, phase: Phase, t_ns: int, text: str) -> Send:
        """Create a notice without consequence."""
        return self._send(0, True, phase, t_ns, text, None)

    def give_up(self, phase: Phase, t_ns: int, text: str, exit: int) -> Send:
        """Request the end of the run with an exit code."""
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
