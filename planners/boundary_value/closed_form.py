"""Minimum-energy input in closed form, and the platform motion that it causes, in exact pieces.

The input is a sum of the modes' impulse responses, reversed in time.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from planners.boundary_value.linear import LinearProblem
from planners.boundary_value.modal_form import ModalForm
from planners.errors import PlanError
from planners.problem import Problem
from planners.trajectories.driven import Term, forced_response, real_part
from planners.trajectories.pieces import ComplexArray, ExpPolynomial, ModalTerm, add_closed
from planners.trajectories.trajectory import Trajectory

MAX_END_ERROR_REL = 1e-9  # position error at the end, relative to the distance
MIN_DISTANCE_M = 1e-3  # reference of the error of shorter moves
MAX_PIECE_EXPONENT = 300.0  # |Re eigenvalue| x duration of a piece; exp overflows beyond 700


def platform_trajectory(
    problem: Problem, linear: LinearProblem, coefficients: ComplexArray, planner: str
) -> Trajectory:
    """Integrate the input into the position of the platform.

    u(t) = sum_j coefficients_j conj(s^power_j exp(mu_j s)) with s = T - t; coefficients (n,).
    Raises PlanError when rounding displaces the end of the move.
    """
    modal, time_s = linear.system.modal, linear.time_s
    exponent = float(np.abs(modal.eigenvalues_1_s.real).max()) * time_s
    parts = max(1, math.ceil(exponent / MAX_PIECE_EXPONENT))
    cuts = [time_s * k / parts for k in range(parts + 1)]
    # Rounding leaves small differences in conjugate pairs.
    coefficients = (coefficients + coefficients[modal.partners].conj()) / 2
    path = _PlatformPath(problem, linear)
    pieces = []
    for begin, end in pairwise(cuts):
        piece = _input_piece(modal, coefficients, time_s - begin, end - begin)
        pieces.append(path.integrate(piece))
    return Trajectory(checked_end(problem, planner, tuple(pieces), path.position_m))


def checked_end(
    problem: Problem, planner: str, pieces: Sequence[ExpPolynomial], end_m: float
) -> Sequence[ExpPolynomial]:
    """Return the pieces if end_m is the goal position; raise PlanError otherwise."""
    error_m = abs(end_m - problem.start_m - problem.distance_m)
    if not error_m <= MAX_END_ERROR_REL * max(abs(problem.distance_m), MIN_DISTANCE_M):
        raise end_error(problem, planner, error_m)
    return pieces


def end_error(problem: Problem, planner: str, error_m: float) -> PlanError:
    """Build the error for a move whose end position is wrong by error_m."""
    return PlanError(
        f"{planner} misses the end by {error_m:.3g} m in time_s = {problem.time_s}; must be within "
        f"{MAX_END_ERROR_REL:g} of distance_m = {problem.distance_m}: rounding is too large for a "
        "move so short for its load, or for a load so stiff; change time_s, lag_s or the load"
    )


def refuse_nonlinear(problem: Problem, planner: str) -> None:
    """Raise PlanError for a nonlinear problem: closed forms exist for linear models only."""
    if problem.nonlinear:
        raise PlanError(
            f"nonlinear = True for {planner}; must be False: "
            "take collocation, finite_differences or shooting"
        )


class _PlatformPath:
    """State of platform and load at the end of the pieces integrated so far."""

    def __init__(self, problem: Problem, linear: LinearProblem) -> None:
        n = problem.model.links_count
        self._problem = problem
        self.position_m, self._speed_m_s = linear.start[:2].tolist()
        self._acceleration = float(linear.start[2 + 2 * n]) if problem.input == "jerk" else 0.0
        # eigenvalue, factor of the mode in the platform's position, modal coordinate
        self._swing: list[tuple[complex, complex, complex]] = []
        if problem.input == "force":
            self._start_free(linear)

    def _start_free(self, linear: LinearProblem) -> None:
        """Set the state of the common centre of mass, and of the modes under a free platform.

        The position of the platform follows from both.
        """
        model = self._problem.model
        n, e, modes = model.links_count, model.equations, model.modes("free")
        total_kg = e.cart_mass_kg + e.load_mass_kg
        angles, rates = linear.start[2 : 2 + n], linear.start[2 + n : 2 + 2 * n]
        self._total_kg = total_kg
        self._centre = [  # position [m] and speed [m/s] of the common centre of mass
            self.position_m + float(e.coupling_kg_m @ angles) / total_kg,
            self._speed_m_s + float(e.coupling_kg_m @ rates) / total_kg,
        ]
        factors = -(e.coupling_kg_m @ modes.mode_shapes[:n]) / total_kg
        values = modes.left_eigenvectors @ np.concatenate([angles, rates])
        for eigenvalue, factor, value in zip(
            modes.eigenvalues_1_s.tolist(), factors.tolist(), values.tolist(), strict=True
        ):
            if eigenvalue.imag >= 0.0:
                pair = 2.0 if eigenvalue.imag else 1.0
                self._swing.append((eigenvalue, factor * pair, value))

    def integrate(self, input_piece: ExpPolynomial) -> ExpPolynomial:
        """Compute the position of the platform while this piece of the input acts."""
        if self._problem.input == "force":
            return self._integrate_force(input_piece.scaled(1.0 / self._total_kg))
        acceleration = input_piece
        if self._problem.input == "jerk":
            lag_s = self._problem.lag_s
            response = forced_response(
                input_piece.scaled(1.0 / lag_s), complex(-1.0 / lag_s), complex(self._acceleration)
            )
            terms = ((1.0 + 0j, term) for term in response)
            acceleration = real_part(terms, input_piece.duration_s)
            self._acceleration = acceleration.value(acceleration.duration_s)
        speed = acceleration.integral(self._speed_m_s)
        position = speed.integral(self.position_m)
        self.position_m = position.value(acceleration.duration_s)
        self._speed_m_s = speed.value(acceleration.duration_s)
        return position

    def _integrate_force(self, acceleration: ExpPolynomial) -> ExpPolynomial:
        """Compute the position of the platform from the acceleration of the centre of mass."""
        duration_s = acceleration.duration_s
        speed = acceleration.integral(self._centre[1])
        position = speed.integral(self._centre[0])
        self._centre = [position.value(duration_s), speed.value(duration_s)]
        parts = list[tuple[complex, Term]]()
        for k, (eigenvalue, factor, value) in enumerate(self._swing):
            terms = forced_response(acceleration, eigenvalue, value)
            end_value = sum((term.at(duration_s) for term in terms), 0j)
            self._swing[k] = (eigenvalue, factor, end_value)
            parts += [(factor, term) for term in terms]
        position = add_closed(position, real_part(parts, duration_s))
        self.position_m = position.value(duration_s)
        return position


def _input_piece(
    modal: ModalForm, coefficients: ComplexArray, left_s: float, duration_s: float
) -> ExpPolynomial:
    """Assemble the piece of the input that begins left_s before the end of the move."""
    eigenvalues = modal.eigenvalues_1_s.tolist()
    terms = dict[int, tuple[complex, complex]]()  # driver: coefficients of powers 0 and 1
    for power, driver, coefficient in zip(
        modal.powers.tolist(), modal.drivers.tolist(), coefficients.tolist(), strict=True
    ):
        c0, c1 = terms.get(driver, (0j, 0j))
        terms[driver] = (c0, c1 + coefficient) if power else (c0 + coefficient, c1)
    line = (0.0, 0.0)
    modes = []
    for driver, (c0, c1) in terms.items():
        eigenvalue = eigenvalues[driver].conjugate()
        if eigenvalue == 0.0:
            line = ((c0 + c1 * left_s).real, -c1.real)
        elif eigenvalue.imag <= 0.0:  # the other half of a pair doubles the real part
            scale = cmath.exp(eigenvalue * left_s) * (2.0 if eigenvalue.imag else 1.0)
            p = (scale * (c0 + c1 * left_s), -scale * c1) if c1 else (scale * c0,)
            modes.append(ModalTerm(-eigenvalue, p))
    return ExpPolynomial(duration_s, line, tuple(modes))
