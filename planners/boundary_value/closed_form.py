"""The minimum-energy input as exact pieces: the modes' own impulse responses, played backwards, and what the platform does."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from planners.boundary_value.linear import LinearProblem, Spectrum
from planners.errors import PlanError
from planners.problem import Problem
from planners.trajectories.driven import Term, forced_response, real_part
from planners.trajectories.pieces import ComplexArray, ExpPolynomial, ModalTerm, add_closed
from planners.trajectories.trajectory import Trajectory

END_ERROR = 1e-9  # of the move
SHORT_MOVE_M = 1e-3  # a shorter one is judged as this one
STEEPEST = 300.0  # |Re rate| x duration of a piece: beyond 700 an exponential is no number


def trajectory_of(
    problem: Problem, linear: LinearProblem, shares: ComplexArray, planner: str
) -> Trajectory:
    """Platform position for the input u(t) = sum_j shares_j conj(s^power_j exp(rate_j s)), s = T - t; shares (n,).

    Raises PlanError when rounding has spoilt the end of the move.
    """
    spectrum, time_s = linear.system.spectrum, linear.time_s
    steep = float(np.abs(spectrum.eigenvalues_1_s.real).max()) * time_s
    parts = max(1, math.ceil(steep / STEEPEST))
    cuts = [time_s * k / parts for k in range(parts + 1)]
    shares = (
        shares + shares[spectrum.partners].conj()
    ) / 2  # rounding leaves pairs a little unlike
    path, pieces = _Path(problem, linear), []
    for begin, end in pairwise(cuts):
        push = _input(spectrum, shares, time_s - begin, end - begin)
        pieces.append(path.answer(push))
    return Trajectory(checked_end(problem, planner, tuple(pieces), path.position_m))


def checked_end(
    problem: Problem, planner: str, pieces: Sequence[ExpPolynomial], end_m: float
) -> Sequence[ExpPolynomial]:
    """The pieces, if they end where the problem wants them to; PlanError otherwise."""
    error = abs(end_m - problem.start_m - problem.distance_m)
    if not error <= END_ERROR * max(abs(problem.distance_m), SHORT_MOVE_M):
        raise spoilt(problem, planner, error)
    return pieces


def spoilt(problem: Problem, planner: str, error_m: float) -> PlanError:
    """The error of a move that does not end where it should."""
    return PlanError(
        f"{planner} misses the end by {error_m:.3g} m in time_s = {problem.time_s}; must be within {END_ERROR:g} of "
        f"distance_m = {problem.distance_m}: rounding spoils a move so short for its load, or so stiff; change time_s, lag_s "
        "or the load"
    )


def refuse_nonlinear(problem: Problem, planner: str) -> None:
    """Closed forms know linear models only."""
    if problem.nonlinear:
        raise PlanError(
            f"nonlinear = True for {planner}; must be False: take collocation, finite_differences or shooting"
        )


class _Path:
    """Platform and load along the pieces, from the start on."""

    def __init__(self, problem: Problem, linear: LinearProblem) -> None:
        self._problem, n = problem, problem.model.links_count
        self.position_m, self._speed = linear.start[:2].tolist()
        self._acceleration = float(linear.start[2 + 2 * n]) if problem.input == "jerk" else 0.0
        self._swing: list[
            tuple[complex, complex, complex]
        ] = []  # rate, share in the platform's place, value
        if problem.input == "force":
            self._free(linear)

    def _free(self, linear: LinearProblem) -> None:
        """Position and speed become those of the common centre of mass; the platform follows from the swing."""
        model = self._problem.model
        n, e, modes = model.links_count, model.equations, model.modes("free")
        whole = e.cart_mass_kg + e.load_mass_kg
        angles, rates = linear.start[2 : 2 + n], linear.start[2 + n : 2 + 2 * n]
        self._whole_kg = whole
        self.centre = [
            self.position_m + float(e.coupling_kg_m @ angles) / whole,
            self._speed + float(e.coupling_kg_m @ rates) / whole,
        ]
        shares = -(e.coupling_kg_m @ modes.mode_shapes[:n]) / whole
        values = modes.left_eigenvectors @ np.concatenate([angles, rates])
        for rate, share, value in zip(
            modes.eigenvalues_1_s.tolist(), shares.tolist(), values.tolist(), strict=True
        ):
            if rate.imag >= 0.0:
                self._swing.append((rate, share * (2.0 if rate.imag else 1.0), value))

    def answer(self, push: ExpPolynomial) -> ExpPolynomial:
        """Position of the platform while this input acts."""
        if self._problem.input == "force":
            return self._answer_force(push.scaled(1.0 / self._whole_kg))
        if self._problem.input == "jerk":
            lag = self._problem.lag_s
            answer = forced_response(
                push.scaled(1.0 / lag), complex(-1.0 / lag), complex(self._acceleration)
            )
            push = real_part(((1.0 + 0j, term) for term in answer), push.duration_s)
            self._acceleration = push.value(push.duration_s)
        speed = push.integral(self._speed)
        move = speed.integral(self.position_m)
        self.position_m, self._speed = move.value(push.duration_s), speed.value(push.duration_s)
        return move

    def _answer_force(self, push: ExpPolynomial) -> ExpPolynomial:
        speed = push.integral(self.centre[1])
        move = speed.integral(self.centre[0])
        self.centre = [move.value(push.duration_s), speed.value(push.duration_s)]
        parts = list[tuple[complex, Term]]()
        for k, (rate, share, value) in enumerate(self._swing):
            terms = forced_response(push, rate, value)
            self._swing[k] = (rate, share, sum((term.at(push.duration_s) for term in terms), 0j))
            parts += [(share, term) for term in terms]
        move = add_closed(move, real_part(parts, push.duration_s))
        self.position_m = move.value(push.duration_s)
        return move


def _input(
    spectrum: Spectrum, shares: ComplexArray, left_s: float, duration_s: float
) -> ExpPolynomial:
    """The piece that begins left_s before the end of the move."""
    rates, terms = spectrum.eigenvalues_1_s.tolist(), dict[int, tuple[complex, complex]]()
    for power, driver, share in zip(
        spectrum.powers.tolist(), spectrum.drivers.tolist(), shares.tolist(), strict=True
    ):
        c0, c1 = terms.get(driver, (0j, 0j))
        terms[driver] = (c0, c1 + share) if power else (c0 + share, c1)
    line, modes = (0.0, 0.0), []
    for driver, (c0, c1) in terms.items():
        rate = rates[driver].conjugate()
        if rate == 0.0:
            line = ((c0 + c1 * left_s).real, -c1.real)
        elif rate.imag <= 0.0:  # the other half of a pair doubles the real part
            size = cmath.exp(rate * left_s) * (2.0 if rate.imag else 1.0)
            p = (size * (c0 + c1 * left_s), -size * c1) if c1 else (size * c0,)
            modes.append(ModalTerm(-rate, p))
    return ExpPolynomial(duration_s, line, tuple(modes))
