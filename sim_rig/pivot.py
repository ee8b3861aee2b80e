"""Motion of the pivot of a load, from its velocities at the start, middle and end of each step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sim_rig.vectors import Vector


class PivotStep(NamedTuple):
    """Acceleration in a step, which changes linearly: the derivative of a parabola of velocity."""

    begin_m_s2: Vector
    change_m_s2: Vector  # over the step
    middle_m_s: Vector  # velocity

    def at(self, share: float) -> Vector:
        """Compute the acceleration after a share of the step [m/s^2]."""
        (bx, by, bz), (cx, cy, cz) = self.begin_m_s2, self.change_m_s2
        return bx + share * cx, by + share * cy, bz + share * cz


AT_REST = PivotStep((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def pivot_steps(step_s: float, velocities_m_s: Sequence[Sequence[float]]) -> Iterator[PivotStep]:
    """Yield the steps of velocities along x, y and z, each (2 N + 1,)."""
    x, y, z = velocities_m_s
    for k in range(0, len(x) - 2, 2):
        (bx, cx), (by, cy), (bz, cz) = (_line(v[k], v[k + 1], v[k + 2], step_s) for v in (x, y, z))
        yield PivotStep((bx, by, bz), (cx, cy, cz), (x[k + 1], y[k + 1], z[k + 1]))


def _line(start: float, middle: float, end: float, step_s: float) -> tuple[float, float]:
    """Compute the derivative of a parabola at its start, and its change up to its end."""
    first = (4.0 * middle - 3.0 * start - end) / step_s
    return first, (start - 4.0 * middle + 3.0 * end) / step_s - first
