"""Order of `rig stop` to one run: sent to its operator, and followed until the robot stands."""

from __future__ import annotations

import enum
import json
from pathlib import Path
from typing import Any

from comms.clock import stopwatch_s
from comms.operator_request import OperatorRequests
from comms.stop_port import send_stop
from rig.run.operator_file import OperatorFile

POLL_MS = 20
ORDERED = "ordered, was "  # then the stage of the run
ANSWER_S = 0.3  # without an answer of the operator until then, the stop ports get the order too
REPEAT_S = 0.1  # of the stop datagrams, which may be lost
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
        self._operator = operator
        self._request = request
        self._began_s = stopwatch_s()
        self._requests = OperatorRequests(operator.address)
        self._requests.send(request)
        self._is_ordered_past = False
        self._stage = ""  # of the run when the order arrived; empty before
        self._status: dict[str, Any] = {}
        self._next_poll_s = 0.0
        self._next_datagram_s = self._began_s + ANSWER_S

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
        elif not self._stage and stopwatch_s() >= self._next_datagram_s:
            self._order_past_operator()

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

    def _order_past_operator(self) -> None:
        """Send the order to the stop port of each task; it is not confirmed."""
        self._next_datagram_s = stopwatch_s() + REPEAT_S
        tasks = send_past_operator(self._operator, self._request)
        if tasks and not self._is_ordered_past:
            self._is_ordered_past = True
            self.news.append(f"the operator does not answer; ordered at {' and '.join(tasks)}")

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
            return f"no answer of the operator {limit}, so nothing shows that the robot stands"
        phase = self._status.get("phase")
        speed = f"{self._status.get('speed_m_s')} m/s"
        if "speed_rad_s" in self._status:
            speed = f"{self._status['speed_rad_s']} rad/s"
        return f"not at rest {limit} (phase {phase}, speed {speed})"

    def _elapsed_ms(self) -> int:
        return round((stopwatch_s() - self._began_s) * 1e3)

    def _finish(self, state: StopState, text: str) -> None:
        self.state = state
        self.news.append(text)
        self._requests.close()


def send_past_operator(operator: OperatorFile, request: str) -> list[str]:
    """Send a stop datagram to each task that has a stop port; return their names."""
    key = operator.key
    if not key:
        return []
    for port in operator.stop_ports.values():
        send_stop(port, key, request)
    return list(operator.stop_ports)
