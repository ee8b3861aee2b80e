"""Checks and writing of figure files named on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rig.errors import ConfigError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".svg", ".png", ".pdf")
DPI = 130  # of a .png file


def check(path: Path) -> None:
    """Check the ending and the folder of a figure file before long computations.

    Raises ConfigError for an ending not in FORMATS and for a folder that does not exist.
    """
    if path.suffix.lower() not in FORMATS:
        raise ConfigError(
            f"--plot {str(path)!r}; must end in one of {', '.join(FORMATS)}: rename it"
        )
    check_folder("--plot", path)


def check_folder(option: str, path: Path) -> None:
    """Check that the folder of a file exists; raises ConfigError."""
    if not path.parent.is_dir():
        raise ConfigError(
            f"{option} {str(path)!r}: no folder '{path.parent}'; must exist: "
            "make it, or name another"
        )


def save(figure: Figure, path: Path) -> None:
    """Write a figure in the format of the path's ending; raises what check() does, and OSError."""
    check(path)
    figure.savefig(path, dpi=DPI)
