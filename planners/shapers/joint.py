"""One shaper for several modes at once: shorter than one after the other."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planners.shapers.formulas import EXACT, zero_vibration
from planners.shapers.impulses import COINCIDENT, Shaper, check_mode, convolve, gathered
from planners.trajectories.pieces import ComplexArray, FloatArray

SAME_MODE = 1e-9  # relative; rates closer than this are one mode
GRID = 400  # parts of the cascade's length in which a joint shaper is looked for first
FEASIBLE = 1e-7  # what the linear programme's solver takes for zero
NEGLIGIBLE_IMPULSE = 1e-6  # an impulse weaker than this is dropped before the last Newton steps
NEAR = 1e-3  # of the length; impulses of a joint shaper closer than this are tried as one first
NEWTON_STEPS = 8  # three to six reach rounding


def joint(eigenvalues_1_s: Sequence[complex], derivatives: int = 0) -> Shaper:
    """The shortest positive impulses that leave V and its first `derivatives` derivatives 0 at every mode at once.

    Such shapers are those of Hyde & Seering (1991), and of Singhose, Crain & Seering (1997), who compare them with
    cascades. A linear programme on a grid of times says where the impulses are, Newton steps make the conditions exact
    to 1e-12. Never longer than the cascade, which is what comes back when nothing shorter was found. Rates that agree
    to 1e-9 are one mode.
    """
    modes: list[complex] = []
    for rate in eigenvalues_1_s:
        check_mode(rate)
        if all(abs(rate - other) > SAME_MODE * abs(rate) for other in modes):
            modes.append(rate)
    cascade = convolve(*(zero_vibration(rate, derivatives) for rate in modes))
    if len(modes) < 2:
        return cascade
    length_s = float(cascade.times_s[-1])
    return (
        _shortest(np.array(modes, dtype=np.complex128) * length_s, derivatives, length_s) or cascade
    )


@dataclass(frozen=True)
class _Moments:
    """Conditions on impulses at times 0..1: sum A_i = 1 and sum A_i lag_i^k exp(rate lag_i) = 0 with lag = end - time."""

    rates: ComplexArray  # (m,)
    derivatives: int

    @property
    def goal(self) -> FloatArray:
        """(conditions,)"""
        return np.append(1.0, np.zeros(2 * len(self.rates) * (self.derivatives + 1)))

    def of_unit(self, times: FloatArray, end: float = 1.0, order: int = 0) -> FloatArray:
        """Moments of unit impulses, or their derivative by time for order 1: (conditions, n)."""
        lags, k = end - times, np.arange(self.derivatives + 1)[:, None]
        rates = self.rates[:, None, None]
        shapes = -(rates * lags**k + k * lags ** np.maximum(k - 1, 0)) if order else lags**k + 0j
        moments = (shapes * np.exp(rates * lags)).reshape(-1, len(times))
        return np.vstack([np.full(len(times), 1.0 - order), moments.real, moments.imag])

    def errors(self, x: FloatArray) -> FloatArray:
        """(conditions,) for the unknowns: n amplitudes, and n - 1 times after the first, which is 0."""
        amplitudes, times = _split(x)
        return np.asarray(self.of_unit(times) @ amplitudes - self.goal)

    def jacobian(self, x: FloatArray) -> FloatArray:
        """Derivative of errors: (conditions, 2n - 1)."""
        amplitudes, times = _split(x)
        return np.hstack([self.of_unit(times), (self.of_unit(times, order=1) * amplitudes)[:, 1:]])


def _split(x: FloatArray) -> Shaper:
    n = (len(x) + 1) // 2
    return Shaper(x[:n], np.append(0.0, x[n:]))


def _shortest(rates: ComplexArray, derivatives: int, length_s: float) -> Shaper | None:
    """Of what two first guesses lead to, the shortest one below length_s; the rates are times length_s."""
    moments = _Moments(rates, derivatives)
    one_mode = zero_vibration(
        complex(rates.mean()), len(rates) * (derivatives + 1) - 1
    )  # nearly right for close modes
    found = [_polished(moments, guess) for guess in (one_mode, _on_grid(moments)) if guess]
    best = min(
        (shaper for shaper in found if shaper),
        key=lambda shaper: float(shaper.times_s[-1]),
        default=None,
    )
    return (
        Shaper(best.amplitudes, best.times_s * length_s)
        if best and best.times_s[-1] < 1.0
        else None
    )


def _on_grid(moments: _Moments) -> Shaper | None:
    """Impulses on the shortest stretch of the grid that can carry them, neighbours drawn together."""
    times = np.linspace(0.0, 1.0, GRID + 1)
    stretch = range(GRID + 1)
    last = bisect_left(stretch, True, key=lambda k: _programme(moments, times[: k + 1]) is not None)
    weights = _programme(moments, times[: last + 1]) if last in stretch else None
    if weights is None:
        return None
    used = np.flatnonzero(weights > FEASIBLE)
    groups = np.split(used, np.flatnonzero(np.diff(used) > 1) + 1)
    sums = np.array([weights[group].sum() for group in groups])
    return Shaper(sums, np.array([weights[group] @ times[group] for group in groups]) / sums)


def _programme(moments: _Moments, times: FloatArray) -> FloatArray | None:
    """Positive amplitudes at these times that meet the conditions, by least sum of violations; None when there are none."""
    from scipy.optimize import linprog

    violation = np.eye(moments.goal.size)[:, 1:]
    columns = np.hstack([moments.of_unit(times, float(times[-1])), violation, -violation])
    cost = np.repeat([0.0, 1.0], [len(times), 2 * violation.shape[1]])
    out = linprog(cost, A_eq=columns, b_eq=moments.goal, method="highs")
    if out.status != 0 or out.x is None or cost @ out.x > FEASIBLE:
        return None
    return out.x[: len(times)]


def _polished(moments: _Moments, guess: Shaper) -> Shaper | None:
    """The shortest shaper near the guess, its conditions exact; None when there is none."""
    from scipy.optimize import fmin_slsqp

    start = np.clip(np.append(guess.amplitudes, guess.times_s[1:]), 0.0, 1.0)

    def last_time(x: FloatArray) -> float:
        return float(x[-1])

    def by_last_time(x: FloatArray) -> FloatArray:
        return np.append(np.zeros(x.size - 1), 1.0)

    x = fmin_slsqp(
        last_time,
        start,
        fprime=by_last_time,
        f_eqcons=moments.errors,
        fprime_eqcons=moments.jacobian,
        bounds=[(0.0, 1.0)] * start.size,
        acc=1e-15,
        iter=200,
        iprint=0,
    )
    amplitudes, times = _split(x)
    kept = amplitudes > NEGLIGIBLE_IMPULSE
    for gap in (NEAR, COINCIDENT):
        shaper = _exact(moments, gathered(amplitudes[kept], times[kept], gap))
        if shaper:
            return shaper
    return None


def _exact(moments: _Moments, shaper: Shaper) -> Shaper | None:
    """Newton's method, by the smallest step when there are more unknowns than conditions; None when it misses."""
    x = np.append(shaper.amplitudes, shaper.times_s[1:] - shaper.times_s[0])
    for _ in range(NEWTON_STEPS):
        x = np.clip(x - np.linalg.lstsq(moments.jacobian(x), moments.errors(x))[0], 0.0, 1.0)
    amplitudes, times = _split(x)
    there = amplitudes > 0.0  # some, as they sum to 1 or more
    found = gathered(amplitudes[there], times[there] - times[there].min(), 0.0)
    errors = (
        moments.of_unit(found.times_s, float(found.times_s[-1])) @ found.amplitudes - moments.goal
    )
    return found if np.abs(errors).max() <= EXACT else None
