"""Linear interpolation of a cyclic target over the interpolation period."""

from __future__ import annotations


class LinearInterpolator:
    """Value that reaches each new target one period after it was given, then holds it."""

    def __init__(self) -> None:
        """Start at 0."""
        self._start = 0.0
        self._target = 0.0
        self._start_ns = 0
        self._period_ns = 0

    def hold(self, value: float) -> None:
        """Set value and target."""
        self._start = value
        self._target = value
        self._period_ns = 0

    def aim(self, target: float, t_ns: int, period_ns: int) -> None:
        """Move from the value at t_ns [ns] to a target within period_ns >= 0 [ns]."""
        self._start = self.value_at(t_ns)
        self._target = target
        self._start_ns = t_ns
        self._period_ns = period_ns

    def value_at(self, t_ns: int) -> float:
        """Value at t_ns [ns]; exactly the target from the end of the period on."""
        elapsed_ns = t_ns - self._start_ns
        if elapsed_ns >= self._period_ns:
            return self._target
        share = elapsed_ns / self._period_ns
        return self._start + (self._target - self._start) * share
