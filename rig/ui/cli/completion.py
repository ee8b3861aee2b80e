"""Values that a shell completes: planners, laws, experiments, runs.

Each function imports what it lists when it is called.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import typer


def planners(incomplete: str) -> list[str]:
    """Complete the last planner of a comma list."""
    from planners.catalog import PLANNERS

    before, comma, word = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in _starting(PLANNERS, word)]


def laws(incomplete: str) -> list[str]:
    """Complete a motion law."""
    from planners.laws import LAWS

    return _starting(LAWS, incomplete)


def scenes(incomplete: str) -> list[str]:
    """Complete a shipped scene, or a TOML file."""
    from rig.studies.vision.scene import shipped_scenes

    return [*_starting(shipped_scenes(), incomplete), *_toml_files(incomplete)]


def experiments(incomplete: str) -> list[str]:
    """Complete a shipped experiment, or a TOML file."""
    from rig.run.config import shipped

    return [*_starting(shipped(), incomplete), *_toml_files(incomplete)]


def recorded_runs(context: typer.Context, incomplete: str) -> list[str]:
    """Complete the name of a run under --runs, newest first, or `last`."""
    from rig.run.runs import run_names

    names = run_names(Path(context.params.get("runs") or "runs"))
    return _starting(["last", *reversed(names)], incomplete)


def _toml_files(incomplete: str) -> list[str]:
    """List the TOML files that start so, in their folder."""
    folder = Path(incomplete).parent
    if incomplete.endswith("/"):
        folder = Path(incomplete)
    return _starting((str(path) for path in sorted(folder.glob("*.toml"))), incomplete)


def _starting(names: Iterable[str], start: str) -> list[str]:
    return [name for name in names if name.startswith(start)]
