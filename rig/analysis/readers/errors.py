"""Errors of the readers, and the lists of names in them."""

from __future__ import annotations

from collections.abc import Sequence

from rig.analysis.identify.errors import AnalysisError

SHOWN_NAMES = 12  # of a long list; the rest is counted


class UnreadableData(AnalysisError):
    """File without a signal that can be read; the message says what was found and what to try."""


def list_names(names: Sequence[str]) -> str:
    """Join names for a message; a long list is cut, and the rest counted."""
    shown = ", ".join(names[:SHOWN_NAMES])
    left = len(names) - SHOWN_NAMES
    return f"{shown} and {left} more" if left > 0 else shown


def counted(number: int, noun: str) -> str:
    """Word a count: "1 row", "2 rows"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def missing_extra(path: object, kind: str, package: str) -> UnreadableData:
    """Make the error for a kind of file whose package is not installed."""
    return UnreadableData(
        f"{path}: {kind} needs {package}, which is not installed; "
        "install the extra: pip install 'swayless[formats]'"
    )
