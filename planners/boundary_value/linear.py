"""Linear two-point boundary value problem of a Problem, in states and in modal coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from planners.boundary_value.modal_form import ModalForm, modal_form
from planners.boundary_value.parameter_shifts import perturbed_modes, shifted_modes
from planners.errors import PlanError
from planners.models.model import Model, Modes, cart_for_input
from planners.trajectories.pieces import ComplexArray, FloatArray

if TYPE_CHECKING:
    from planners.problem import Problem

MIN_MODE_GAIN = 1e-9  # gain of a mode below which the input does not control its swing
COINCIDING_REL = 1e-6  # share of a frequency within which two modes coincide


class System(NamedTuple):
    """State space x' = a x + b u of platform, swing and sensitivities."""

    states: tuple[str, ...]  # n
    a: FloatArray  # (n, n)
    b: FloatArray  # (n,)
    modal: ModalForm


@dataclass(frozen=True)
class LinearProblem:
    """Linear-quadratic problem: min 1/2 int_0^T (x'Qx + r u^2) dt, x' = a x + b u, start to goal.

    Source 004, section 2.1. The platform's acceleration is a[1] x + b[1] u for every input.
    Sensitivities are the last states.
    """

    system: System
    q: FloatArray  # (n, n), Q
    r: float
    start: FloatArray  # (n,)
    goal: FloatArray  # (n,)
    time_s: float

    @property
    def a(self) -> FloatArray:
        """State matrix (n, n)."""
        return self.system.a

    @property
    def b(self) -> FloatArray:
        """Input vector (n,)."""
        return self.system.b

    @property
    def hamiltonian(self) -> FloatArray:
        """Hamiltonian matrix S of z' = S z for z = [x; costate]: (2n, 2n).

        Source 004, (2.1.9); u = -b'costate/r.
        """
        return np.block([[self.a, np.outer(self.b, -self.b / self.r)], [-self.q, -self.a.T]])

    @property
    def costate_unit(self) -> float:
        """Unit of the modal costates that balances Q and bb'/r; 1 without state weights."""
        largest = float(np.abs(self._modal_weights).max())
        return math.sqrt(largest * self.r) or 1.0

    @property
    def modal_hamiltonian(self) -> ComplexArray:
        """Hamiltonian matrix for z = [xi; costate of xi / costate_unit]: (2n, 2n), complex."""
        modal, unit = self.system.modal, self.costate_unit
        coupling = np.outer(modal.b, modal.b * (-unit / self.r))
        return np.block([[modal.a, coupling], [-self._modal_weights / unit, -modal.a.conj().T]])

    @property
    def _modal_weights(self) -> ComplexArray:
        eigenvectors = self.system.modal.eigenvectors
        return np.asarray(eigenvectors.conj().T @ self.q @ eigenvectors)


def linear_problem(problem: Problem) -> LinearProblem:
    """Assemble states, weights and ends of a problem.

    Every mode that a parameter in `robust` shifts adds two sensitivity states. Raises PlanError
    for a mode that the input does not control, and for a parameter that shifts no mode.
    """
    p = problem
    try:
        system = _system(p.model, p.input, p.lag_s, p.robust)
    except np.linalg.LinAlgError:
        raise PlanError(
            f"the modes of {p.model} coincide; they must differ: change a length or a mass"
        ) from None
    n = len(system.states)
    q = np.zeros((n, n))
    for name, weight in p.state_weights.items():
        k = system.states.index(name)
        q[k, k] = weight
    r = p.input_weight if q.any() else 1.0  # without state weights its value has no effect
    start, goal = p.start(), p.goal()
    start = np.append(start, _end_sensitivities(p, start, n - len(start)))
    goal = np.append(goal, _end_sensitivities(p, goal, n - len(goal)))
    return LinearProblem(system, q, r, start, goal, p.time_s)


