"""Order of `rig stop` to one run: sent to its operator, and followed until the robot stands."""

from __future__ import annotations

import enum
import json
from pathlib import Path
from typing import Any

from comms.clock import stopwatch_s
from comms.operator_request import OperatorRequests
from rig.run.operator_file import OperatorFile

POLL_MS = 20
ORDERED = "ordered, was "  # then the stage of the run
TIMEOUT_S = 2.0  # from the order to a robot at rest
STAGES_AT_REST = ("connecting", "arming", "starting")  # before the robot moves


class StopState(enum.Enum):
    """State of a stop order."""

    PENDING = "pending"
    STOPPED = "stopped"
    FAILED = "failed"


class StopOrder:
    """Stop order to a run; `news` are the lines to show."""

    def __init__(self, path: Path, operator: OperatorFile, request: str) -> None:
        """Send the order. Raises ValueError for an address that is none."""
        self.state = StopState.PENDING
        self.news: list[str] = []
        self._path = path
        self._began_s = stopwatch_s()
        self._requests = OperatorRequests(operator.address)
        self._requests.send(request)
        self._stage = ""  # of the run when the order arrived; empty before
        self._status: dict[str, Any] = {}
        self._next_poll_s = 0.0

    def follow(self) -> None:
        """Wait for one answer, at most POLL_MS, and take it; then judge the state of the order."""
        answer = self._requests.receive(POLL_MS)
        if answer is not None:
            self._take(answer)
        if self._status.get("at_rest") is True and self._stage:
            self._finish(StopState.STOPPED, f"stopped after {self._elapsed_ms()} ms")
        elif self._stage and not self._path.exists():
            self._judge_ended_run()
        elif stopwatch_s() - self._began_s > TIMEOUT_S:
            self._finish(StopState.FAILED, f"{self._failure()}: press the emergency stop")
        elif self._stage and stopwatch_s() >= self._next_poll_s:
            self._next_poll_s = stopwatch_s() + POLL_MS * 1e-3
            self._requests.send("status")

    def _take(self, answer: str) -> None:
        try:
            status = json.loads(answer)
        except ValueError:
            status = None
        if isinstance(status, dict):
            self._status = status
            return
        if answer.startswith(ORDERED):
            self._stage = answer.removeprefix(ORDERED)
        self.news.append(answer)

    def _judge_ended_run(self) -> None:
        """Finish the order to a run that has closed before it answered that the robot stands."""
        text = f"the run ended after {self._elapsed_ms()} ms"
        if self._stage in STAGES_AT_REST:
            self._finish(StopState.STOPPED, f"stopped: {text}, nothing had moved")
        else:
            self._finish(StopState.FAILED, f"{text}, the robot was not seen at rest: look at it")

    def _failure(self) -> str:
        limit = f"within {TIMEOUT_S * 1e3:.0f} ms"
        if not self._stage:
            return f"no answer of the operator {limit}"
        phase = self._status.get("phase")
        speed_m_s = self._status.get("speed_m_s")
        return f"not at rest {limit} (phase {phase}, speed {speed_m_s} m/s)"

    def _elapsed_ms(self) -> int:
        return round((stopwatch_s() - self._began_s) * 1e3)

    def _finish(self, state: StopState, text: str) -> None:
        self.state = state
        self.news.append(text)
        self._requests.close()
