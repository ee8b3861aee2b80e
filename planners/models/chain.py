"""Chain of links under a platform: bars or point masses, springs and dampers in the joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from planners.errors import PlanError, check_range, unknown_name
from planners.models.model import GRAVITIES_M_S2, LENGTHS_M, MASSES_KG, MAX_JOINT, Equations, Model
from planners.trajectories.pieces import FloatArray

KINDS = ("bar", "point")
MAX_LINKS = 20


@dataclass(frozen=True)
class Link:
    """Homogeneous bar, or a massless bar with a point mass at its lower end."""

    length_m: float
    mass_kg: float
    kind: str = "bar"

    def __post_init__(self) -> None:
        check_range("length_m of a link", self.length_m, *LENGTHS_M, "measure it")
        check_range("mass_kg of a link", self.mass_kg, *MASSES_KG, "weigh it")
        if self.kind not in KINDS:
            raise unknown_name("kind of a link", self.kind, KINDS)

    def resized(self, length_m: float) -> Link:
        """Copy the link with another length; a bar's mass scales with it, a point mass does not."""
        if self.kind == "bar":
            mass_kg = self.mass_kg * length_m / self.length_m
        else:
            mass_kg = self.mass_kg
        return Link(length_m, mass_kg, self.kind)


def parse_links(text: str) -> tuple[Link, ...]:
    """Parse "length:mass:kind,..." in m and kg, e.g. "0.5:3.375:bar,0.5:3.375:bar".

    The kind may be left out: bar. Raises PlanError for anything else.
    """
    links = []
    for part in text.split(","):
        words = [word.strip() for word in part.split(":")]
        try:
            if not 2 <= len(words) <= 3:
                raise ValueError
            links.append(Link(float(words[0]), float(words[1]), *words[2:]))
        except PlanError:
            raise
        except ValueError:
            raise PlanError(
                f"link = {part.strip()!r}; must be length:mass:kind in m and kg, "
                f"kind one of {', '.join(KINDS)}: e.g. 0.5:3.375:bar"
            ) from None
    return tuple(links)


