"""Motion laws from 0 to 1, rest to rest: one table, law(duration_s) -> Trajectory."""

from __future__ import annotations

from collections.abc import Callable

from planners.laws.harmonic import harmonic
from planners.trajectory import Trajectory

LAWS: dict[str, Callable[[float], Trajectory]] = {"harmonic": harmonic}
