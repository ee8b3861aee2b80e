"""Motion with piecewise constant acceleration from any start velocity to rest.

The laws in planners start at rest; a drive also changes its target and stops while it moves.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class RampPoint(NamedTuple):
    """Point of a motion."""

    position: float  # [increments]
    velocity: float  # [increments/s]
    acceleration: float  # [increments/s^2]


class RampSegment(NamedTuple):
    """Part of a motion with constant acceleration."""

    duration_s: float
    acceleration: float  # [increments/s^2]


class RampLimits(NamedTuple):
    """Limits of a motion, each > 0."""

    speed: float  # [increments/s]
    acceleration: float  # [increments/s^2]
    deceleration: float  # [increments/s^2]


class RampMotion:
    """Motion of consecutive segments that ends at rest in its target."""

    def __init__(
        self, position: float, velocity: float, target: float, segments: list[RampSegment]
    ) -> None:
        """Start at position [increments] and velocity [increments/s]."""
        self._start = (position, velocity)
        self._segments = segments
        self.target = target
        self.duration_s = sum(segment.duration_s for segment in segments)

    def at(self, t_s: float) -> RampPoint:
        """Compute the point at t_s [s] after the start; at rest in the target after the end."""
        if t_s >= self.duration_s:
            return RampPoint(self.target, 0.0, 0.0)
        position, velocity = self._start
        for duration_s, acceleration in self._segments:
            elapsed_s = min(t_s, duration_s)
            mean = velocity + acceleration * elapsed_s / 2.0
            position += mean * elapsed_s
            velocity += acceleration * elapsed_s
            if t_s < duration_s:
                return RampPoint(position, velocity, acceleration)
            t_s -= duration_s
        return RampPoint(self.target, 0.0, 0.0)


def plan_stop(position: float, velocity: float, deceleration: float) -> RampMotion:
    """Plan a stop over the distance velocity^2 / (2 deceleration); deceleration > 0."""
    segment = _brake_segment(velocity, deceleration)
    target = position + velocity * segment.duration_s / 2.0
    return RampMotion(position, velocity, target, [segment])


def plan_move(position: float, velocity: float, target: float, limits: RampLimits) -> RampMotion:
    """Plan the fastest trapezoidal move to rest in a target from any velocity.

    A move that cannot stop before its target stops behind it and returns. A velocity above the
    speed limit is reduced with the deceleration.
    """
    stop = plan_stop(position, velocity, limits.deceleration)
    segments: list[RampSegment] = []
    direction = math.copysign(1.0, target - stop.target)
    distance = direction * (target - position)  # >= distance to stop
    speed = direction * velocity
    if speed < 0.0:
        segments.append(_brake_segment(velocity, limits.deceleration))
        distance = direction * (target - stop.target)
        speed = 0.0
    for duration_s, rate in _forward_segments(distance, speed, limits):
        segments.append(RampSegment(duration_s, direction * rate))
    return RampMotion(position, velocity, target, segments)


def _brake_segment(velocity: float, deceleration: float) -> RampSegment:
    duration_s = abs(velocity) / deceleration
    return RampSegment(duration_s, -math.copysign(deceleration, velocity))


def _forward_segments(distance: float, speed: float, limits: RampLimits) -> list[RampSegment]:
    """Segments from speed >= 0 to rest after distance, which suffices to stop."""
    acceleration = limits.acceleration
    if speed > limits.speed:
        acceleration = -limits.deceleration
        peak = limits.speed
    else:
        peak = min(_peak_speed(distance, speed, limits), limits.speed)
    change_distance = (peak**2 - speed**2) / (2.0 * acceleration)
    stop_distance = peak**2 / (2.0 * limits.deceleration)
    cruise_distance = max(distance - change_distance - stop_distance, 0.0)
    cruise_s = cruise_distance / peak if peak > 0.0 else 0.0
    return [
        RampSegment((peak - speed) / acceleration, acceleration),
        RampSegment(cruise_s, 0.0),
        RampSegment(peak / limits.deceleration, -limits.deceleration),
    ]


def _peak_speed(distance: float, speed: float, limits: RampLimits) -> float:
    """Peak speed of a move without constant speed; at least the start speed."""
    start_energy = speed**2 / (2.0 * limits.acceleration)
    inverse_sum = 1.0 / (2.0 * limits.acceleration) + 1.0 / (2.0 * limits.deceleration)
    return max(math.sqrt((distance + start_energy) / inverse_sum), speed)


def approach_velocity(velocity: float, target: float, change: float) -> float:
    """Velocity after it approached a target velocity by at most change >= 0 [increments/s]."""
    return min(max(target, velocity - change), velocity + change)
