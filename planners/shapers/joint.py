"""Joint shaper of several modes: shorter than the convolution of one shaper a mode."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planners.shapers.formulas import MAX_CONDITION_ERROR, zero_vibration
from planners.shapers.impulses import (
    COINCIDENT_REL,
    Shaper,
    check_mode,
    convolve,
    merge_impulses,
)
from planners.trajectories.pieces import ComplexArray, FloatArray

SAME_MODE_REL = 1e-9  # eigenvalues closer than this are one mode
GRID_INTERVALS = 400  # intervals of the cascade's length for the initial guess
FEASIBILITY_TOLERANCE = 1e-7  # of the linear programme's solver
NEGLIGIBLE_IMPULSE = 1e-6  # weaker impulses are dropped before the last Newton steps
NEAR_REL = 1e-3  # of the length; impulses closer than this are first tried as one
NEWTON_STEPS = 8  # three to six are enough to reach rounding


def joint(eigenvalues_1_s: Sequence[complex], derivatives: int = 0) -> Shaper:
    """Compute the shortest positive shaper with V and its first `derivatives` derivatives 0.

    At every mode at once: shapers of Hyde & Seering (1991), and of Singhose, Crain & Seering
    (1997), who compare them with cascades. A linear programme on a grid of times locates the
    impulses, Newton steps make the conditions exact to 1e-12. Returns the cascade of one shaper a
    mode if no shorter shaper is found. Eigenvalues that agree to 1e-9 are one mode.
    """
    modes: list[complex] = []
    for mu in eigenvalues_1_s:
        check_mode(mu)
        if all(abs(mu - other) > SAME_MODE_REL * abs(mu) for other in modes):
            modes.append(mu)
    cascade = convolve(*(zero_vibration(mu, derivatives) for mu in modes))
    if len(modes) < 2:
        return cascade
    length_s = float(cascade.times_s[-1])
    scaled = np.array(modes, dtype=np.complex128) * length_s
    return _shortest(scaled, derivatives, length_s) or cascade


@dataclass(frozen=True)
class _Moments:
    """Conditions on impulses A_i at times 0..1.

    sum A_i = 1 and sum A_i lag_i^k exp(mu lag_i) = 0 with lag = end - time, for every eigenvalue mu
    and k = 0 ... derivatives.
    """

    eigenvalues: ComplexArray  # (m,)
    derivatives: int

    @property
    def goal(self) -> FloatArray:
        """Right-hand side of the conditions: (conditions,)."""
        return np.append(1.0, np.zeros(2 * len(self.eigenvalues) * (self.derivatives + 1)))

    def matrix(self, times: FloatArray, end: float = 1.0, order: int = 0) -> FloatArray:
        """Compute the moments of unit impulses, or their time derivative for order 1.

        Shape (conditions, n).
        """
        lags, k = end - times, np.arange(self.derivatives + 1)[:, None]
        mu = self.eigenvalues[:, None, None]
        factors = lags**k + 0j
        if order:
            factors = -(mu * lags**k + k * lags ** np.maximum(k - 1, 0))
        moments = (factors * np.exp(mu * lags)).reshape(-1, len(times))
        return np.vstack([np.full(len(times), 1.0 - order), moments.real, moments.imag])

    def errors(self, x: FloatArray) -> FloatArray:
        """Compute the errors (conditions,) for the unknowns x: n amplitudes, n - 1 times.

        The first time is 0.
        """
        amplitudes, times = _split(x)
        return np.asarray(self.matrix(times) @ amplitudes - self.goal)

    def jacobian(self, x: FloatArray) -> FloatArray:
        """Compute the derivative of the errors: (conditions, 2n - 1)."""
        amplitudes, times = _split(x)
        by_times = self.matrix(times, order=1) * amplitudes
        return np.hstack([self.matrix(times), by_times[:, 1:]])


def _split(x: FloatArray) -> Shaper:
    """Split the unknowns into amplitudes and times; the first time is 0."""
    n = (len(x) + 1) // 2
    return Shaper(x[:n], np.append(0.0, x[n:]))


def _shortest(eigenvalues: ComplexArray, derivatives: int, length_s: float) -> Shaper | None:
    """Find the shortest shaper below length_s from two initial guesses; None if there is none.

    The eigenvalues are nondimensional: multiplied by length_s.
    """
    moments = _Moments(eigenvalues, derivatives)
    # Nearly exact for close modes.
    one_mode = zero_vibration(complex(eigenvalues.mean()), len(eigenvalues) * (derivatives + 1) - 1)
    best: Shaper | None = None
    for guess in (one_mode, _guess_on_grid(moments)):
        shaper = _refine(moments, guess) if guess else None
        if shaper and (best is None or shaper.times_s[-1] < best.times_s[-1]):
            best = shaper
    if best is None or not best.times_s[-1] < 1.0:
        return None
    return Shaper(best.amplitudes, best.times_s * length_s)


def _guess_on_grid(moments: _Moments) -> Shaper | None:
    """Find impulses on the shortest feasible part of the grid; neighbours are merged."""
    times = np.linspace(0.0, 1.0, GRID_INTERVALS + 1)

    def is_feasible(k: int) -> bool:
        return _feasible_amplitudes(moments, times[: k + 1]) is not None

    last = bisect_left(range(GRID_INTERVALS + 1), True, key=is_feasible)
    if last > GRID_INTERVALS:
        return None
    weights = _feasible_amplitudes(moments, times[: last + 1])
    if weights is None:
        return None
    used = np.flatnonzero(weights > FEASIBILITY_TOLERANCE)
    groups = np.split(used, np.flatnonzero(np.diff(used) > 1) + 1)
    sums = np.array([weights[group].sum() for group in groups])
    moments_of_groups = np.array([weights[group] @ times[group] for group in groups])
    return Shaper(sums, moments_of_groups / sums)


def _feasible_amplitudes(moments: _Moments, times: FloatArray) -> FloatArray | None:
    """Find positive amplitudes at these times that satisfy the conditions; None if there are none.

    A linear programme with the least sum of violations.
    """
    from scipy.optimize import linprog

    violation = np.eye(moments.goal.size)[:, 1:]
    columns = np.hstack([moments.matrix(times, float(times[-1])), violation, -violation])
    cost = np.repeat([0.0, 1.0], [len(times), 2 * violation.shape[1]])
    out = linprog(cost, A_eq=columns, b_eq=moments.goal, method="highs")
    if out.status != 0 or out.x is None or cost @ out.x > FEASIBILITY_TOLERANCE:
        return None
    return out.x[: len(times)]


def _refine(moments: _Moments, guess: Shaper) -> Shaper | None:
    """Minimise the length near the guess and satisfy the conditions exactly; None if not found."""
    from scipy.optimize import fmin_slsqp

    start = np.clip(np.append(guess.amplitudes, guess.times_s[1:]), 0.0, 1.0)

    def last_time(x: FloatArray) -> float:
        return float(x[-1])

    def last_time_gradient(x: FloatArray) -> FloatArray:
        return np.append(np.zeros(x.size - 1), 1.0)

    x = fmin_slsqp(
        last_time,
        start,
        fprime=last_time_gradient,
        f_eqcons=moments.errors,
        fprime_eqcons=moments.jacobian,
        bounds=[(0.0, 1.0)] * start.size,
        acc=1e-15,
        iter=200,
        iprint=0,
    )
    amplitudes, times = _split(x)
    kept = amplitudes > NEGLIGIBLE_IMPULSE
    for gap in (NEAR_REL, COINCIDENT_REL):
        shaper = _solve_exactly(moments, merge_impulses(amplitudes[kept], times[kept], gap))
        if shaper:
            return shaper
    return None


def _solve_exactly(moments: _Moments, shaper: Shaper) -> Shaper | None:
    """Solve the conditions by Newton's method; None if it does not converge.

    The steps are those of least norm if there are more unknowns than conditions.
    """
    x = np.append(shaper.amplitudes, shaper.times_s[1:] - shaper.times_s[0])
    for _ in range(NEWTON_STEPS):
        x = np.clip(x - np.linalg.lstsq(moments.jacobian(x), moments.errors(x))[0], 0.0, 1.0)
    amplitudes, times = _split(x)
    positive = amplitudes > 0.0  # not empty, as they sum to 1 or more
    start = times[positive].min()
    found = merge_impulses(amplitudes[positive], times[positive] - start, 0.0)
    matrix = moments.matrix(found.times_s, float(found.times_s[-1]))
    errors = matrix @ found.amplitudes - moments.goal
    return found if np.abs(errors).max() <= MAX_CONDITION_ERROR else None
