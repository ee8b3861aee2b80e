"""Interpolator policy `bounded`: linear 30 ms windows whose end is limited by the envelope.

A window has one velocity, so the change of speed over 30 ms is the difference of two windows; it
stays within A = acceleration bound x 30 ms. Behind the reference the controller goes as fast as it
may and still stops no farther than the reference could, which may brake at the same bound. So it
neither overshoots a reference that keeps the envelope, nor sends a setpoint outside it.
"""

from __future__ import annotations

import math
from collections import deque

from comms.messages import Position, Reference, Velocity
from rig.run.tasks.controller.braking import braking_distance_m, stopping_speed_m_s
from rig.run.tasks.grid import TICK_NS, TICK_S, TICKS, WINDOW_S, slowed_by_pause
from rig.run.tasks.safety import POSITION_ROUNDING_M, Envelope

AT_REST: Velocity = (0.0, 0.0, 0.0)
# rounding of 1 nm in positions 10 ms apart, as the safety gate allows it, over a window
VELOCITY_ROUNDING_M_S = 2e-6


class Bounded:
    """Linear windows on the tick grid of t_start_ns, each within reach of the one before."""

    def __init__(self, t_start_ns: int, position_m: Position, envelope: Envelope) -> None:
        self._t_start_ns = t_start_ns
        self._speed_m_s = envelope.speed_m_s
        self._change_m_s = envelope.acceleration_m_s2 * WINDOW_S
        self._tick = self._window = -1
        self._from = self._end = self._sent = position_m
        self._velocity = AT_REST  # in the window
        self._served = 0  # ticks of the window that were served, of _planned
        self._planned = TICKS
        self._past = deque([AT_REST] * TICKS, maxlen=TICKS)  # velocity of each of the last ticks
        self._goal: Reference | None = None
        self._goal_velocity = AT_REST
        self._is_met = False  # the goal was reached once

    def setpoint(self, t_ns: int, newest: Reference | None) -> Position:
        """Compute the setpoint of the tick due at t_ns; newest: newest accepted reference."""
        tick = (t_ns - self._t_start_ns) // TICK_NS
        if tick <= self._tick:
            return self._sent
        skipped = tick - self._tick - 1
        self._tick = tick
        if skipped:
            self._slow_down(slowed_by_pause(skipped))
        is_new = tick // TICKS > self._window
        if is_new:
            self._window = tick // TICKS
            self._take_goal(newest)
        if is_new or skipped:
            self._plan(TICKS - tick % TICKS)
        self._served += 1
        self._past.append(self._velocity)
        share = self._served / self._planned
        self._sent = _between(self._from, self._end, share)
        return self._sent

    def _slow_down(self, share: float) -> None:
        """Scale the velocities to what a pause of the controller left of them."""
        self._past = deque((_scaled(v, share) for v in self._past), maxlen=TICKS)

    def _take_goal(self, newest: Reference | None) -> None:
        old = self._goal
        if newest is None or (old is not None and newest.t_target_ns <= old.t_target_ns):
            return
        if old is not None:
            dt_s = (newest.t_target_ns - old.t_target_ns) * 1e-9
            self._goal_velocity = _velocity(old.position_m, newest.position_m, dt_s)
        self._goal = newest
        self._is_met = False

    def _plan(self, ticks: int) -> None:
        """Plan the rest of the window, of so many ticks; its end is the goal where in reach."""
        start = self._end
        if self._served < self._planned:  # a pause cut the window short of its end
            start = self._sent
            self._is_met = False
        duration_s = ticks * TICK_S
        self._from, self._served, self._planned = start, 0, ticks
        goal = self._open_goal()
        wanted = AT_REST  # without a newer goal
        if goal is not None and goal != start:
            wanted = self._towards(start, goal, duration_s)
        self._velocity = _between(self._past[-1], wanted, self._share_in_reach(wanted))
        self._end = _add(start, self._velocity, duration_s)
        if goal is not None and math.dist(self._end, goal) <= POSITION_ROUNDING_M:
            self._end = goal
            self._is_met = True

    def _open_goal(self) -> Position | None:
        """Return the goal that was not reached so far."""
        if self._goal is None or self._is_met:
            return None
        return self._goal.position_m

    def _towards(self, start: Position, goal: Position, duration_s: float) -> Velocity:
        """Compute the velocity towards the goal, from which braking ends where the goal can."""
        distance_m = math.dist(start, goal)
        full = _velocity(start, goal, duration_s)
        along = sum(v * w for v, w in zip(self._goal_velocity, full, strict=True))
        goal_m_s = max(0.0, along) * duration_s / distance_m
        room_m = distance_m + braking_distance_m(goal_m_s, self._change_m_s)
        stops_m_s = stopping_speed_m_s(room_m, self._change_m_s, duration_s)
        bound_m_s = min(stops_m_s, self._speed_m_s)
        needed_m_s = distance_m / duration_s
        if needed_m_s <= bound_m_s + VELOCITY_ROUNDING_M_S:
            return full
        return _scaled(full, bound_m_s / needed_m_s)

    def _share_in_reach(self, wanted: Velocity) -> float:
        """Compute the share of the change to the wanted velocity that every past tick allows."""
        last = self._past[-1]
        return min(_share_inside(last, wanted, v, self._change_m_s) for v in set(self._past))


def _share_inside(start: Velocity, end: Velocity, centre: Velocity, radius: float) -> float:
    """Compute the share of the way from start to end that stays inside a sphere; 1 = all of it.

    |b + s a|^2 = r^2 with a = end - start, b = start - centre; start is inside.
    """
    if math.dist(end, centre) <= radius + VELOCITY_ROUNDING_M_S:
        return 1.0
    a = [e - s for e, s in zip(end, start, strict=True)]
    b = [s - c for s, c in zip(start, centre, strict=True)]
    aa = sum(x * x for x in a)
    ab = sum(x * y for x, y in zip(a, b, strict=True))
    bb = sum(x * x for x in b)
    root = math.sqrt(max(0.0, ab * ab - aa * (bb - radius * radius)))
    return min(1.0, max(0.0, (root - ab) / aa))


def _velocity(start: Position, end: Position, duration_s: float) -> Velocity:
    return (
        (end[0] - start[0]) / duration_s,
        (end[1] - start[1]) / duration_s,
        (end[2] - start[2]) / duration_s,
    )


def _between(start: Position, end: Position, share: float) -> Position:
    return (
        start[0] + (end[0] - start[0]) * share,
        start[1] + (end[1] - start[1]) * share,
        start[2] + (end[2] - start[2]) * share,
    )


def _add(start: Position, velocity: Velocity, duration_s: float) -> Position:
    return (
        start[0] + velocity[0] * duration_s,
        start[1] + velocity[1] * duration_s,
        start[2] + velocity[2] * duration_s,
    )


def _scaled(velocity: Velocity, share: float) -> Velocity:
    return (velocity[0] * share, velocity[1] * share, velocity[2] * share)
