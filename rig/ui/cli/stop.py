"""`rig stop`: stop a running experiment from a second terminal. Imports only what a stop needs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.errors import FAULT, RigError
from rig.run.running import RunningOperator, is_alive, operators
from rig.ui.text import without_controls

ANSWER_MS = 3000


def stop(
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
    emergency: Annotated[
        bool,
        typer.Option("--emergency", help="Emergency stop: the run ends as a fault (exit 5)."),
    ] = False,
) -> int:
    """Stop every experiment that runs under RUNS: the robot first, then the log is closed."""
    known = operators(runs)
    alive = [operator for operator in known if is_alive(operator.pid)]
    for operator in known:
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
    _say(f"{operator.name}: {answer or 'no answer: press the emergency stop of the robot'}")
    return answer is not None


def _remove_stale(operator: RunningOperator) -> None:
    _say(
        f"{operator.name}: its operator (process {operator.pid}) has exited; "
        "its tasks stop by themselves within two seconds"
    )
    operator.path.unlink(missing_ok=True)


def _say(line: str) -> None:
    """Print a line; this verb imports no console."""
    print(without_controls(line))
