"""Controlled stop: positions that run out from the present speed to rest inside the envelope."""

from __future__ import annotations

import math
from collections import deque

from comms.messages import Position, Velocity
from rig.run.tasks.safety import Envelope

AT_REST: Velocity = (0.0, 0.0, 0.0)
SPEED_ROUNDING_M_S = 4e-6  # positions rounded to 1 nm are 5 ms apart


class RunOut:
    """Positions sent on a grid, and those of a stop.

    Acceleration is the change of velocity over a memory of n steps. A stop takes the smallest
    speed in the last direction that differs from each velocity of the memory by at most
    deceleration x n steps. So it decelerates as fast as the envelope allows.
    """

    def __init__(self, envelope: Envelope, step_s: float, memory: int) -> None:
        """step_s: period of the grid. memory: steps between two velocities that are compared."""
        e = envelope
        self._lower = (e.position_min_m, -e.depth_m, -e.height_m)
        self._upper = (e.position_max_m, e.depth_m, e.height_m)
        self._step_s = step_s
        self._change_m_s = e.acceleration_m_s2 * step_s * memory
        self._past = deque([AT_REST] * memory, maxlen=memory)
        self._position: Position | None = None

    def follow(self, position_m: Position, steps: int = 1) -> None:
        """Take a position that is sent, so many steps after the one before."""
        if self._position is not None:
            dt_s = steps * self._step_s
            x, y, z = position_m
            x0, y0, z0 = self._position
            self._past.append(((x - x0) / dt_s, (y - y0) / dt_s, (z - z0) / dt_s))
        self._position = position_m

    def slow_down(self, share: float) -> None:
        """Scale the speed to what a pause of the sender has left of it."""
        slowed = [(x * share, y * share, z * share) for x, y, z in self._past]
        self._past = deque(slowed, maxlen=self._past.maxlen)

    def next(self) -> Position | None:
        """Compute the next position of the stop and take it; None before the first position."""
        if self._position is None:
            return None
        share = self._least_share()
        last = self._past[-1]
        if share == 0.0:
            self._past.append(AT_REST)
            return self._position
        moved = [
            self._inside(axis, place + share * speed * self._step_s)
            for axis, (place, speed) in enumerate(zip(self._position, last, strict=True))
        ]
        position = (moved[0], moved[1], moved[2])
        self.follow(position)
        return position

    def _inside(self, axis: int, value: float) -> float:
        """Limit a coordinate to the envelope, or to where the robot stands beyond it."""
        here = value if self._position is None else self._position[axis]
        lower = min(self._lower[axis], here)
        upper = max(self._upper[axis], here)
        return min(max(value, lower), upper)

    def _least_share(self) -> float:
        """Compute the least share of the last velocity that every velocity of the memory allows.

        One that the last velocity itself exceeds allows any: the envelope was left before.
        """
        last = self._past[-1]
        if math.hypot(*last) <= SPEED_ROUNDING_M_S:
            return 0.0
        allowed = self._change_m_s + SPEED_ROUNDING_M_S
        near = [velocity for velocity in self._past if math.dist(velocity, last) <= allowed]
        return max(_least_share_inside(last, centre, self._change_m_s) for centre in near)


def _least_share_inside(velocity: Velocity, centre: Velocity, radius: float) -> float:
    """Compute the least s >= 0 for which s v lies in a sphere around c: |s v - c| <= r.

    s = (v c - sqrt((v c)^2 - v v (c c - r^2))) / (v v).
    """
    vv = sum(v * v for v in velocity)
    vc = sum(v * c for v, c in zip(velocity, centre, strict=True))
    cc = sum(c * c for c in centre)
    root = math.sqrt(max(0.0, vc * vc - vv * (cc - radius * radius)))
    return min(1.0, max(0.0, (vc - root) / vv))


def duration_ns(envelope: Envelope) -> int:
    """Compute the longest time of a stop, from the largest speed."""
    return round(envelope.speed_m_s / envelope.acceleration_m_s2 * 1e9)
