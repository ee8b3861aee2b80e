"""The linear two-point boundary-value problem behind a Problem, once in states and once in modes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.errors import PlanError
from planners.models.model import Cart, Model, Modes, cart_for_input
from planners.trajectories.pieces import ComplexArray, FloatArray

if TYPE_CHECKING:
    from planners.problem import Problem

UNREACHABLE = 1e-9  # gain of a mode below which its swing is out of the input's reach
COINCIDING = 1e-6  # share of a frequency within which two modes are one
MOVED = 1e-9  # relative shift of a mode for a relative change of 1: what a parameter does not move is below
STEP = 1e-4  # relative change of a parameter to see which modes it moves


class Pairs(NamedTuple):
    """What the products of two impulse responses share, for their integrals."""

    eigenvalues_1_s: ComplexArray  # (m, m) rate_i + conj rate_j of the m distinct rates
    first: NDArray[np.intp]  # (n, 1) which distinct rate a row has
    second: NDArray[np.intp]  # (n,) the same along columns
    powers: NDArray[np.intp]  # (n, n)


class Spectrum(NamedTuple):
    """States as modes: xi = rows x obeys xi' = rates xi + u at power 0, xi' = rates xi + xi[drivers] at power 1.

    So xi answers a unit impulse of u with s^power exp(rate s).
    """

    eigenvalues_1_s: ComplexArray  # (n,) closed under conjugation
    powers: NDArray[np.intp]  # (n,) 0 or 1
    drivers: NDArray[np.intp]  # (n,) index of the power 0 with the same rate
    partners: NDArray[np.intp]  # (n,) index of the complex conjugate, or its own
    rows: ComplexArray  # (n, n)
    columns: ComplexArray  # (n, n), inverse of rows
    a: ComplexArray  # (n, n): xi' = a xi + b u
    b: FloatArray  # (n,)
    pairs: Pairs


class System(NamedTuple):
    """x' = a x + b u of platform, swing and sensitivities."""

    states: tuple[str, ...]  # n
    a: FloatArray  # (n, n)
    b: FloatArray  # (n,)
    spectrum: Spectrum


@dataclass(frozen=True)
class LinearProblem:
    """min 1/2 int_0^T (x'Qx + r u^2) dt over x' = a x + b u from start to goal (source 004, section 2.1).

    The platform's acceleration is a[1] x + b[1] u whatever the input is. Sensitivities are the last states.
    """

    system: System
    q: FloatArray  # (n, n), Q
    r: float
    start: FloatArray  # (n,)
    goal: FloatArray  # (n,)
    time_s: float

    @property
    def a(self) -> FloatArray:
        """(n, n)."""
        return self.system.a

    @property
    def b(self) -> FloatArray:
        """(n,)."""
        return self.system.b

    @property
    def hamiltonian(self) -> FloatArray:
        """S of z' = S z for z = [x; costate]: (2n, 2n), source 004, (2.1.9); u = -b'costate/r."""
        return np.block([[self.a, np.outer(self.b, -self.b / self.r)], [-self.q, -self.a.T]])

    @property
    def costate_unit(self) -> float:
        """What the costates of modes are counted in, so that Q and bb'/r are of one size; 1 without weights."""
        largest = float(np.abs(self._modal_weights).max())
        return math.sqrt(largest * self.r) or 1.0

    @property
    def modal_hamiltonian(self) -> ComplexArray:
        """The same for z = [xi; costate of xi / costate_unit]: (2n, 2n), complex."""
        spectrum, unit = self.system.spectrum, self.costate_unit
        push = np.outer(spectrum.b, spectrum.b * (-unit / self.r))
        return np.block([[spectrum.a, push], [-self._modal_weights / unit, -spectrum.a.conj().T]])

    @property
    def _modal_weights(self) -> ComplexArray:
        columns = self.system.spectrum.columns
        return np.asarray(columns.conj().T @ self.q @ columns)


def linear_problem(problem: Problem) -> LinearProblem:
    """States, weights and ends of a problem, with two sensitivity states for every mode that `robust` names.

    Raises PlanError for a mode out of the input's reach, or a parameter that moves no mode.
    """
    p = problem
    try:
        system = _system(p.model, p.input, p.lag_s, p.robust)
    except np.linalg.LinAlgError:
        raise PlanError(
            f"the modes of {p.model} cannot be told apart; they must differ: change a length or a mass"
        ) from None
    start, goal, n = p.start(), p.goal(), len(system.states)
    q = np.zeros((n, n))
    for name, weight in p.state_weights.items():
        k = system.states.index(name)
        q[k, k] = weight
    weight = p.input_weight if q.any() else 1.0  # alone it weighs nothing against nothing
    start, goal = (np.append(end, _sensitivities(p, end, n - len(end))) for end in (start, goal))
    return LinearProblem(system, q, weight, start, goal, p.time_s)


