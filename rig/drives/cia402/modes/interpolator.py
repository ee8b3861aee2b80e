"""Linear interpolation of a cyclic target over the interpolation period.

Targets that arrive on their grid are reached one period later. Where they jitter, the drive keeps a
grid of its own behind the latest ones, so that none is skipped and none waits: a target that comes
after its instant moves the grid by its delay, earlier ones draw it back slowly.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

DRAW_BACK = 2000  # share of the time in hand that a target gives up: one of so many


class _Knot(NamedTuple):
    t_ns: int
    value: float
    feed_forward: float  # on the way to the value, and from then on


class LinearInterpolator:
    """Value that reaches each new target one period after it was due, then holds it."""

    def __init__(self) -> None:
        """Start at 0."""
        self._knots: deque[_Knot] = deque()  # in the order of time; the last value is held
        self.hold(0.0)

    def hold(self, value: float) -> None:
        """Set value and target."""
        self._knots.clear()
        self._knots.append(_Knot(0, value, 0.0))

    def aim(self, target: float, t_ns: int, period_ns: int, feed_forward: float = 0.0) -> None:
        """Append a target that came at t_ns [ns], to be reached within period_ns >= 0 [ns].

        feed_forward: belongs to the way to this target, see feed_forward_at.

        The time in hand is at most one period: what comes in a burst is reached two periods later.
        """
        knots = self._knots
        if knots[-1].t_ns <= t_ns:  # on its grid, late, or the first one
            held = knots[-1]._replace(t_ns=t_ns)
            knots.clear()
            knots.append(held)
        in_hand_ns = knots[-1].t_ns - t_ns
        due_ns = knots[-1].t_ns + period_ns - in_hand_ns // DRAW_BACK
        latest_ns = t_ns + 2 * period_ns
        while len(knots) > 1 and knots[-1].t_ns >= min(due_ns, latest_ns):
            knots.pop()
        knots.append(_Knot(min(due_ns, latest_ns), target, feed_forward))

    def value_at(self, t_ns: int) -> float:
        """Value at t_ns [ns], which must not decrease; exactly a target at its instant."""
        knots = self._knots
        self._pass(t_ns)
        start = knots[0]
        if len(knots) == 1 or t_ns <= start.t_ns:
            return start.value
        end = knots[1]
        share = (t_ns - start.t_ns) / (end.t_ns - start.t_ns)
        return start.value + (end.value - start.value) * share

    def feed_forward_at(self, t_ns: int) -> float:
        """Feed-forward of the way on which the value is at t_ns [ns]."""
        self._pass(t_ns)
        knots = self._knots
        is_under_way = len(knots) > 1 and knots[0].t_ns < t_ns
        return knots[1].feed_forward if is_under_way else knots[0].feed_forward

    def _pass(self, t_ns: int) -> None:
        """Drop the knots before the newest one that was reached."""
        knots = self._knots
        while len(knots) > 1 and knots[1].t_ns <= t_ns:
            knots.popleft()
