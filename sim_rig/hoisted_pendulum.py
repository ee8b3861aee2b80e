"""Load on a cable whose length changes during a run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sim_rig.load_params import LengthChange, LinkParams, LoadParams
from sim_rig.spatial_pendulum import SpatialPendulum
from sim_rig.vectors import Vector, scaled

MIN_LENGTH_M = 0.05


class _Length(NamedTuple):
    """Length of the cable and its derivatives."""

    length_m: float
    speed_m_s: float
    acceleration_m_s2: float


class HoistedPendulum(SpatialPendulum):
    """Point mass at r = p + l(t) u:  l u'' + 2 l' u' = across u of (-g z - p'') - l |u'|^2 u.

    Tension: m (l |u'|^2 - (g z + p'').u - l''). A change of length follows the harmonic law
    (source 000). Raises ValueError for a length that becomes too short.
    """

    def __init__(self, link: LinkParams, load: LoadParams, changes: Sequence[LengthChange]) -> None:
        super().__init__(link, load)
        self._changes = tuple(changes)
        self._now_s = 0.0
        self._stages: Iterator[_Length] = iter(())
        self._acceleration_m_s2 = 0.0  # l'' at the start of the last step
        shortest_m = link.length_m + sum(min(0.0, change.change_m) for change in changes)
        if shortest_m < MIN_LENGTH_M:
            raise ValueError(
                f"change_m of [[bench.length_changes]] shorten the cable to {shortest_m:g} m; must "
                f"leave {MIN_LENGTH_M:g} m: change it less"
            )

    @property
    def length_m(self) -> float:
        """Present length."""
        return self._length(self._now_s).length_m

    def force_n(self, acceleration_m_s2: Vector) -> Vector:
        """Compute the tension on a pivot that accelerates so [N]."""
        now = self._length(self._now_s)
        self._stages = iter([now])
        (x, y, z), (vx, vy, vz) = self._u, self._w
        factor = self._turn(x, y, z, vx, vy, vz, acceleration_m_s2)[3]
        tension_n = -self._mass_kg * (factor * now.length_m + now.acceleration_m_s2)
        return scaled(self._u, tension_n)

    def advance_at_rest(self, step_s: float, steps: int) -> None:
        """Integrate steps of step_s with the pivot at rest. Raises LoadEvent."""
        still = [0.0] * (2 * steps + 1)
        self.advance(step_s, still, still, still)

    def _runge_kutta(self, h: float, first: Vector, middle: Vector, last: Vector) -> None:
        start, half, end = (self._length(self._now_s + part * h) for part in (0.0, 0.5, 1.0))
        self._stages = iter([start, half, half, end])
        super()._runge_kutta(h, first, middle, last)
        self._now_s += h
        self._tension_factor += start.acceleration_m_s2 / start.length_m
        self._tension_factor *= start.length_m / self._length_m

    def _turn(
        self, x: float, y: float, z: float, vx: float, vy: float, vz: float, pivot: Vector
    ) -> tuple[float, float, float, float]:
        length = next(self._stages)
        ax, ay, az = pivot
        p = 1.0 / length.length_m
        k = self._drag_1_s + 2.0 * length.speed_m_s * p
        fx, fy, fz = -p * ax - k * vx, -p * ay - k * vy, -p * (az + self._gravity_m_s2) - k * vz
        along = x * fx + y * fy + z * fz
        factor = -(vx * vx + vy * vy + vz * vz + along) / (x * x + y * y + z * z)
        return fx + factor * x, fy + factor * y, fz + factor * z, factor

    def _length(self, t_s: float) -> _Length:
        """Compute the length at a time of the load, by the harmonic law of each change."""
        length, speed, acceleration = self._length_m, 0.0, 0.0
        for change in self._changes:
            share = (t_s - self.run_start_s - change.at_s) / change.duration_s
            if share >= 1.0:
                length += change.change_m
            elif share > 0.0:
                turn, rate = math.tau * share, 1.0 / change.duration_s
                length += change.change_m * (share - math.sin(turn) / math.tau)
                speed += change.change_m * rate * (1.0 - math.cos(turn))
                acceleration += change.change_m * rate**2 * math.tau * math.sin(turn)
        return _Length(length, speed, acceleration)
