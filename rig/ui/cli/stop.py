"""`rig stop`: stop a running experiment from a second terminal."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from comms.operator_bus import ask
from rig.errors import FAULT, RigError
from rig.ui.cli.output import out

ANSWER_MS = 3000


def stop(
    runs: Annotated[Path, typer.Option(help="Where run folders are.")] = Path("runs"),
    emergency: Annotated[
        bool, typer.Option("--emergency", help="Emergency stop: the run ends as a fault (exit 5).")
    ] = False,
) -> int:
    """Stop every experiment running under RUNS, in order: the robot first, then the log is closed."""
    running = [(p, *_read(p)) for p in sorted(runs.glob("*/operator.json"))]
    alive = [(p, address) for p, address, pid in running if _alive(pid)]
    for path, _, pid in running:
        if not _alive(pid):
            out.print(
                f"{path.parent.name}: its operator (process {pid}) is gone; its tasks stop by themselves within two seconds"
            )
            path.unlink(missing_ok=True)
    if not alive:
        raise RigError(f"nothing is running under {runs}; name another folder with --runs")
    code = 0
    for path, address in alive:
        answer = ask(address, "estop" if emergency else "stop", ANSWER_MS)
        out.print(
            f"{path.parent.name}: {answer or 'no answer: press the emergency stop of the robot'}"
        )
        code = code if answer else FAULT
    return code


def _read(path: Path) -> tuple[str, int]:
    word = msgspec.json.decode(path.read_bytes())
    return str(word["address"]), int(word["pid"])


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # another user's
        return True
    return True
