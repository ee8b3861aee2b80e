"""Where a picture goes when a command is asked for one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rig.errors import ConfigError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".svg", ".png", ".pdf")
DPI = 130


def check(path: Path) -> None:
    """Raises ConfigError for an ending that is no picture; worth asking before long work."""
    if path.suffix.lower() not in FORMATS:
        raise ConfigError(f"--plot {str(path)!r}; must end in one of {', '.join(FORMATS)}: rename it")


def save(figure: Figure, path: Path) -> None:
    """Write the figure in the format of the path's ending. Raises ConfigError for another one, OSError."""
    check(path)
    figure.savefig(path, dpi=DPI)
