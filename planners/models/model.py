"""Load of n links under a platform: equations of motion, modes and state space."""

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
LENGTHS_M = (1e-3, 1e4)  # bounds of a load in a laboratory
MASSES_KG = (1e-6, 1e9)
GRAVITIES_M_S2 = (1e-3, 1e3)
MAX_JOINT = 1e9  # stiffness [N m/rad] or damping [N m s/rad] of a joint; above it is rigid
LAGS_S = (1e-6, 1e3)
# Time constant of the jerk model's filter: 10 Hz, the value behind the tables of source 004.
LAG_S = 1.0 / (2.0 * math.pi * 10.0)


def cart_for_input(input: str) -> Cart:
    """Select how the platform is held while that input acts: a force leaves it free to roll."""
    return "free" if input == "force" else "driven"


class Equations(NamedTuple):
    """Coefficients of the equations of motion of n links.

    Absolute angles th (0 = hanging, positive = ahead in +X), platform acceleration a:

    sum_j mass_ij (cos(th_i - th_j) th_j'' + sin(th_i - th_j) th_j'^2) + (damping th')_i
    + (springs th)_i + gravity coupling_i sin(th_i) = -coupling_i cos(th_i) a

    A force F on the platform obeys
    (cart_mass + load_mass) y'' + d/dt sum_i coupling_i cos(th_i) th_i' = F.
    Lagrange's equations; source 004, (3.1.1) to (3.1.9) for one link and (4.1.1) to (4.1.8) for
    two.
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
        """Stiffness of springs and gravity for small angles: (n, n)."""
        return self.springs_n_m_rad + np.diag(self.gravity_m_s2 * self.coupling_kg_m)

    def swing(self, cart: Cart = "driven") -> tuple[FloatArray, FloatArray]:
        """Linearise about the hanging position: x' = a x + b s of x = [th, th'].

        a (2n, 2n), b (2n,). s is the acceleration of the platform ("driven"), or of the common
        centre of mass of platform and load ("free"), which the swing does not affect when a force
        acts on the platform.
        """
        c = self.coupling_kg_m
        n = len(c)
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
    """State space x' = a x + b u with named states; the names contain the units."""

    states: tuple[str, ...]  # n
    input: str
    a: FloatArray  # (n, n)
    b: FloatArray  # (n, 1)


class Modes(NamedTuple):
    """Modes of small swings, normalised to unit input.

    q = left_eigenvectors [th, th'] obeys q' = eigenvalues q + s, and [th, th'] = mode_shapes q.
    s is the acceleration that drives the modes. Oscillatory modes come first, as conjugate pairs,
    slowest first.
    """

    eigenvalues_1_s: ComplexArray  # (2n,)
    left_eigenvectors: ComplexArray  # (2n, 2n), one a row
    mode_shapes: ComplexArray  # (2n, 2n), one a column
    gains: FloatArray  # (2n,) |cosine| of the angle between b and the left eigenvector, 0 to 1

    @property
    def upper(self) -> NDArray[np.intp]:
        """Indices of the oscillatory modes: (m,), the eigenvalues in the upper half plane."""
        return np.flatnonzero(self.eigenvalues_1_s.imag > 0.0)

    @property
    def natural_frequencies_hz(self) -> FloatArray:
        """Undamped natural frequencies of the oscillatory modes: (m,)."""
        return np.asarray(np.abs(self.eigenvalues_1_s[self.upper]) / (2.0 * math.pi))

    @property
    def damping_ratios(self) -> FloatArray:
        """Damping ratios of the oscillatory modes: (m,)."""
        rates = self.eigenvalues_1_s[self.upper]
        return np.asarray(0.0 - rates.real / np.abs(rates))