def _sensitivities(p: Problem, state: FloatArray, count: int) -> FloatArray:
    """Of an end: 0 at rest; where the load swings, what a shift of the parameter makes of the mode's own coordinate, so
    that the angles do not change to first order: (count,)."""
    swing, cart = state[2 : 2 + 2 * p.model.links_count], cart_for_input(p.input)
    if not (count and swing.any()):
        return np.zeros(count)
    if len(p.robust) > 1:
        raise PlanError(
            f"robust = {p.robust} with a swinging end; must be one parameter there: leave the others out"
        )
    more = list[float]()
    for k in _moved_modes(p.model, cart, p.robust):
        high, low = _around(p.model, cart, p.robust[0])
        z = complex(
            (high.left_eigenvectors[k] - low.left_eigenvectors[k])
            @ swing
            / (high.eigenvalues_1_s[k] - low.eigenvalues_1_s[k])
        )
        more += [z.real, z.imag]
    return np.array(more)


@lru_cache(maxsize=256)
def _system(model: Model, input: str, lag_s: float, robust: tuple[str, ...]) -> System:
    space = model.state_space(input, lag_s=lag_s)
    cart = cart_for_input(input)
    modes = model.modes(cart)
    _check_reach(modes, -1.0 / lag_s if input == "jerk" else None)
    moved = _moved_modes(model, cart, robust)
    n, added = len(space.states), 2 * len(moved)
    a, b = np.zeros((n + added, n + added)), np.append(space.b[:, 0], np.zeros(added))
    a[:n, :n] = space.a
    swing = slice(2, 2 + 2 * model.links_count)
    for i, k in enumerate(moved):  # z' = rate z + q: how the mode answers a shift of its rate
        rate, row, z = modes.eigenvalues_1_s[k], modes.left_eigenvectors[k], n + 2 * i
        a[z : z + 2, z : z + 2] = [[rate.real, -rate.imag], [rate.imag, rate.real]]
        a[z, swing], a[z + 1, swing] = row.real, row.imag
    names = tuple(
        f"mode_{k // 2 + 1}_sensitivity_{part}" for k in moved for part in ("real", "imaginary")
    )
    return System((*space.states, *names), a, b, _spectrum(model, input, lag_s, modes, moved, n))


def _spectrum(
    model: Model, input: str, lag_s: float, modes: Modes, moved: tuple[int, ...], n: int
) -> Spectrum:
    """Rows of the platform, of each mode, of each sensitivity, of the filter; with a filter, xi of what follows it is
    q (1 + rate lag) + lag a, so that its impulse response has no part of the filter."""
    jerk = input == "jerk"
    lag, size, swing = (
        (lag_s if jerk else 0.0),
        n + 2 * len(moved),
        slice(2, 2 + 2 * model.links_count),
    )
    rates, powers, drivers, rows = (
        [0j, 0j],
        [0, 1],
        [0, 0],
        np.zeros((size, size), dtype=np.complex128),
    )
    rows[0, 1] = rows[1, 0] = 1.0
    rows[1, 1] = lag
    whole = 1.0
    if jerk:
        rows[0, n - 1] = lag
    if input == "force":
        e = model.equations
        whole = e.cart_mass_kg + e.load_mass_kg
        rows[:2] *= whole
        rows[0, swing.start + model.links_count : swing.stop] = e.coupling_kg_m
        rows[1, swing.start : swing.start + model.links_count] = e.coupling_kg_m
    at = {}
    for k, rate in enumerate(modes.eigenvalues_1_s.tolist()):
        at[k] = len(rates)
        rows[at[k], swing] = whole * (1.0 + rate * lag) * modes.left_eigenvectors[k]
        if jerk:
            rows[at[k], n - 1] = lag
        rates, powers, drivers = [*rates, rate], [*powers, 0], [*drivers, at[k]]
    for i, k in enumerate(moved):
        for mode, sign in ((k, 1j), (k + 1, -1j)):
            row, rate, z = len(rates), complex(modes.eigenvalues_1_s[mode]), n + 2 * i
            rows[row, z], rows[row, z + 1] = (
                whole * (1.0 + rate * lag),
                whole * (1.0 + rate * lag) * sign,
            )
            rows[row, swing] = lag * modes.left_eigenvectors[mode]
            rates, powers, drivers = [*rates, rate], [*powers, 1], [*drivers, at[mode]]
    if jerk:
        rows[len(rates), n - 1] = lag
        rates, powers, drivers = [*rates, complex(-1.0 / lag)], [*powers, 0], [*drivers, len(rates)]
    return _sorted_out(rates, powers, drivers, rows)


