"""Result of one check of the machine before a run."""

from __future__ import annotations

from typing import NamedTuple


class Finding(NamedTuple):
    """Result of one check.

    status: ok, warning (a run works, perhaps with late ticks) or failed (a run would not start).
    """

    name: str
    status: str
    found: str
    advice: str = ""
