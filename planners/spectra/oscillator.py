"""Elastic loads excited by the acceleration of their base: masses in a chain, or small swing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from planners.errors import PlanError
from planners.models.model import Model
from planners.spectra.spectrum import speed_steps, transform
from planners.trajectories.driven import accelerations, forced_response, real_part
from planners.trajectories.pieces import ComplexArray, ExpPolynomial, FloatArray, Piece
from planners.trajectories.trajectory import Trajectory

MAX_SHAPE_CONDITION = 1e6  # condition number of the mode shapes; sums of them keep 1e-10


class ModalLoad(NamedTuple):
    """Linear load in modes: q' = rates q + a with the acceleration a of the base, z = Re(shapes q).

    z (n,) are the coordinates relative to the base.
    """

    eigenvalues_1_s: ComplexArray  # (m,) one of each conjugate pair
    mode_shapes: ComplexArray  # (n, m)


@dataclass(frozen=True, kw_only=True)
class MassChain:
    """Chain of n masses; spring and damper i connect mass i to the one before, 1 to the base.

    m z'' + d z' + k z = -m y'' for one mass, z = its position relative to the base y (source 000,
    dynamics of the load).
    Raises PlanError without a mass, unless each mass has a spring and a damper (() = no
    dampers), and for values out of bounds.
    """

    masses_kg: tuple[float, ...]
    stiffnesses_n_m: tuple[float, ...]
    dampings_n_s_m: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.masses_kg)
        object.__setattr__(self, "dampings_n_s_m", self.dampings_n_s_m or (0.0,) * n)
        if n < 1:
            raise PlanError("masses_kg is empty; must hold >= 1 mass: weigh the load")
        _check_values("masses_kg", self.masses_kg, n, zero=False)
        _check_values("stiffnesses_n_m", self.stiffnesses_n_m, n, zero=False)
        _check_values("dampings_n_s_m", self.dampings_n_s_m, n, zero=True)

    @cached_property
    def modal(self) -> ModalLoad:
        """Modes, slowest first. Raises PlanError at critical damping, where two modes coincide."""
        n = len(self.masses_kg)
        fastest = float(self.natural_frequencies_rad_s[-1])
        roots = np.sqrt(np.array(self.masses_kg))
        state = np.zeros((2 * n, 2 * n))  # x = [sqrt(m) z, sqrt(m) z' / fastest] over fastest x t
        state[:n, n:] = np.eye(n)
        state[n:, :n] = -_chain_matrix(self.stiffnesses_n_m) / np.outer(roots, roots) / fastest**2
        state[n:, n:] = -_chain_matrix(self.dampings_n_s_m) / np.outer(roots, roots) / fastest
        rates, shapes = np.linalg.eig(state)
        condition = float(np.linalg.cond(shapes))
        if not condition < MAX_SHAPE_CONDITION:
            raise PlanError(
                f"mode shapes of condition number {condition:.3g}; must be "
                f"< {MAX_SHAPE_CONDITION:g}: the damping is critical, "
                "change a damper by one part in a thousand"
            )
        gains = np.linalg.solve(shapes, np.concatenate([np.zeros(n), -roots / fastest]))
        mode_shapes = shapes[:n] * gains / roots[:, None]
        return _without_conjugates(fastest * rates.astype(np.complex128), mode_shapes)

    @property
    def natural_frequencies_rad_s(self) -> FloatArray:
        """Natural frequencies without the dampers, slowest first: (n,)."""
        roots = 1.0 / np.sqrt(np.array(self.masses_kg))
        stiffness = _chain_matrix(self.stiffnesses_n_m) * np.outer(roots, roots)
        return np.asarray(np.sqrt(np.linalg.eigvalsh(stiffness)))


def suspended_load(model: Model) -> ModalLoad:
    """Compute the modes of small swings under a platform; z are the link angles [rad]."""
    modes = model.modes()
    mode_shapes = modes.mode_shapes[: model.links_count] * (modes.gains > 0.0)
    return _without_conjugates(modes.eigenvalues_1_s, mode_shapes)


def response(
    load: ModalLoad, trajectory: Trajectory, after_s: float = 0.0
) -> tuple[Trajectory, ...]:
    """Compute z(t) of each coordinate from rest, with after_s of free motion as a last piece.

    In closed form, so that peaks are exact too. A step in speed is an impulse. A smooth piece is
    accurate to 1e-12 of its acceleration, the others to rounding.
    Raises PlanError unless after_s is finite and >= 0.
    """
    if not 0.0 <= after_s < math.inf:
        raise PlanError(
            f"after_s = {after_s}; must be finite and >= 0: give some modal periods of the load"
        )
    states = [0j] * load.eigenvalues_1_s.size
    steps = speed_steps(trajectory).tolist()
    pieces: list[list[Piece]] = []
    for step, piece in zip(steps, trajectory.pieces, strict=False):
        states = [q + step for q in states]
        for forcing in accelerations(piece):
            states = _advance(load, forcing, states, pieces)
    if after_s:
        rest = ExpPolynomial(after_s, (0.0,))
        _advance(load, rest, [q + steps[-1] for q in states], pieces)
    return tuple(Trajectory(coordinate) for coordinate in zip(*pieces, strict=True))


def residual(load: ModalLoad, trajectory: Trajectory) -> FloatArray:
    """Compute the amplitude of residual vibration of each coordinate: (n,), summed over modes.

    For one mass |int a exp((delta w_n + j w_d) t) dt| exp(-delta w_n T) / w_d, undamped
    pi V(w_n) / w_n.
    """
    q = transform(trajectory, load.eigenvalues_1_s, trajectory.duration_s)
    return np.asarray(np.abs(load.mode_shapes) @ np.abs(q))


def _advance(
    load: ModalLoad, forcing: ExpPolynomial, states: list[complex], pieces: list[list[Piece]]
) -> list[complex]:
    """Append the piece of every coordinate; return the states at its end."""
    answers = [
        forced_response(forcing, rate, q)
        for rate, q in zip(load.eigenvalues_1_s.tolist(), states, strict=True)
    ]
    coordinates: list[Piece] = []
    for shares in load.mode_shapes.tolist():
        parts = (
            (share, term) for share, terms in zip(shares, answers, strict=True) for term in terms
        )
        coordinates.append(real_part(parts, forcing.duration_s))
    pieces.append(coordinates)
    return [sum((term.at(forcing.duration_s) for term in terms), 0j) for terms in answers]


def _without_conjugates(rates: ComplexArray, mode_shapes: ComplexArray) -> ModalLoad:
    """Keep one mode of each conjugate pair with twice its shape, slowest first."""
    kept = np.flatnonzero(rates.imag >= 0.0)
    kept = kept[np.argsort(np.abs(rates[kept]), kind="stable")]
    factors = np.where(rates[kept].imag > 0.0, 2.0, 1.0)
    return ModalLoad(
        rates[kept].astype(np.complex128), (factors * mode_shapes[:, kept]).astype(np.complex128)
    )


def _check_values(name: str, values: tuple[float, ...], count: int, *, zero: bool) -> None:
    """Raise PlanError unless there are count finite values > 0, or >= 0 where zero is allowed."""
    if len(values) != count:
        raise PlanError(
            f"{name}: {len(values)} values; must be {count}, one a mass: "
            "give one for each mass of the chain"
        )
    for value in values:
        if not 0.0 <= value < math.inf or (value == 0.0 and not zero):
            least = ">= 0" if zero else "> 0"
            raise PlanError(f"{name} = {values}; must be {least} and finite: measure it")


def _chain_matrix(values: tuple[float, ...]) -> FloatArray:
    """Compute the stiffness or damping matrix of the chain, the first link at the base: (n, n)."""
    between = np.eye(len(values)) - np.eye(len(values), k=-1)
    return np.asarray(between.T @ np.diag(values) @ between)
