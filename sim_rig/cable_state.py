"""State of the cable at one instant of an exposure."""

from __future__ import annotations

from typing import NamedTuple

from comms.messages import Position
from sim_rig.bench import SimulatedPlant
from sim_rig.link_angles import LinkState, direction
from sim_rig.vectors import Vector, plus, scaled


class CableState(NamedTuple):
    """Platform and load before a camera."""

    position_m: Position
    links: list[LinkState]
    lengths_m: list[float]  # of the links
    bent_m: list[Vector]  # points of a cable that vibrates, relative to the platform; else []

    @classmethod
    def of(cls, bench: SimulatedPlant) -> CableState:
        """Take the present state of a plant."""
        return cls(bench.position_m, bench.links, bench.link_lengths_m, bench.cable_points_m)

    @property
    def points_m(self) -> list[Vector]:
        """Points of the cable relative to the platform, from it down: the ends of the links."""
        if self.bent_m:
            return self.bent_m
        points: list[Vector] = [(0.0, 0.0, 0.0)]
        for link, length_m in zip(self.links, self.lengths_m, strict=True):
            unit = direction(link.angle_x_rad, link.angle_y_rad)
            points.append(plus(points[-1], scaled(unit, length_m)))
        return points

    @property
    def first_link(self) -> int:
        """Number of points of the first link, from the platform on."""
        return len(self.bent_m) or 2
