"""A load of n links hanging under a platform: the equations every planner and every replay works with."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import lru_cache
from typing import Literal, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from planners.errors import PlanError, check_range, unknown_name
from planners.trajectories.pieces import ComplexArray, FloatArray

Cart: TypeAlias = Literal["driven", "free"]

INPUTS = ("acceleration", "force", "jerk")
LENGTHS_M, MASSES_KG, GRAVITIES_M_S2 = (
    (1e-3, 1e4),
    (1e-6, 1e9),
    (1e-3, 1e3),
)  # what a laboratory may hold
JOINTS = 1e9  # N m/rad, N m s/rad: stiffer is a weld
LAGS_S = (1e-6, 1e3)
LAG_S = 1.0 / (
    2.0 * math.pi * 10.0
)  # of the jerk model's filter: 10 Hz, the value behind source 004's tables


def cart_of(input: str) -> Cart:
    """How the platform is held while that input acts: a force leaves it free."""
    return "free" if input == "force" else "driven"


class Equations(NamedTuple):
    """Motion of n links, absolute angles th (0 = hanging, positive = ahead in +X), platform acceleration a:

    sum_j mass_ij (cos(th_i - th_j) th_j'' + sin(th_i - th_j) th_j'^2) + (damping th')_i + (springs th)_i
    + gravity coupling_i sin(th_i) = -coupling_i cos(th_i) a

    and of a platform pushed by a force F: (cart_mass + load_mass) y'' + d/dt sum_i coupling_i cos(th_i) th_i' = F.
    Lagrange's equations; source 004, (3.1.1) to (3.1.9) for one link and (4.1.1) to (4.1.8) for two.
    """

    mass_kg_m2: FloatArray  # (n, n)
    coupling_kg_m: FloatArray  # (n,)
    springs_n_m_rad: FloatArray  # (n, n)
    damping_n_m_s_rad: FloatArray  # (n, n)
    gravity_m_s2: float
    load_mass_kg: float
    cart_mass_kg: float

    @property
    def stiffness_n_m_rad(self) -> FloatArray:
        """Springs and gravity for small angles: (n, n)."""
        return self.springs_n_m_rad + np.diag(self.gravity_m_s2 * self.coupling_kg_m)

    def swing(self, cart: Cart = "driven") -> tuple[FloatArray, FloatArray]:
        """Small swings x' = a x + b s of x = [th, th']: (2n, 2n) and (2n,).

        s is the acceleration of the platform ("driven"), or of the common centre of mass of platform and load
        ("free"): a force on the platform does not feel the swing when that point is looked at.
        """
        n, c = len(self.coupling_kg_m), self.coupling_kg_m
        mass = self.mass_kg_m2
        if cart == "free":
            mass = mass - np.outer(c, c) / (self.cart_mass_kg + self.load_mass_kg)
        a, b = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
        a[:n, n:] = np.eye(n)
        right = np.linalg.solve(
            mass, np.column_stack([self.stiffness_n_m_rad, self.damping_n_m_s_rad, c])
        )
        a[n:, :n], a[n:, n:], b[n:] = -right[:, :n], -right[:, n : 2 * n], -right[:, 2 * n]
        return a, b


class StateSpace(NamedTuple):
    """x' = a x + b u with named states; units stand in the names."""

    states: tuple[str, ...]  # n
    input: str
    a: FloatArray  # (n, n)
    b: FloatArray  # (n, 1)