class Model(ABC):
    """Planner's model of the load; immutable and hashable."""

    @property
    @abstractmethod
    def equations(self) -> Equations:
        """Coefficients of the equations of motion of the links."""

    @property
    @abstractmethod
    def parameters(self) -> Mapping[str, float]:
        """Values of all parameters that may be in error, by name, in SI units."""

    @abstractmethod
    def with_parameter(self, name: str, value: float) -> Self:
        """Copy the model with another value; PlanError for a name not in `parameters`."""

    @property
    @abstractmethod
    def links_count(self) -> int:
        """Number of links."""

    def modes(self, cart: Cart = "driven") -> Modes:
        """Compute the modes under a driven platform, or a free one (printed in source 004)."""
        return _modes(self, cart, True)

    @property
    def oscillatory_eigenvalues_1_s(self) -> tuple[complex, ...]:
        """Eigenvalues -zeta w + j w sqrt(1 - zeta^2) under a driven platform, slowest first."""
        modes = self.modes()
        return tuple(modes.eigenvalues_1_s[modes.upper].tolist())

    @property
    def natural_frequency_rad_s(self) -> float:
        """Undamped natural frequency of the slowest mode under a driven platform."""
        return float(np.abs(self.modes().eigenvalues_1_s).min())

    def amplitude_rad(self, angles_rad: FloatArray, rates_rad_s: FloatArray) -> float:
        """Bound the largest angle of any link in free swing from this state: its envelope there.

        angles and rates (n,), small swings. One link with the damping ratio z, w_d = w sqrt(1-z^2):
        sqrt(theta^2 + ((theta' + z w theta) / w_d)^2). Several links: the sum over the modes, which
        is reached when they come into phase.
        """
        n = self.links_count
        modes = self.modes()
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
        """Assemble the state space of platform and small swings.

        States: position, speed, angles, rates, and for the jerk model the acceleration, which
        follows the input with the time constant lag_s (source 004, 3.1.9 to 3.1.11 and 4.1.8).
        Relative angles are those of each link to the one above. Raises PlanError for an unknown
        input.
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
        eigenvalues, shapes = _undamped_eigen(a)
    else:
        eigenvalues, shapes = (part.astype(np.complex128) for part in np.linalg.eig(a))
    order = _conjugate_order(eigenvalues)
    eigenvalues, shapes = eigenvalues[order], shapes[:, order]
    # Clip positive real parts caused by rounding: a hanging load is stable.
    eigenvalues = np.minimum(eigenvalues.real, 0.0) + 1j * eigenvalues.imag
    try:
        left_eigenvectors = np.linalg.inv(shapes)
    except np.linalg.LinAlgError:
        raise PlanError(
            f"two modes of {model} coincide within rounding; must differ: "
            "change a length, a mass or a damping"
        ) from None
    inputs = left_eigenvectors @ b
    gains = np.abs(inputs) / (np.linalg.norm(left_eigenvectors, axis=1) * np.linalg.norm(b))
    divisors = np.where(gains > 0.0, inputs, 1.0)
    return Modes(eigenvalues, left_eigenvectors / divisors[:, None], shapes * divisors, gains)


def _conjugate_order(eigenvalues: ComplexArray) -> NDArray[np.intp]:
    """Order conjugate pairs side by side, slowest first, then the real eigenvalues."""
    upper = np.flatnonzero(eigenvalues.imag > 0.0)
    upper = upper[np.argsort(np.abs(eigenvalues[upper]), kind="stable")]
    pairs = np.column_stack([upper, upper + 1]).ravel()
    real = np.flatnonzero(eigenvalues.imag == 0.0)
    return np.concatenate([pairs, real[np.argsort(np.abs(eigenvalues[real]))]])


def _undamped_eigen(a: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Compute eigenvalues +-jw without any real part, conjugates side by side, and mode shapes."""
    n = len(a) // 2
    squares, vectors = np.linalg.eig(a[n:, :n])
    eigenvalues = 1j * np.repeat(np.sqrt(-squares.real), 2)
    eigenvalues[1::2] *= -1.0
    angles = np.repeat(vectors.real, 2, axis=1)
    return eigenvalues, np.vstack([angles, angles * eigenvalues])


@lru_cache(maxsize=256)
def _state_space(model: Model, input: str, lag_s: float) -> StateSpace:
    n = model.links_count
    equations = model.equations
    size = 2 + 2 * n + (input == "jerk")
    swing = slice(2, 2 + 2 * n)
    a, b = np.zeros((size, size)), np.zeros((size, 1))
    a[0, 1] = 1.0
    a[swing, swing], swing_b = equations.swing(cart_for_input(input))
    if input == "force":
        total_kg = equations.cart_mass_kg + equations.load_mass_kg
        b[swing, 0] = swing_b / total_kg
        b[1, 0] = 1.0 / total_kg
        rates = slice(2 + n, 2 + 2 * n)  # y'' = (F - coupling th'') / total mass
        a[1] = -equations.coupling_kg_m @ a[rates] / total_kg
        b[1] -= equations.coupling_kg_m @ b[rates] / total_kg
    elif input == "acceleration":
        b[1, 0] = 1.0
        b[swing, 0] = swing_b
    else:
        a[1, -1] = 1.0
        a[swing, -1] = swing_b
        a[-1, -1] = -1.0 / lag_s
        b[-1, 0] = 1.0 / lag_s
    input_name = "force_n" if input == "force" else "acceleration_m_s2"
    return StateSpace(_state_names(n, input), input_name, a, b)


def _state_names(n: int, input: str) -> tuple[str, ...]:
    numbers = [""] if n == 1 else [f"_{i + 1}" for i in range(n)]
    names = ["position_m", "speed_m_s"]
    names += [f"angle{number}_rad" for number in numbers]
    names += [f"angular_velocity{number}_rad_s" for number in numbers]
    if input == "jerk":
        names.append("acceleration_m_s2")
    return tuple(names)


def _relative(space: StateSpace, n: int) -> StateSpace:
    to_absolute = np.eye(len(space.states))
    for first in (2, 2 + n):
        to_absolute[first : first + n, first : first + n] = np.tril(np.ones((n, n)))
    names = list(space.states)
    for k in (*range(3, 2 + n), *range(3 + n, 2 + 2 * n)):  # the first link has no link above
        names[k] = f"relative_{names[k]}"
    to_relative = np.asarray(np.linalg.inv(to_absolute), dtype=np.float64)
    return StateSpace(
        tuple(names), space.input, to_relative @ space.a @ to_absolute, to_relative @ space.b
    )
