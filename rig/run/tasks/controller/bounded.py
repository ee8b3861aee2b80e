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
from rig.run.tasks.controller.vectors import ZERO, between, dot, moved, rate, scaled, share_inside
from rig.run.tasks.controller.workspace import Workspace
from rig.run.tasks.grid import TICK_NS, TICK_S, TICKS, WINDOW_NS, WINDOW_S, slowed_by_pause
from rig.run.tasks.safety import POSITION_ROUNDING_M, Envelope

# rounding of 1 nm in positions 10 ms apart, as the safety gate allows it, over a window
VELOCITY_ROUNDING_M_S = 2e-6


class Bounded:
    """Linear windows on the tick grid of t_start_ns, each within reach of the one before."""

    def __init__(self, t_start_ns: int, position_m: Position, envelope: Envelope) -> None:
        self._t_start_ns = t_start_ns
        self._speed_m_s = envelope.speed_m_s
        self._change_m_s = envelope.acceleration_m_s2 * WINDOW_S
        self._workspace = Workspace(envelope, position_m)
        self._tick = self._window = -1
        self._from = self._end = self._sent = position_m
        self._velocity = ZERO  # in the window
        self._served = 0  # ticks of the window that were served, of _planned
        self._planned = TICKS
        self._past = deque([ZERO] * TICKS, maxlen=TICKS)  # velocity of each of the last ticks
        self._goal: Reference | None = None
        self._goal_velocity = ZERO
        self._is_met = False  # the goal was reached once
        self._is_goal_planned = False
        # the window goes from a reference to that of 30 ms later, which is inside the envelope
        self._is_on_plan = False

    def setpoint(self, t_ns: int, newest: Reference | None, is_planned: bool = True) -> Position:
        """Compute the setpoint of the tick due at t_ns.

        newest: newest accepted reference. is_planned: it was received, not estimated from others.
        """
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
            self._take_goal(newest, is_planned)
        if is_new or skipped:
            self._plan(TICKS - tick % TICKS)
        self._served += 1
        self._past.append(self._velocity)
        share = self._served / self._planned
        self._sent = between(self._from, self._end, share)
        return self._sent

    def _slow_down(self, share: float) -> None:
        """Scale the velocities to what a pause of the controller left of them."""
        for _ in range(TICKS):
            self._past.append(scaled(self._past[0], share))

    def _take_goal(self, newest: Reference | None, is_planned: bool) -> None:
        old = self._goal
        if newest is None or (old is not None and newest.t_target_ns <= old.t_target_ns):
            return
        if old is not None:
            dt_ns = newest.t_target_ns - old.t_target_ns
            self._goal_velocity = rate(old.position_m, newest.position_m, dt_ns * 1e-9)
            are_planned = is_planned and self._is_goal_planned
            self._is_on_plan = are_planned and self._is_met and dt_ns == WINDOW_NS
        self._goal = newest
        self._is_goal_planned = is_planned
        self._is_met = False

    def _plan(self, ticks: int) -> None:
        """Plan the rest of the window, of so many ticks; its end is the goal where in reach."""
        start = self._end
        if self._served < self._planned:  # a pause cut the window short of its end
            start = self._sent
            self._is_met = self._is_on_plan = False
        duration_s = ticks * TICK_S
        self._from, self._served, self._planned = start, 0, ticks
        goal = self._open_goal()
        self._velocity = self._reachable(start, goal, duration_s)
        end = moved(start, self._velocity, duration_s)
        if self._is_on_plan and goal is not None and not _is_near(end, goal):
            # the references ask for more than the envelope: the workspace bounds the way as well
            self._is_on_plan = False
            self._velocity = self._reachable(start, goal, duration_s)
            end = moved(start, self._velocity, duration_s)
        self._end = self._workspace.inside(end)
        if goal is not None and _is_near(self._end, goal):
            self._end = goal
            self._is_met = True

    def _reachable(self, start: Position, goal: Position | None, duration_s: float) -> Velocity:
        """Compute the velocity of a window towards the goal that the past ticks allow."""
        wanted = ZERO  # without a newer goal
        if goal is not None and goal != start:
            wanted = self._towards(start, goal, duration_s)
        return between(self._past[-1], wanted, self._share_in_reach(wanted))

    def _open_goal(self) -> Position | None:
        """Return the goal that was not reached so far."""
        if self._goal is None or self._is_met:
            return None
        return self._goal.position_m

    def _towards(self, start: Position, goal: Position, duration_s: float) -> Velocity:
        """Compute the velocity towards the goal, from which braking ends where the goal can."""
        distance_m = math.dist(start, goal)
        full = rate(start, goal, duration_s)
        needed_m_s = distance_m / duration_s
        goal_m_s = max(0.0, dot(self._goal_velocity, full)) / needed_m_s
        room_m = distance_m + braking_distance_m(goal_m_s, self._change_m_s)
        rounding_m_s = VELOCITY_ROUNDING_M_S
        if not self._is_on_plan:
            room_m = min(room_m, self._workspace.room_m(start, full))
            rounding_m_s = 0.0
        stops_m_s = self._stopping_speed_m_s(room_m, duration_s)
        bound_m_s = min(stops_m_s, self._speed_m_s)
        if needed_m_s <= bound_m_s + rounding_m_s:
            return full
        return scaled(full, bound_m_s / needed_m_s)

    def _stopping_speed_m_s(self, room_m: float, duration_s: float) -> float:
        """Compute the largest speed from which braking ends within room_m.

        After a window that a pause cut short, faster ticks before it still bound the braking.
        """
        stops_m_s = stopping_speed_m_s(room_m, self._change_m_s, duration_s)
        top_m_s = max(math.hypot(*velocity) for velocity in self._past)
        is_whole = duration_s > WINDOW_S - 0.5 * TICK_S
        if is_whole or top_m_s <= stops_m_s:
            return stops_m_s
        left_m = room_m - braking_distance_m(top_m_s, self._change_m_s)
        return max(0.0, left_m / duration_s)

    def _share_in_reach(self, wanted: Velocity) -> float:
        """Compute the share of the change to the wanted velocity that every past tick allows."""
        last = self._past[-1]
        share = 1.0
        for velocity in set(self._past):
            if math.dist(wanted, velocity) > self._change_m_s + VELOCITY_ROUNDING_M_S:
                reach = share_inside(last, wanted, velocity, self._change_m_s)
                share = min(share, reach)
        return share


def _is_near(position: Position, goal: Position) -> bool:
    return math.dist(position, goal) <= POSITION_ROUNDING_M
