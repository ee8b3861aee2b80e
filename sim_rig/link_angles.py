"""Angles of a link in the planes x and y, and its unit vector from the upper to the lower end."""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_rig.load_params import LinkParams
from sim_rig.vectors import Vector


class LinkState(NamedTuple):
    """Angles and rates of a link in the planes x and y: tan = horizontal over downward part."""

    angle_x_rad: float
    angle_y_rad: float
    rate_x_rad_s: float
    rate_y_rad_s: float


def direction(angle_x_rad: float, angle_y_rad: float) -> Vector:
    """Compute the unit vector whose views along y and x show these angles."""
    x, y = math.tan(angle_x_rad), math.tan(angle_y_rad)
    size = math.sqrt(1.0 + x * x + y * y)
    return x / size, y / size, -1.0 / size


def rate(u: Vector, link: LinkParams) -> Vector:
    """Compute the derivative of the unit vector u from the rates of the two angles."""
    x, y = math.tan(link.initial_x_rad), math.tan(link.initial_y_rad)
    vx = (1.0 + x * x) * link.initial_rate_x_rad_s  # of u / |u_z|
    vy = (1.0 + y * y) * link.initial_rate_y_rad_s
    down = -u[2]
    along = (u[0] * vx + u[1] * vy) * down
    return down * vx - along * u[0], down * vy - along * u[1], -along * u[2]


def state(u: Vector, w: Vector) -> LinkState:
    """Compute the angles of a unit vector u and their rates from its derivative w."""
    ux, uy, uz = u
    wx, wy, wz = w
    flat_x, flat_y = ux * ux + uz * uz, uy * uy + uz * uz
    return LinkState(
        math.atan2(ux, -uz),
        math.atan2(uy, -uz),
        (ux * wz - uz * wx) / flat_x if flat_x else 0.0,
        (uy * wz - uz * wy) / flat_y if flat_y else 0.0,
    )
