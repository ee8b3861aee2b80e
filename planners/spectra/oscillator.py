"""An elastic load behind the motion: masses in a chain, or any small swing, moved by the acceleration of its foot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from planners.errors import PlanError
from planners.models.model import Model
from planners.spectra.spectrum import ComplexArray, speed_steps, transform
from planners.trajectories.driven import accelerations, forced_response, real_part
from planners.trajectories.pieces import ExpPolynomial, FloatArray, Piece
from planners.trajectories.trajectory import Trajectory

MOST_ALIKE = 1e6  # condition of the mode shapes; what they add up to is then good to 1e-10


class Modal(NamedTuple):
    """A linear load in modes: q' = rates q + a with the acceleration a of its foot, and z = Re(shapes q)."""

    eigenvalues_1_s: ComplexArray  # (m,) one of each conjugate pair
    mode_shapes: ComplexArray  # (n, m)


@dataclass(frozen=True, kw_only=True)
class MassChain:
    """n masses one behind the other; spring and damper i hold mass i to the one before, the first to the moved foot.

    m z'' + d z' + k z = -m y'' for one of them, z = its place against the foot (source 000, dynamics of the load).
    Raises PlanError without a mass, without a spring and a damper a mass (() = no dampers), or for values out of bounds.
    """

    masses_kg: tuple[float, ...]
    stiffnesses_n_m: tuple[float, ...]
    dampings_n_s_m: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.masses_kg)
        object.__setattr__(self, "dampings_n_s_m", self.dampings_n_s_m or (0.0,) * n)
        if n < 1:
            raise PlanError("masses_kg is empty; must hold >= 1 mass: weigh the load")
        for name, least in (
            ("masses_kg", "> 0"),
            ("stiffnesses_n_m", "> 0"),
            ("dampings_n_s_m", ">= 0"),
        ):
            values = getattr(self, name)
            if len(values) != n:
                raise PlanError(
                    f"{name}: {len(values)} values; must be {n}, one a mass: give one for each link of the chain"
                )
            if not all(0.0 <= v < math.inf and (v > 0.0 or least == ">= 0") for v in values):
                raise PlanError(f"{name} = {values}; must be {least} and finite: measure it")

    @cached_property
    def modal(self) -> Modal:
        """The modes, slowest first. PlanError at critical damping, where two modes become one."""
        n, fastest, roots = (
            len(self.masses_kg),
            float(self.natural_frequencies_rad_s[-1]),
            np.sqrt(np.array(self.masses_kg)),
        )
        state = np.zeros((2 * n, 2 * n))  # x = [sqrt(m) z, sqrt(m) z' / fastest] over fastest x t
        state[:n, n:] = np.eye(n)
        state[n:, :n] = -_links(self.stiffnesses_n_m) / np.outer(roots, roots) / fastest**2
        state[n:, n:] = -_links(self.dampings_n_s_m) / np.outer(roots, roots) / fastest
        rates, shapes = np.linalg.eig(state)
        alike = float(np.linalg.cond(shapes))
        if not alike < MOST_ALIKE:
            raise PlanError(
                f"mode shapes of condition {alike:.3g}; must be < {MOST_ALIKE:g}: the damping is critical, "
                "change a damper by one part in a thousand"
            )
        reach = np.linalg.solve(shapes, np.concatenate([np.zeros(n), -roots / fastest]))
        return _one_of_each(
            fastest * rates.astype(np.complex128), shapes[:n] * reach / roots[:, None]
        )

    @property
    def natural_frequencies_rad_s(self) -> FloatArray:
        """Without the dampers, slowest first: (n,)."""
        roots = 1.0 / np.sqrt(np.array(self.masses_kg))
        return np.asarray(
            np.sqrt(np.linalg.eigvalsh(_links(self.stiffnesses_n_m) * np.outer(roots, roots)))
        )


def hanging(model: Model) -> Modal:
    """The small swings of a suspended load under a driven platform: z are its angles [rad]."""
    modes = model.modes()
    return _one_of_each(
        modes.eigenvalues_1_s, modes.mode_shapes[: model.links_count] * (modes.gains > 0.0)
    )


def response(load: Modal, trajectory: Trajectory, after_s: float = 0.0) -> tuple[Trajectory, ...]:
    """z(t) of each coordinate from rest, and after_s of free motion as a last piece: exact, hence its peaks too.

    A step in speed is an impulse. A smooth piece is followed to 1e-12 of its acceleration, the others to rounding.
    Raises PlanError unless after_s is finite and >= 0.
    """
    if not 0.0 <= after_s < math.inf:
        raise PlanError(
            f"after_s = {after_s}; must be finite and >= 0: take some periods of the load"
        )
    states, steps = [0j] * load.eigenvalues_1_s.size, speed_steps(trajectory).tolist()
    pieces: list[list[Piece]] = []
    for step, piece in zip(steps, trajectory.pieces, strict=False):
        states = [q + step for q in states]
        for push in accelerations(piece):
            states = _advance(load, push, states, pieces)
    if after_s:
        _advance(load, ExpPolynomial(after_s, (0.0,)), [q + steps[-1] for q in states], pieces)
    return tuple(Trajectory(coordinate) for coordinate in zip(*pieces, strict=True))


def residual(load: Modal, trajectory: Trajectory) -> FloatArray:
    """Amplitude of each coordinate's free motion from the end of the move on: (n,), summed over the modes.

    For one mass |int a exp((delta w_n + j w_d) t) dt| exp(-delta w_n T) / w_d, undamped pi V(w_n) / w_n.
    """
    q = transform(trajectory, load.eigenvalues_1_s, trajectory.duration_s)
    return np.asarray(np.abs(load.mode_shapes) @ np.abs(q))


def _advance(
    load: Modal, push: ExpPolynomial, states: list[complex], pieces: list[list[Piece]]
) -> list[complex]:
    """Adds the piece of every coordinate; the states at its end."""
    answers = [
        forced_response(push, rate, q)
        for rate, q in zip(load.eigenvalues_1_s.tolist(), states, strict=True)
    ]
    coordinates: list[Piece] = []
    for shares in load.mode_shapes.tolist():
        parts = (
            (share, term) for share, terms in zip(shares, answers, strict=True) for term in terms
        )
        coordinates.append(real_part(parts, push.duration_s))
    pieces.append(coordinates)
    return [sum((term.at(push.duration_s) for term in terms), 0j) for terms in answers]


def _one_of_each(rates: ComplexArray, mode_shapes: ComplexArray) -> Modal:
    kept = np.flatnonzero(rates.imag >= 0.0)
    kept = kept[np.argsort(np.abs(rates[kept]), kind="stable")]
    twice = np.where(rates[kept].imag > 0.0, 2.0, 1.0)
    return Modal(
        rates[kept].astype(np.complex128), (twice * mode_shapes[:, kept]).astype(np.complex128)
    )


def _links(values: tuple[float, ...]) -> FloatArray:
    """Matrix of springs or dampers between neighbours, the first to the foot: (n, n)."""
    between = np.eye(len(values)) - np.eye(len(values), k=-1)
    return np.asarray(between.T @ np.diag(values) @ between)
