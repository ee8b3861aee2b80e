"""Requests of a second terminal to a running operator: `stop`, `estop` and `status`."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from comms.task import Step
from rig.errors import FAULT, STOPPED
from rig.run.runtime.robot_watch import RobotWatch
from rig.run.tasks.operator import Operator

STOPS = {"stop": STOPPED, "estop": FAULT}  # exit code of the run


class TerminalRequests:
    """Answers to the requests; nothing else is understood, so that no motion can be started."""

    def __init__(
        self, operator: Operator, robot: RobotWatch, carry_out: Callable[[Step], None]
    ) -> None:
        """carry_out: receives what the operator returns."""
        self._operator = operator
        self._robot = robot
        self._carry_out = carry_out

    def answer(self, request: str, now_ns: int) -> str:
        """Serve a request; return the answer."""
        if request == "status":
            return msgspec.json.encode(self._robot.status()).decode()
        if request not in STOPS:
            return "understood are: stop, estop, status"
        stage = self._operator.stage.value
        reason = f"{request} from another terminal"
        self._carry_out(self._operator.end(reason, STOPS[request], now_ns))
        return f"ordered, was {stage}"
