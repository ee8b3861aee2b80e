"""Workspace of the platform: the box of [safety]."""

from __future__ import annotations

import math

from comms.messages import Position
from rig.run.tasks.controller.vectors import Vector
from rig.run.tasks.safety import Envelope


class Workspace:
    """Box along x, y and z; one that a position lies outside of extends to it."""

    def __init__(self, envelope: Envelope, position_m: Position) -> None:
        e = envelope
        lower = (e.position_min_m, -e.depth_m, -e.height_m)
        upper = (e.position_max_m, e.depth_m, e.height_m)
        self.lower = tuple(map(min, lower, position_m))
        self.upper = tuple(map(max, upper, position_m))

    def room_m(self, start: Vector, direction: Vector) -> float:
        """Compute the way from start to the end of the box in a direction; 0 at or beyond it."""
        length = math.hypot(*direction)
        if length == 0.0:
            return math.inf
        room = math.inf
        for axis, part in enumerate(direction):
            if part:
                end = self.upper[axis] if part > 0.0 else self.lower[axis]
                room = min(room, max(0.0, (end - start[axis]) / part))
        return room * length

    def inside(self, position: Vector) -> Vector:
        """Return the nearest point of the box."""
        x, y, z = (
            min(max(value, lower), upper)
            for value, lower, upper in zip(position, self.lower, self.upper, strict=True)
        )
        return (x, y, z)