class Modes(NamedTuple):
    """Small swings taken apart: q = filters [th, th'] obeys q' = rates q + s, and [th, th'] = shapes q.

    Oscillating modes come first, as conjugate pairs, slowest first; s is the acceleration that drives them.
    """

    eigenvalues_1_s: ComplexArray  # (2n,) eigenvalues
    left_eigenvectors: ComplexArray  # (2n, 2n)
    mode_shapes: ComplexArray  # (2n, 2n)
    gains: FloatArray  # (2n,) how well s reaches each mode: cosine of the angle to its left eigenvector

    @property
    def upper(self) -> NDArray[np.intp]:
        """One index for each oscillating mode: (m,), the eigenvalue in the upper half plane."""
        return np.flatnonzero(self.eigenvalues_1_s.imag > 0.0)

    @property
    def natural_frequencies_hz(self) -> FloatArray:
        """Undamped frequencies of the oscillating modes: (m,)."""
        return np.asarray(np.abs(self.eigenvalues_1_s[self.upper]) / (2.0 * math.pi))

    @property
    def damping_ratios(self) -> FloatArray:
        """Of the oscillating modes: (m,)."""
        rates = self.eigenvalues_1_s[self.upper]
        return np.asarray(0.0 - rates.real / np.abs(rates))


class Model(ABC):
    """What a planner believes about the load; immutable and hashable."""

    @property
    @abstractmethod
    def equations(self) -> Equations:
        """The motion of the links."""

    @property
    @abstractmethod
    def parameters(self) -> Mapping[str, float]:
        """Every parameter that may be wrong, by name, in SI units."""

    @abstractmethod
    def with_parameter(self, name: str, value: float) -> Self:
        """The same load with another value. Raises PlanError for a name that is not in `parameters`."""

    @property
    @abstractmethod
    def links_count(self) -> int:
        """How many links hang on each other."""

    def modes(self, cart: Cart = "driven") -> Modes:
        """Small swings under a platform that is driven (held), or free to roll (source 004 prints the latter)."""
        return _modes(self, cart, True)

    @property
    def swing_rates_1_s(self) -> tuple[complex, ...]:
        """Eigenvalues -zeta w + j w sqrt(1 - zeta^2) under a driven platform, slowest first."""
        modes = self.modes()
        return tuple(modes.eigenvalues_1_s[modes.upper].tolist())

    @property
    def natural_frequency_rad_s(self) -> float:
        """Undamped, of the slowest mode under a driven platform."""
        return float(np.abs(self.modes().eigenvalues_1_s).min())

    def amplitude_rad(self, angles_rad: FloatArray, rates_rad_s: FloatArray) -> float:
        """Largest angle of any link that free small swings from here can reach, were they not damped: angles and rates (n,).

        For one link sqrt(theta^2 + (theta'/w)^2); for several the sum over modes, which they meet when in phase.
        """
        modes, n = _modes(self, "driven", False), self.links_count
        q = modes.left_eigenvectors @ np.concatenate(
            [np.atleast_1d(angles_rad), np.atleast_1d(rates_rad_s)]
        )
        return float(np.max(np.abs(modes.mode_shapes[:n]) @ np.abs(q)))

    def state_space(
        self,
        input: str = "acceleration",
        *,
        lag_s: float = LAG_S,
        angles: Literal["absolute", "relative"] = "absolute",
    ) -> StateSpace:
        """Platform and small swings (source 004, 3.1.9 to 3.1.11 and 4.1.8): position, speed, angles, rates, and for the
        jerk model the acceleration, which follows the input with the time constant lag_s.

        Relative angles are those of each link to the one above. Raises PlanError for an unknown input.
        """
        if input not in INPUTS:
            raise unknown_name("input", input, INPUTS)
        check_range("lag_s", lag_s, *LAGS_S, "leave it out for the default")
        space = _state_space(self, input, lag_s)
        return space if angles == "absolute" else _relative(space, self.links_count)


