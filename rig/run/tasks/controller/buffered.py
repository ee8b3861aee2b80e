"""Interpolator policy `buffer`: the plan as it was playout_ms ago, from stamped references.

A gap in the references is bridged by a cubic through its four neighbours, where these arrive within
the playout delay; else the plan is extrapolated at its last velocity for one window. After that the
controller brakes. Windows and envelope are those of `bounded`.
"""

from __future__ import annotations

from bisect import bisect_right

import msgspec

from comms.messages import Position, Reference
from rig.run.tasks.controller.bounded import Bounded
from rig.run.tasks.controller.vectors import mean
from rig.run.tasks.controller.workspace import Workspace
from rig.run.tasks.grid import WINDOW_NS
from rig.run.tasks.safety import Envelope

MAX_EXTRAPOLATION_NS = WINDOW_NS
BEFORE = 2  # references kept before the instant played
CUBIC_POINTS = 4


class Buffered:
    """Playout of references through the windows of Bounded."""

    def __init__(
        self, t_start_ns: int, position_m: Position, envelope: Envelope, playout_ns: int
    ) -> None:
        self._bounded = Bounded(t_start_ns, position_m, envelope)
        self._workspace = Workspace(envelope, position_m)
        self._playout_ns = playout_ns
        self._kept: list[Reference] = []  # in the order of their instants

    def setpoint(self, t_ns: int, newest: Reference | None) -> Position:
        """Compute the setpoint of the tick due at t_ns; newest: newest accepted reference."""
        last = self._kept[-1] if self._kept else None
        if newest is not None and (last is None or newest.t_target_ns > last.t_target_ns):
            self._kept.append(newest)
        played = self._played(t_ns - self._playout_ns)
        if played is None:
            return self._bounded.setpoint(t_ns, None)
        is_planned = any(played is reference for reference in self._kept)
        return self._bounded.setpoint(t_ns, self._inside(played), is_planned)

    def _inside(self, reference: Reference) -> Reference:
        """Limit an interpolated or extrapolated position to the workspace."""
        inside = self._workspace.inside(reference.position_m)
        return msgspec.structs.replace(reference, position_m=inside)

    def _played(self, t_ns: int) -> Reference | None:
        """Interpolate the reference for t_ns; None before the first one."""
        kept = self._kept
        after = bisect_right(kept, t_ns, key=_instant)
        if after == 0:
            return None
        del kept[: max(0, after - BEFORE)]
        after = min(after, BEFORE)
        before = kept[after - 1]
        if before.t_target_ns == t_ns:
            return before
        if after < len(kept):
            return _interpolate(kept[: after + BEFORE][-CUBIC_POINTS:], t_ns)
        if after < BEFORE:
            return before
        end_ns = min(t_ns, before.t_target_ns + MAX_EXTRAPOLATION_NS)
        return _interpolate(kept[after - BEFORE : after], end_ns)


def _instant(reference: Reference) -> int:
    return reference.t_target_ns


def _interpolate(points: list[Reference], t_ns: int) -> Reference:
    """Evaluate the polynomial through the points at t_ns (Lagrange)."""
    weights = [_weight(points, k, t_ns) for k in range(len(points))]
    position = mean([p.position_m for p in points], weights)
    return msgspec.structs.replace(points[-1], t_target_ns=t_ns, position_m=position)


def _weight(points: list[Reference], k: int, t_ns: int) -> float:
    """Compute the Lagrange polynomial of point k at t_ns."""
    weight = 1.0
    for j, other in enumerate(points):
        if j != k:
            span_ns = points[k].t_target_ns - other.t_target_ns
            weight *= (t_ns - other.t_target_ns) / span_ns
    return weight
