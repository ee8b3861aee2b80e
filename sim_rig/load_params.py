"""Parameters of the simulated load: links, damping, pushes; bounds are checked at decoding."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

MAX_LINKS = 20
Angle = Annotated[float, Meta(ge=-1.5, le=1.5)]
Rate = Annotated[float, Meta(ge=-50.0, le=50.0)]
NotNegative = Annotated[float, Meta(ge=0.0, le=1e6)]
Force = Annotated[float, Meta(ge=-1e4, le=1e4)]


class LinkParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Link of the load, from the platform down (`[[bench.links]]`).

    point: massless cable with a point mass at its lower end. bar: homogeneous thin bar. The joint
    of a link is that at its upper end: to the link above, or to the platform.
    """

    length_m: Annotated[float, Meta(ge=0.01, le=20.0)]
    mass_kg: Annotated[float, Meta(gt=0.0, le=1000.0)]
    kind: Literal["point", "bar"] = "point"
    joint_stiffness_n_m_rad: NotNegative = 0.0
    joint_damping_n_m_s_rad: NotNegative = 0.0
    breaking_n: Annotated[float, Meta(gt=0.0, le=1e9)] = 1e9  # tension at which a cable tears
    drag_n_s2_m2: NotNegative = 0.0  # force of the air over the square of the speed of the mass
    # at the start, in the planes x and y: tan = horizontal over downward component
    initial_x_rad: Angle = 0.0
    initial_y_rad: Angle = 0.0
    initial_rate_x_rad_s: Rate = 0.0
    initial_rate_y_rad_s: Rate = 0.0


class LoadParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Common properties of the links (`[bench.load]`)."""

    gravity_m_s2: Annotated[float, Meta(gt=0.0, le=30.0)] = 9.81
    # of every small oscillation under a platform that stands
    damping_ratio: Annotated[float, Meta(ge=0.0, lt=1.0)] = 0.000237
    pivot_friction_n_m: NotNegative = 0.0  # Coulomb, at the platform
    tip_mass_kg: Annotated[float, Meta(ge=0.0, le=1000.0)] = 0.0  # at the end of the last link


class Push(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Push by hand (`[[bench.pushes]]`): a constant force on the lower end of a link.

    Times count from the start of the run. Raises ValueError for a push without a force.
    """

    at_s: Annotated[float, Meta(ge=0.0, le=1e5)]
    duration_s: Annotated[float, Meta(ge=0.001, le=100.0)] = 0.1
    force_n: tuple[Force, Force, Force]  # along x, y, z
    link: Annotated[int, Meta(ge=1, le=MAX_LINKS)] = 1

    def __post_init__(self) -> None:
        if not any(self.force_n):
            raise ValueError(
                "force_n = 0 of a push; must have a component: give it in N, or leave the push out"
            )


class LengthChange(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Change of the length of the only cable (`[[bench.length_changes]]`), by the harmonic law.

    Times count from the start of the run.
    """

    at_s: Annotated[float, Meta(ge=0.0, le=1e5)]
    duration_s: Annotated[float, Meta(ge=0.05, le=100.0)] = 1.0
    change_m: Annotated[float, Meta(ge=-20.0, le=20.0)]


class CableParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Vibration of the only cable itself (`[bench.cable]`): first modes of a string."""

    linear_density_kg_m: Annotated[float, Meta(gt=0.0, le=10.0)] = 0.0009  # nylon of 1 mm
    modes: Annotated[int, Meta(ge=1, le=10)] = 3
    damping_ratio: Annotated[float, Meta(gt=0.0, lt=1.0)] = 0.01  # of each mode