@dataclass(frozen=True, kw_only=True)
class ChainModel(Model):
    """Chain of n links from the platform down.

    Joint i connects links i and i + 1; the pivot at the platform is free. damping_ratio holds for
    every mode under a driven platform; the dampers of the joints add to it. Raises PlanError for
    values out of bounds or not one stiffness and damping a joint.
    """

    links: tuple[Link, ...]
    stiffness_n_m_rad: tuple[float, ...] = ()  # n - 1; () = none
    joint_damping_n_m_s_rad: tuple[float, ...] = ()  # n - 1; () = none
    tip_mass_kg: float = 0.0
    damping_ratio: float = 0.0
    gravity_m_s2: float = 9.81
    cart_mass_kg: float = 32.0

    def __post_init__(self) -> None:
        n = len(self.links)
        if not 1 <= n <= MAX_LINKS:
            raise PlanError(f"links: {n}; must be 1 to {MAX_LINKS}: name each as length:mass:kind")
        for name in ("stiffness_n_m_rad", "joint_damping_n_m_s_rad"):
            values = getattr(self, name) or (0.0,) * (n - 1)
            object.__setattr__(self, name, tuple(values))
            if len(values) != n - 1:
                raise PlanError(
                    f"{name}: {len(values)} values; must be {n - 1}, "
                    f"one for each joint between {n} links"
                )
            for value in values:
                check_range(name, value, 0.0, MAX_JOINT, "use 0 for a free joint")
        check_range("tip_mass_kg", self.tip_mass_kg, 0.0, MASSES_KG[1], "weigh it")
        if not 0.0 <= self.damping_ratio < 1.0:
            raise PlanError(
                f"damping_ratio = {self.damping_ratio}; must be >= 0 and < 1: "
                "use 0 where it was not measured"
            )
        check_range("gravity_m_s2", self.gravity_m_s2, *GRAVITIES_M_S2, "use 9.81")
        check_range("cart_mass_kg", self.cart_mass_kg, *MASSES_KG, "weigh it")

    @property
    def links_count(self) -> int:
        """Number of links."""
        return len(self.links)

    @property
    def equations(self) -> Equations:
        """Coefficients of the equations of motion.

        Mass i moves with y' + sum_j arms_ij cos(th_j) th_j'; source 004, (4.1.6), for two bars.
        """
        lengths = np.array([link.length_m for link in self.links])
        masses = np.array([link.mass_kg for link in self.links])
        links_above = np.tril(np.tile(lengths, (len(lengths), 1)), -1)
        arms = links_above + np.diag(lengths * self._centres())  # (n, n): mass, link
        inertias = np.array([_inertia(link) for link in self.links])
        tip = self.tip_mass_kg
        mass = (
            arms.T @ (masses[:, None] * arms) + np.diag(inertias) + tip * np.outer(lengths, lengths)
        )
        coupling = masses @ arms + tip * lengths
        return Equations(
            mass_kg_m2=mass,
            coupling_kg_m=coupling,
            springs_n_m_rad=_joint_matrix(self.stiffness_n_m_rad),
            damping_n_m_s_rad=_joint_matrix(self.joint_damping_n_m_s_rad)
            + self._modal_damping(mass, coupling),
            gravity_m_s2=self.gravity_m_s2,
            load_mass_kg=float(masses.sum()) + tip,
            cart_mass_kg=self.cart_mass_kg,
        )

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values by name: length_i, mass_i, stiffness_i, joint_damping_i, and the common ones.

        The names of a single link have no number.
        """
        values: dict[str, float] = {}
        for i, link in enumerate(self.links):
            number = f"_{i + 1}" if len(self.links) > 1 else ""
            values[f"length{number}"] = link.length_m
            values[f"mass{number}"] = link.mass_kg
        joints = zip(self.stiffness_n_m_rad, self.joint_damping_n_m_s_rad, strict=True)
        for i, (stiffness, damping) in enumerate(joints):
            values[f"stiffness_{i + 1}"] = stiffness
            values[f"joint_damping_{i + 1}"] = damping
        values["tip_mass"] = self.tip_mass_kg
        values["damping_ratio"] = self.damping_ratio
        values["gravity"] = self.gravity_m_s2
        values["cart_mass"] = self.cart_mass_kg
        return values

    def with_parameter(self, name: str, value: float) -> Self:
        """Copy the chain with another value of one of `parameters`.

        The mass of a bar scales with its length. Raises PlanError for an unknown name.
        """
        if name not in self.parameters:
            raise unknown_name("parameter", name, self.parameters)
        common = {"tip_mass": "tip_mass_kg", "gravity": "gravity_m_s2", "cart_mass": "cart_mass_kg"}
        changes: dict[str, Any]
        if name in (*common, "damping_ratio"):
            changes = {common.get(name, name): value}
            return replace(self, **changes)
        kind, _, number = name.rpartition("_") if name[-1].isdigit() else (name, "", "1")
        i = int(number) - 1
        if kind in ("length", "mass"):
            link = self.links[i]
            new = link.resized(value) if kind == "length" else replace(link, mass_kg=value)
            return replace(self, links=(*self.links[:i], new, *self.links[i + 1 :]))
        attributes = {"stiffness": "stiffness_n_m_rad", "joint_damping": "joint_damping_n_m_s_rad"}
        attribute = attributes[kind]
        values = getattr(self, attribute)
        changes = {attribute: (*values[:i], value, *values[i + 1 :])}
        return replace(self, **changes)

    def _centres(self) -> FloatArray:
        """Locate the centre of mass of each link as a share of its length: (n,)."""
        return np.array([0.5 if link.kind == "bar" else 1.0 for link in self.links])

    def _modal_damping(self, mass: FloatArray, coupling: FloatArray) -> FloatArray:
        """Compute the damping matrix that gives every mode damping_ratio: (n, n).

        2 zeta M Phi W Phi' M with Phi' M Phi = 1 (Caughey 1960).
        """
        if self.damping_ratio == 0.0:
            return np.zeros_like(mass)
        stiffness = _joint_matrix(self.stiffness_n_m_rad) + np.diag(self.gravity_m_s2 * coupling)
        inverse = np.linalg.inv(np.linalg.cholesky(mass))
        squares, vectors = np.linalg.eigh(inverse @ stiffness @ inverse.T)
        shapes = mass @ inverse.T @ vectors
        return np.asarray(2.0 * self.damping_ratio * (shapes * np.sqrt(squares)) @ shapes.T)


def _inertia(link: Link) -> float:
    """Compute the moment of inertia about the link's own centre of mass [kg m^2]."""
    return link.mass_kg * link.length_m**2 / 12.0 if link.kind == "bar" else 0.0


def _joint_matrix(values: tuple[float, ...]) -> FloatArray:
    """Assemble the matrix of the joints between neighbours for absolute angles: (n, n)."""
    out = np.zeros((len(values) + 1, len(values) + 1))
    for i, value in enumerate(values):
        out[i : i + 2, i : i + 2] += value * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return out
