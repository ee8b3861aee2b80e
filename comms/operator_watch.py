"""Watch of a task over its operator: the age of its last message, and the pipe of its process."""

from __future__ import annotations

import os
import select

from comms.channels import MS

READ_BYTES = 4096


class OperatorWatch:
    """Last message of the operator, and the end of its process.

    The operator holds the writing end of the pipe open and writes nothing more. The system closes
    it when the process exits, however it does; the task then reads the end of the file.
    """

    def __init__(self, silent_ns: int, pipe: int | None) -> None:
        """silent_ns: longest silence. pipe: descriptor of the reading end, None without one."""
        self.is_gone = False  # the process of the operator exited
        self._silent_ns = silent_ns
        self._pipe = pipe
        self._heard_ns = 0

    @property
    def has_pipe(self) -> bool:
        """True while there is a pipe to wait for."""
        return self._pipe is not None and not self.is_gone

    def fileno(self) -> int:
        """Return the descriptor of the pipe, for select."""
        return -1 if self._pipe is None else self._pipe

    def has_pending(self) -> bool:
        """Tell if select does not announce the end of the pipe: it always does."""
        return False

    def read_pipe(self) -> None:
        """Read the pipe without waiting; its end is the end of the operator's process."""
        if not self.has_pipe or not select.select([self], [], [], 0)[0]:
            return
        self.is_gone = not os.read(self.fileno(), READ_BYTES)

    def hear(self, t_ns: int) -> None:
        """Note the arrival of a message."""
        self._heard_ns = t_ns

    def loss(self, t_ns: int) -> str | None:
        """Describe the loss of the operator; None while it is there."""
        if self.is_gone:
            return "the process of the operator has exited"
        silent_ns = t_ns - self._heard_ns
        if silent_ns <= self._silent_ns:
            return None
        return (
            f"no message from the operator for {silent_ns / MS:.0f} ms; "
            f"must be <= {self._silent_ns / MS:.0f} ms (safety.operator_silent_ms): "
            "its process was suspended, or the machine did not run it"
        )
