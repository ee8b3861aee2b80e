"""The folder of a run: its name and contents, and the log that a name typed by the user means."""

from __future__ import annotations

import re
import secrets
from datetime import datetime
from pathlib import Path

from rig.errors import Refused, RigError

RUNS = Path("runs")  # folder of the run folders
MODE = 0o750  # of a folder: the runs of a user are not for all users
LOG, REPORT = "run.mcap", "report.html"


def new_folder(runs: Path, name: str, mode: str, now: datetime) -> Path:
    """Make runs/<utc>_<name>_<mode>_<id>; raises Refused when that cannot be written."""
    slug = re.sub(r"[^A-Za-z0-9_-]+", "-", name)
    folder = runs / f"{now:%Y%m%dT%H%M%SZ}_{slug}_{mode}_{secrets.token_hex(2)}"
    try:
        folder.mkdir(MODE, parents=True)
    except OSError as error:
        raise Refused(
            f"cannot make the run folder {folder}: {error.strerror}; name another one with --runs"
        ) from error
    return folder


def find_log(name: str, runs: Path) -> Path:
    """Find a log by run folder, log file, id of a run in `runs`, or `last`; raises RigError."""
    path = Path(name)
    if path.is_file():
        return path
    if (path / LOG).is_file():
        return path / LOG
    if path.is_dir():
        raise RigError(f"{path}: a folder without {LOG}; name a run folder, a .mcap file or `last`")
    known = run_names(runs)
    if name == "last" and known:
        return runs / known[-1] / LOG
    matches = [run for run in known if name and name in run]
    if len(matches) == 1:
        return runs / matches[0] / LOG
    what = "no such run" if not matches else f"{len(matches)} runs match"
    hint = f"newest: {known[-1]}" if known else f"no runs in {runs} yet: start one with `rig run`"
    raise RigError(f"run '{name}': {what}; name a run folder, a .mcap file or `last` ({hint})")


def run_names(runs: Path) -> list[str]:
    """List the folders in runs that hold a log, oldest first."""
    if not runs.is_dir():
        return []
    return sorted(folder.name for folder in runs.iterdir() if (folder / LOG).is_file())
