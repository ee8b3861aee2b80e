"""Where a file goes when a command is asked for one, a picture above all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rig.errors import ConfigError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".svg", ".png", ".pdf")
DPI = 130


def check(path: Path) -> None:
    """Raises ConfigError for an ending that is no picture, and for no folder; worth asking before long work."""
    if path.suffix.lower() not in FORMATS:
        raise ConfigError(
            f"--plot {str(path)!r}; must end in one of {', '.join(FORMATS)}: rename it"
        )
    check_folder("--plot", path)


def check_folder(option: str, path: Path) -> None:
    """Raises ConfigError for a file in no folder."""
    if not path.parent.is_dir():
        raise ConfigError(
            f"{option} {str(path)!r}: no folder '{path.parent}'; must be there: make it, or name another"
        )


def save(figure: Figure, path: Path) -> None:
    """Write the figure in the format of the path's ending. Raises what check() does, OSError."""
    check(path)
    figure.savefig(path, dpi=DPI)
