"""Position of the platform at any time, from its newest samples."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

Vector = tuple[float, float, float]
MAX_SAMPLES = 32  # 320 ms at 100 Hz, the time of 16 frames at 50 Hz
NS_PER_S = 1e9


class PlatformPoint(NamedTuple):
    """Position and velocity of the platform."""

    t_ns: int
    position_m: Vector
    velocity_m_s: Vector


class PlatformTrack:
    """Newest positions of the platform."""

    def __init__(self, max_extrapolation_ns: int) -> None:
        """max_extrapolation_ns: from the nearest sample to an instant outside of all."""
        self._max_extrapolation_ns = max_extrapolation_ns
        self._points: deque[PlatformPoint] = deque(maxlen=MAX_SAMPLES)

    def store(self, point: PlatformPoint) -> None:
        """Store a sample; one that is older than the newest is dropped."""
        if not self._points or point.t_ns > self._points[-1].t_ns:
            self._points.append(point)

    def at(self, t_ns: int) -> Vector | None:
        """Interpolate the position at t_ns.

        Cubic Hermite between samples, constant velocity outside; None farther than
        max_extrapolation_ns from all samples.
        """
        if not self._points:
            return None
        nearest_ns = min(abs(t_ns - p.t_ns) for p in self._points)
        if nearest_ns > self._max_extrapolation_ns:
            return None
        before = [p for p in self._points if p.t_ns <= t_ns]
        after = [p for p in self._points if p.t_ns > t_ns]
        if before and after:
            return _hermite(before[-1], after[0], t_ns)
        nearest = before[-1] if before else after[0]
        elapsed_s = (t_ns - nearest.t_ns) / NS_PER_S
        pairs = zip(nearest.position_m, nearest.velocity_m_s, strict=True)
        x, y, z = (place + elapsed_s * v for place, v in pairs)
        return x, y, z


def _hermite(a: PlatformPoint, b: PlatformPoint, t_ns: int) -> Vector:
    """Evaluate the cubics through both positions and velocities at a.t_ns <= t_ns <= b.t_ns."""
    h = (b.t_ns - a.t_ns) / NS_PER_S
    s = (t_ns - a.t_ns) / NS_PER_S / h
    places = []
    ends = zip(a.position_m, b.position_m, a.velocity_m_s, b.velocity_m_s, strict=True)
    for first, last, v_first, v_last in ends:
        rise = last - first
        bend = (1.0 - s) * (h * v_first - rise) - s * (h * v_last - rise)
        places.append(first + s * rise + s * (1.0 - s) * bend)
    x, y, z = places
    return x, y, z
