"""`rig stop`: stop a running experiment from a second terminal. Imports only what a stop needs."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from rig.errors import FAULT, OK, RigError
from rig.run import operator_file
from rig.run.operator_file import OperatorFile
from rig.ui.text import without_controls


def stop(
    runs: Annotated[Path, typer.Option(help="Folder of the run folders.")] = Path("runs"),
    emergency: Annotated[
        bool,
        typer.Option("--emergency", help="Emergency stop: the run ends as a fault (exit 5)."),
    ] = False,
) -> int:
    """Stop every experiment that runs under RUNS: the robot first, then the log is closed."""
    running = _running(runs)
    if not running:
        raise RigError(f"nothing is running under {runs}; name another folder with --runs")
    return _stop(running, "estop" if emergency else "stop")


def _running(runs: Path) -> dict[Path, OperatorFile]:
    """Read the files of the runs, each on its own; those of runs that have ended are removed."""
    running: dict[Path, OperatorFile] = {}
    for path in operator_file.find(runs):
        try:
            operator = operator_file.read(path)
        except FileNotFoundError:  # the run ended meanwhile
            continue
        except (OSError, ValueError) as error:
            reason = without_controls(f"{path} cannot be read, its run is not stopped ({error})")
            print(
                f"rig: {reason}: remove it if nothing runs there, otherwise press the emergency "
                "stop of the robot",
                file=sys.stderr,
            )
            continue
        if operator_file.is_alive(operator.pid):
            running[path] = operator
        else:
            _remove_stale(path, operator)
    return running


def _stop(running: Mapping[Path, OperatorFile], request: str) -> int:
    """Send the order to all runs, then follow each; return the exit code."""
    # sockets are needed only where something runs
    from rig.ui.cli.stop_order import StopOrder, StopState

    code = OK
    orders: dict[str, StopOrder] = {}
    for path, operator in running.items():
        try:
            orders[path.parent.name] = StopOrder(path, operator, request)
        except ValueError as error:
            _say(f"{path.parent.name}: {error}: press the emergency stop of the robot")
            code = FAULT
    while orders:
        for name, order in list(orders.items()):
            order.follow()
            for line in order.news:
                _say(f"{name}: {line}")
            order.news.clear()
            if order.state is not StopState.PENDING:
                del orders[name]
            if order.state is StopState.FAILED:
                code = FAULT
    return code


def _remove_stale(path: Path, operator: OperatorFile) -> None:
    """Remove the file of an operator that has exited; its tasks get the order all the same."""
    from rig.ui.cli.stop_order import send_past_operator

    send_past_operator(operator, "stop")
    _say(
        f"{path.parent.name}: its operator (process {operator.pid}) has exited; "
        "its tasks stop by themselves"
    )
    operator_file.remove(path, operator.address)


def _say(line: str) -> None:
    """Print a line; this verb imports no console."""
    print(without_controls(line), flush=True)
