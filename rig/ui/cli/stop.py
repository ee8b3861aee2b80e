"""`rig stop`: stop a running experiment from a second terminal. Imports only what a stop needs."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from rig.errors import FAULT, RigError

ANSWER_MS = 3000


class RunningOperator(NamedTuple):
    """An operator as its `operator.json` names it."""

    path: Path
    address: str
    pid: int

    @property
    def name(self) -> str:
        """Name of the run's folder."""
        return self.path.parent.name


def stop(
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
    emergency: Annotated[
        bool,
        typer.Option("--emergency", help="Emergency stop: the run ends as a fault (exit 5)."),
    ] = False,
) -> int:
    """Stop every experiment that runs under RUNS: the robot first, then the log is closed."""
    operators = [_read(path) for path in sorted(runs.glob("*/operator.json"))]
    alive = [operator for operator in operators if _is_alive(operator.pid)]
    for operator in operators:
        if operator not in alive:
            _remove_stale(operator)
    if not alive:
        raise RigError(f"nothing is running under {runs}; name another folder with --runs")
    code = 0
    for operator in alive:
        if not _stop(operator, emergency):
            code = FAULT
    return code


def _stop(operator: RunningOperator, emergency: bool) -> bool:
    from comms.operator_request import ask  # sockets are needed only where something runs

    answer = ask(operator.address, "estop" if emergency else "stop", ANSWER_MS)
    print(f"{operator.name}: {answer or 'no answer: press the emergency stop of the robot'}")
    return answer is not None


def _remove_stale(operator: RunningOperator) -> None:
    print(
        f"{operator.name}: its operator (process {operator.pid}) has exited; "
        "its tasks stop by themselves within two seconds"
    )
    operator.path.unlink(missing_ok=True)


def _read(path: Path) -> RunningOperator:
    fields = json.loads(path.read_bytes())
    return RunningOperator(path, str(fields["address"]), int(fields["pid"]))


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # a process of another user
        return True
    return True