def _end_sensitivities(p: Problem, state: FloatArray, count: int) -> FloatArray:
    """Compute the sensitivities at an end: (count,), 0 at rest.

    Where the load swings, they are the derivatives of the modal coordinates by the eigenvalue that
    keep the angles constant to first order.
    """
    swing = state[2 : 2 + 2 * p.model.links_count]
    cart = cart_for_input(p.input)
    if not (count and swing.any()):
        return np.zeros(count)
    if len(p.robust) > 1:
        raise PlanError(
            f"robust = {p.robust} with a swinging end; must be one parameter there: "
            "leave the others out"
        )
    sensitivities = list[float]()
    for k in shifted_modes(p.model, cart, p.robust):
        high, low = perturbed_modes(p.model, cart, p.robust[0])
        z = complex(
            (high.left_eigenvectors[k] - low.left_eigenvectors[k])
            @ swing
            / (high.eigenvalues_1_s[k] - low.eigenvalues_1_s[k])
        )
        sensitivities += [z.real, z.imag]
    return np.array(sensitivities)


@lru_cache(maxsize=256)
def _system(model: Model, input: str, lag_s: float, robust: tuple[str, ...]) -> System:
    space = model.state_space(input, lag_s=lag_s)
    cart = cart_for_input(input)
    modes = model.modes(cart)
    _check_modes(modes, -1.0 / lag_s if input == "jerk" else None)
    shifted = shifted_modes(model, cart, robust)
    n, added = len(space.states), 2 * len(shifted)
    a = np.zeros((n + added, n + added))
    b = np.append(space.b[:, 0], np.zeros(added))
    a[:n, :n] = space.a
    swing = slice(2, 2 + 2 * model.links_count)
    names = list(space.states)
    for i, k in enumerate(shifted):  # z' = mu z + q: derivative of q by its eigenvalue mu
        eigenvalue, row = modes.eigenvalues_1_s[k], modes.left_eigenvectors[k]
        z = n + 2 * i
        a[z : z + 2, z : z + 2] = [
            [eigenvalue.real, -eigenvalue.imag],
            [eigenvalue.imag, eigenvalue.real],
        ]
        a[z, swing] = row.real
        a[z + 1, swing] = row.imag
        names += [f"mode_{k // 2 + 1}_sensitivity_{part}" for part in ("real", "imaginary")]
    return System(tuple(names), a, b, modal_form(model, input, lag_s, modes, shifted, n))


def _check_modes(modes: Modes, filter_1_s: float | None) -> None:
    """Raise PlanError unless modes and filter differ and the input controls every mode."""
    kept = np.flatnonzero(modes.eigenvalues_1_s.imag >= 0.0)
    eigenvalues = modes.eigenvalues_1_s[kept]
    for k, gain in enumerate(modes.gains[kept].tolist()):
        eigenvalue = eigenvalues[k]
        frequency_hz = abs(eigenvalue) / (2 * np.pi)
        near = np.flatnonzero(np.abs(eigenvalues - eigenvalue) <= COINCIDING_REL * abs(eigenvalue))
        if len(near) > 1:
            raise PlanError(
                f"modes {near[0] + 1} and {near[1] + 1} both have {frequency_hz:.6g} Hz; they must "
                f"differ by {COINCIDING_REL:g} of it, or one input cannot control both: "
                "change a length, a stiffness or a damping"
            )
        if filter_1_s is not None and abs(eigenvalue - filter_1_s) <= COINCIDING_REL * abs(
            filter_1_s
        ):
            raise PlanError(
                f"lag_s = {-1.0 / filter_1_s:g} is the decay time of an overdamped mode; must "
                f"differ by {COINCIDING_REL:g} of it: take another filter"
            )
        if gain < MIN_MODE_GAIN:
            raise PlanError(
                f"mode {k + 1} at {frequency_hz:.6g} Hz responds to the input with a gain of "
                f"{gain:.3g}; must be >= {MIN_MODE_GAIN:g} to be controllable: "
                "change a length or a mass"
            )
