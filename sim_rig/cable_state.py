"""State of the cable at one instant of an exposure."""

from __future__ import annotations

from typing import NamedTuple

from comms.messages import Position
from sim_rig.bench import SimulatedPlant
from sim_rig.link_angles import LinkState
from sim_rig.vectors import Vector


class CableState(NamedTuple):
    """Platform, angles of the links, and points of the cable relative to the platform."""

    position_m: Position
    links: list[LinkState]
    points_m: list[Vector]  # from the platform down: ends of the links, or points of a bent cable
    is_bent: bool  # the only link vibrates

    @classmethod
    def of(cls, bench: SimulatedPlant) -> CableState:
        """Take the present state of a plant."""
        points_m = bench.cable_points_m
        links = bench.links
        return cls(bench.position_m, links, points_m, len(points_m) - 1 > len(links))

    @property
    def first_link(self) -> int:
        """Number of points of the first link, from the platform on."""
        return len(self.points_m) if self.is_bent else 2
