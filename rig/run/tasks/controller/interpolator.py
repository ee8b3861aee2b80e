"""Interpolator policies: setpoints on the 5 ms grid from references, in linear windows of 30 ms.

`source`: the hold of the source. At the start of each window the newest reference becomes the
goal, reached in six equal steps. Without a newer reference goal and setpoint stay; a late reference
is taken at the next window, and the gap is made good in that one window.
`bounded`: the same windows, whose end is limited so that the envelope holds (bounded.py).
`buffer`: `bounded`, of the plan as it was a playout delay ago, across gaps (buffered.py).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from comms.channels import MS
from comms.messages import Position, Reference
from rig.run.tasks.controller.bounded import Bounded
from rig.run.tasks.controller.buffered import Buffered
from rig.run.tasks.controller.vectors import between
from rig.run.tasks.grid import TICK_NS, TICKS, WINDOW_NS
from rig.run.tasks.safety import Envelope


class Interpolator(Protocol):
    """Interpolator from window to window."""

    def setpoint(self, t_ns: int, newest: Reference | None) -> Position:
        """Compute the setpoint of the tick due at t_ns; newest: newest accepted reference."""


class SourceHold:
    """Linear interpolation from goal to goal on the tick grid of t_start_ns."""

    def __init__(self, t_start_ns: int, position_m: Position) -> None:
        self._t_start_ns = t_start_ns
        self._window = -1
        self._last = self._goal = position_m

    def setpoint(self, t_ns: int, newest: Reference | None) -> Position:
        """Compute the setpoint of the tick due at t_ns; newest: newest accepted reference."""
        window, into_ns = divmod(t_ns - self._t_start_ns, WINDOW_NS)
        if window > self._window:
            self._window = window
            self._last = self._goal
            if newest is not None:
                self._goal = newest.position_m
        share = (into_ns // TICK_NS + 1) / TICKS
        return between(self._last, self._goal, share)


class PolicySettings(NamedTuple):
    """Settings of the policies; each takes what it needs."""

    envelope: Envelope
    playout_ns: int = 100 * MS


def _source(t_start_ns: int, position_m: Position, settings: PolicySettings) -> Interpolator:
    return SourceHold(t_start_ns, position_m)


def _bounded(t_start_ns: int, position_m: Position, settings: PolicySettings) -> Interpolator:
    return Bounded(t_start_ns, position_m, settings.envelope)


def _buffer(t_start_ns: int, position_m: Position, settings: PolicySettings) -> Interpolator:
    return Buffered(t_start_ns, position_m, settings.envelope, settings.playout_ns)


# start of the first window, setpoint there, settings
POLICIES: dict[str, Callable[[int, Position, PolicySettings], Interpolator]] = {
    "source": _source,
    "bounded": _bounded,
    "buffer": _buffer,
}
