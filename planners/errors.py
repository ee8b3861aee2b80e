"""Errors of planners/. A message states what, the value, the bound and the next step."""

from __future__ import annotations

from collections.abc import Collection


class PlanError(ValueError):
    """Root of all errors of planners/.

    Example: `length_m = -0.2; must be > 0: measure pivot to load`.
    """


class Infeasible(PlanError):
    """Absence of a plan in the given time; minimum_time_s is the bound where one is known."""

    def __init__(self, message: str, minimum_time_s: float | None = None) -> None:
        super().__init__(message)
        self.minimum_time_s = minimum_time_s


class NotConverged(PlanError):
    """Failure of a numerical method to reach its tolerance.

    Example: `shooting amplifies rounding 2e+53 times; must be <= 1e+08`.
    """


def check_range(what: str, value: float, low: float, high: float, advice: str) -> None:
    """Raise PlanError unless low <= value <= high; NaN is outside."""
    if not low <= value <= high:
        raise PlanError(f"{what} = {value}; must be {low:g} to {high:g}: {advice}")


def unknown_name(what: str, name: str, known: Collection[str]) -> PlanError:
    """Build the error for an unknown name: the most similar known name, and all of them."""
    import difflib

    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return PlanError(f"{what} = {name!r}; {hint}must be one of {', '.join(sorted(known))}")