def _sorted_out(
    rates: list[complex], powers: list[int], drivers: list[int], rows: ComplexArray
) -> Spectrum:
    keys = list(zip(rates, powers, strict=True))
    partners = np.array([keys.index((rate.conjugate(), power)) for rate, power in keys])
    r, k, d = np.array(rates, dtype=np.complex128), np.array(powers), np.array(drivers)
    a, b = np.zeros((len(r), len(r)), dtype=np.complex128), 1.0 - k
    np.fill_diagonal(a, r)
    a[k == 1, d[k == 1]] = 1.0
    first = np.flatnonzero(k == 0)
    place = np.searchsorted(first, d)
    pairs = Pairs(
        np.add.outer(r[first], r[first].conj()), place[:, None], place, np.add.outer(k, k)
    )
    return Spectrum(r, k, d, partners, rows, np.linalg.inv(rows).astype(np.complex128), a, b, pairs)


def _check_reach(modes: Modes, filter_1_s: float | None) -> None:
    kept = np.flatnonzero(modes.eigenvalues_1_s.imag >= 0.0)
    rates = modes.eigenvalues_1_s[kept]
    for k, gain in enumerate(modes.gains[kept].tolist()):
        near = np.flatnonzero(np.abs(rates - rates[k]) <= COINCIDING * abs(rates[k]))
        if len(near) > 1:
            raise PlanError(
                f"modes {near[0] + 1} and {near[1] + 1} both have {abs(rates[k]) / (2 * np.pi):.6g} Hz; they must differ "
                f"by {COINCIDING:g} of it, or one input cannot reach both: change a length, a stiffness or a damping"
            )
        if filter_1_s is not None and abs(rates[k] - filter_1_s) <= COINCIDING * abs(filter_1_s):
            raise PlanError(
                f"lag_s = {-1.0 / filter_1_s:g} is the decay time of an overdamped mode; must differ by {COINCIDING:g} of it: "
                "take another filter"
            )
        if gain < UNREACHABLE:
            raise PlanError(
                f"mode {k + 1} at {abs(rates[k]) / (2 * np.pi):.6g} Hz answers the input with a gain of {gain:.3g}; must be >= "
                f"{UNREACHABLE:g} to be planned for: change a length or a mass"
            )


def _moved_modes(model: Model, cart: Cart, robust: tuple[str, ...]) -> tuple[int, ...]:
    """Indices (upper half plane) of the modes whose rate any of the parameters shifts."""
    modes, moved = model.modes(cart), set[int]()
    upper = np.flatnonzero(modes.eigenvalues_1_s.imag >= 0.0)
    for name in robust:
        value = model.parameters[name]
        high, low = (other.eigenvalues_1_s[upper] for other in _around(model, cart, name))
        shift = np.abs(high - low) / np.abs(high) / (2 * STEP)
        if not np.any(shift > MOVED):
            raise PlanError(
                f"robust = {name!r}; must shift the frequency or damping of a mode by more than {MOVED:g}, and "
                f"{name} = {value:g} shifts none: leave it out"
            )
        moved |= set(upper[shift > MOVED].tolist())
    for k in moved:
        if modes.eigenvalues_1_s[k].imag == 0.0:
            raise PlanError(
                f"robust = {robust} shifts an overdamped mode (rate {modes.eigenvalues_1_s[k].real:.4g} 1/s); all it shifts "
                "must swing: damp the joints less, or leave it out"
            )
    return tuple(sorted(moved))


def _around(model: Model, cart: Cart, name: str) -> tuple[Modes, Modes]:
    """Modes a small step above and below a parameter's value; from the value itself where the model has an edge."""
    value = model.parameters[name]
    step = STEP * (abs(value) or 1.0)
    out = []
    for side in (step, -step):
        try:
            out.append(model.with_parameter(name, value + side).modes(cart))
        except PlanError:
            out.append(model.modes(cart))
    return out[0], out[1]