@lru_cache(maxsize=256)
def _modes(model: Model, cart: Cart, damped: bool) -> Modes:
    a, b = model.equations.swing(cart)
    if not (damped and np.any(model.equations.damping_n_m_s_rad)):
        rates, shapes = _undamped(a)
    else:
        rates, shapes = (part.astype(np.complex128) for part in np.linalg.eig(a))
    order = _paired(rates)
    rates, shapes = rates[order], shapes[:, order]
    rates = (
        np.minimum(rates.real, 0.0) + 1j * rates.imag
    )  # what hangs does not grow; rounding may say so
    try:
        filters = np.linalg.inv(shapes)
    except np.linalg.LinAlgError:
        raise PlanError(
            f"two modes of {model} are one to rounding; must differ: change a length, a mass or a damping"
        ) from None
    reach = filters @ b
    gains = np.abs(reach) / (np.linalg.norm(filters, axis=1) * np.linalg.norm(b))
    safe = np.where(gains > 0.0, reach, 1.0)
    return Modes(rates, filters / safe[:, None], shapes * safe, gains)


def _paired(rates: ComplexArray) -> NDArray[np.intp]:
    """Conjugates side by side as they come, slowest first; then what does not oscillate."""
    upper = np.flatnonzero(rates.imag > 0.0)
    upper = upper[np.argsort(np.abs(rates[upper]), kind="stable")]
    alone = np.flatnonzero(rates.imag == 0.0)
    return np.concatenate(
        [np.column_stack([upper, upper + 1]).ravel(), alone[np.argsort(np.abs(rates[alone]))]]
    )


def _undamped(a: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Eigenvalues +-jw without any real part, conjugates side by side."""
    n = len(a) // 2
    squares, vectors = np.linalg.eig(a[n:, :n])
    rates = 1j * np.repeat(np.sqrt(-squares.real), 2)
    rates[1::2] *= -1.0
    both = np.repeat(vectors.real, 2, axis=1)
    return rates, np.vstack([both, both * rates])


@lru_cache(maxsize=256)
def _state_space(model: Model, input: str, lag_s: float) -> StateSpace:
    n, equations = model.links_count, model.equations
    size = 2 + 2 * n + (input == "jerk")
    swing = slice(2, 2 + 2 * n)
    a, b = np.zeros((size, size)), np.zeros((size, 1))
    a[0, 1] = 1.0
    a[swing, swing], push = equations.swing(cart_of(input))
    if input == "force":
        whole = equations.cart_mass_kg + equations.load_mass_kg
        b[swing, 0] = push / whole
        b[1, 0] = 1.0 / whole
        rates = slice(2 + n, 2 + 2 * n)  # y'' = (F - coupling th'') / whole
        a[1] = -equations.coupling_kg_m @ a[rates] / whole
        b[1] -= equations.coupling_kg_m @ b[rates] / whole
    elif input == "acceleration":
        b[1, 0], b[swing, 0] = 1.0, push
    else:
        a[1, -1], a[swing, -1] = 1.0, push
        a[-1, -1], b[-1, 0] = -1.0 / lag_s, 1.0 / lag_s
    return StateSpace(
        _state_names(n, input), "force_n" if input == "force" else "acceleration_m_s2", a, b
    )


def _state_names(n: int, input: str) -> tuple[str, ...]:
    marks = [""] if n == 1 else [f"_{i + 1}" for i in range(n)]
    angles = [
        *(f"angle{mark}_rad" for mark in marks),
        *(f"angular_velocity{mark}_rad_s" for mark in marks),
    ]
    return ("position_m", "speed_m_s", *angles, *(["acceleration_m_s2"] if input == "jerk" else []))


def _relative(space: StateSpace, n: int) -> StateSpace:
    to_absolute = np.eye(len(space.states))
    for first in (2, 2 + n):
        to_absolute[first : first + n, first : first + n] = np.tril(np.ones((n, n)))
    later = {
        name for k, name in enumerate(space.states) if 3 <= k < 2 + n or 3 + n <= k < 2 + 2 * n
    }
    names = tuple(f"relative_{name}" if name in later else name for name in space.states)
    to_relative = np.asarray(np.linalg.inv(to_absolute), dtype=np.float64)
    return StateSpace(
        names, space.input, to_relative @ space.a @ to_absolute, to_relative @ space.b
    )
