"""Provenance of a run: the git commit of the product's own checkout, else the installed version."""

from __future__ import annotations

import subprocess
import tomllib
from importlib.metadata import version
from pathlib import Path

DISTRIBUTION = "swayless"
UNKNOWN = "unknown"
GIT_TIMEOUT_S = 5
DESCRIBE = ("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")


def provenance(root: Path) -> dict[str, str]:
    """Name the code that lies at root: keys `code`, `git_commit` and `git_dirty` of `run.start`.

    A commit is recorded only where root is the top of a git checkout of this product. A package
    that is installed somewhere inside another project's checkout is named by its version.
    """
    described = _describe(root) if _is_own_checkout(root) else ""
    if not described:
        return {
            "code": f"{DISTRIBUTION} {version(DISTRIBUTION)}",
            "git_commit": UNKNOWN,
            "git_dirty": UNKNOWN,
        }
    return {
        "code": f"git {described}",
        "git_commit": described.removesuffix("-dirty"),
        "git_dirty": str(described.endswith("-dirty")).lower(),
    }


def _is_own_checkout(root: Path) -> bool:
    project = root / "pyproject.toml"
    if not (root / ".git").exists() or not project.is_file():
        return False
    try:
        name = tomllib.loads(project.read_text()).get("project", {}).get("name")
    except (OSError, tomllib.TOMLDecodeError):
        return False
    return bool(name == DISTRIBUTION)


def _describe(root: Path) -> str:
    """Describe the commit of a checkout; empty where git cannot tell."""
    command = ["git", "-C", str(root), *DESCRIBE]
    try:
        answer = subprocess.run(
            command, capture_output=True, text=True, timeout=GIT_TIMEOUT_S, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return answer.stdout.strip()
