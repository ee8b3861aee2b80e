"""Operations on any trajectory: shift, mirror, stretch, compose with a time scaling, limit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from math import comb

import numpy as np

from planners import bounds
from planners.errors import PlanError, check_range
from planners.trajectories.pieces import (
    ExpPolynomial,
    FloatArray,
    ModalTerm,
    Number,
    Piece,
    Smooth,
    add_closed,
    polynomial,
)
from planners.trajectories.trajectory import JUMP_REL, Trajectory

MAX_DERIVATIVE_ORDER = 8  # of a composition
INSTANT_ROUNDING_REL = 1e-12  # of the duration; instants closer than this are one


def translated(trajectory: Trajectory, distance_m: float = 0.0, delay_s: float = 0.0) -> Trajectory:
    """Shift a trajectory by distance_m and delay it by delay_s >= 0, at rest until then."""
    if delay_s:
        check_range(
            "delay_s",
            delay_s,
            bounds.SHORTEST_S,
            bounds.LONGEST_S,
            "give 0 or more, as no motion begins before its start",
        )
    moved = trajectory.shifted(bounds.distance(distance_m))
    return Trajectory.hold(float(moved.at(0.0)), delay_s).then(moved) if delay_s else moved


def reversed_in_time(trajectory: Trajectory) -> Trajectory:
    """Compute q(T - t): speeds change sign, accelerations do not.

    The other two reflections: reversed_in_time(q).scaled(-1) is -q(-t), q.scaled(-1) is -q(t).
    """
    return Trajectory(tuple(_reversed(piece) for piece in reversed(trajectory.pieces)))


def stretched(trajectory: Trajectory, factor: float) -> Trajectory:
    """Compute q(t / factor), factor times as long; order k is divided by factor^k.

    Raises PlanError unless the new duration is 1e-9 to 1e9 s.
    """
    shortest = bounds.SHORTEST_S / trajectory.duration_s
    longest = bounds.LONGEST_S / trajectory.duration_s
    check_range(
        "factor",
        factor,
        shortest * (1.0 - INSTANT_ROUNDING_REL),
        longest * (1.0 + INSTANT_ROUNDING_REL),
        "reverse with reversed_in_time",
    )
    return Trajectory(tuple(_stretched(piece, factor) for piece in trajectory.pieces))


def normalised(trajectory: Trajectory) -> Trajectory:
    """Scale a trajectory to run from 0 to 1 in 1 s.

    Raises PlanError for a motion that ends at its start position.
    """
    start, end = trajectory.at([0.0, trajectory.duration_s]).tolist()
    low, high = trajectory.extent(0)
    if abs(end - start) <= JUMP_REL * max(high - low, abs(start)):
        raise PlanError(
            f"a motion from {start} m to {end} m; must end elsewhere to be normalised: "
            "cut it where it turns"
        )
    unit = trajectory.shifted(-start).scaled(1.0 / (end - start))
    return stretched(unit, 1.0 / trajectory.duration_s)


def within_limits(
    trajectory: Trajectory,
    *,
    speed_m_s: float = math.inf,
    acceleration_m_s2: float = math.inf,
    jerk_m_s3: float = math.inf,
) -> Trajectory:
    """Stretch a trajectory to the shortest duration within the limits; one of them is reached.

    Kinematic scaling (source 000). A trajectory at rest is returned unchanged.
    Raises PlanError for a limit out of bounds, when none is finite, and for a limit that no
    stretching satisfies: of the acceleration for a step in speed, of the jerk for a step in
    acceleration.
    """
    limits = {
        "speed_m_s": speed_m_s,
        "acceleration_m_s2": acceleration_m_s2,
        "jerk_m_s3": jerk_m_s3,
    }
    if not any(math.isfinite(bounds.limit(*item)) for item in limits.items()):
        raise PlanError(
            f"limits {limits} of a motion; at least one must be finite: "
            "give a speed or an acceleration"
        )
    factor = 0.0
    for order, (name, limit) in enumerate(limits.items(), start=1):
        if not math.isfinite(limit):
            continue
        if not trajectory.continuous(order - 1):
            raise PlanError(
                f"{name} = {limit} for a motion with a step in derivative {order - 1}; "
                "must have none: smooth it"
            )
        factor = max(factor, (trajectory.peak(order).value / limit) ** (1.0 / order))
    return stretched(trajectory, factor) if factor else trajectory


def composed(trajectory: Trajectory, sigma: Trajectory) -> Trajectory:
    """Compute q(sigma(t)), the same path with another time scaling.

    Derivatives are exact by the chain rule (Faa di Bruno). sigma is a Trajectory whose
    positions are times [s]: from 0 to the duration of q, strictly increasing (its speed may be
    0 at single instants, such as its ends), twice continuously differentiable inside.
    Raises PlanError otherwise.
    """
    _check_time_scaling(trajectory, sigma)
    joints = [_solve_instant(sigma, t_s) for t_s in trajectory.breaks_s[1:-1].tolist()]
    cuts = np.concatenate([sigma.breaks_s, joints])
    cuts.sort()
    kept = cuts[np.append(True, np.diff(cuts) > INSTANT_ROUNDING_REL * cuts[-1])]
    kept[-1] = cuts[-1]
    return Trajectory(tuple(_composed(trajectory, sigma, a, b) for a, b in pairwise(kept.tolist())))


def _reversed(piece: Piece) -> Piece:
    end = piece.duration_s
    if isinstance(piece, Smooth):
        function = piece.at
        return Smooth(
            end,
            lambda t, order: (-1.0) ** order * function(np.maximum(end - t, 0.0), order),
            piece.highest_order,
        )
    tail = piece.window(end, end)  # on the time since the end; then t -> -t
    modes = tuple(ModalTerm(-rate, tuple(_alternating(c))) for rate, c in tail.modes)
    return ExpPolynomial(end, tuple(_alternating(tail.coefficients)), modes)


def _alternating(coefficients: Iterable[Number]) -> Iterable[Number]:
    """Change the sign of the odd powers."""
    return (-c if j % 2 else c for j, c in enumerate(coefficients))


def _stretched(piece: Piece, factor: float) -> Piece:
    duration_s = piece.duration_s * factor
    if isinstance(piece, Smooth):
        function = piece.at
        return Smooth(
            duration_s,
            lambda t, order: function(t / factor, order) / factor**order,
            piece.highest_order,
        )
    modes = tuple(
        ModalTerm(rate / factor, tuple(_stretched_powers(c, factor))) for rate, c in piece.modes
    )
    return ExpPolynomial(duration_s, tuple(_stretched_powers(piece.coefficients, factor)), modes)


def _stretched_powers(coefficients: Iterable[Number], factor: float) -> Iterable[Number]:
    return (c / factor**j for j, c in enumerate(coefficients))


def _check_time_scaling(trajectory: Trajectory, sigma: Trajectory) -> None:
    """Raise PlanError unless sigma runs from 0 to the duration once, increasing and smooth."""
    start_s, end_s = sigma.at([0.0, sigma.duration_s]).tolist()
    span_s = trajectory.duration_s
    if max(abs(start_s), abs(end_s - span_s)) > JUMP_REL * span_s:
        raise PlanError(
            f"sigma runs from {start_s} to {end_s} s; must run from 0 to {span_s} s, "
            "the duration of the motion: scale it"
        )
    slowest, fastest = sigma.extent(1)
    least_rise = min(_rise(piece) for piece in sigma.pieces)
    if slowest < -INSTANT_ROUNDING_REL * fastest or least_rise <= 0.0:
        raise PlanError(
            f"sigma is not increasing: lowest speed {slowest:.6g}, "
            f"smallest rise over a piece {least_rise:.6g} s; "
            "must be >= 0 and > 0: remove what decreases or is constant"
        )
    for order in range(3):
        worst = max((_step(a, b, order) for a, b in pairwise(sigma.pieces)), default=0.0)
        bound = JUMP_REL * sigma.peak(order).value
        if worst > bound:
            raise PlanError(
                f"derivative {order} of sigma steps by {worst:.6g}; must be <= {bound:.3g}: "
                "smooth the joint"
            )


def _rise(piece: Piece) -> float:
    """Compute end value minus start value."""
    return float(piece.at(np.array(piece.duration_s)) - piece.at(np.zeros(())))


def _step(before: Piece, after: Piece, order: int) -> float:
    """Compute the size of the step between two pieces."""
    end = before.at(np.array(before.duration_s), order)
    return abs(float(after.at(np.zeros(()), order) - end))


def _solve_instant(sigma: Trajectory, t_s: float) -> float:
    """Find the instant at which sigma is t_s."""
    from scipy.optimize import brentq

    return float(
        brentq(lambda t: float(sigma.at(t)) - t_s, 0.0, sigma.duration_s, xtol=1e-300, rtol=8.9e-16)
    )


def _composed(trajectory: Trajectory, sigma: Trajectory, start_s: float, end_s: float) -> Smooth:
    """Compute the part from start_s to end_s, in which neither function has a joint."""
    whole, begin_s = _piece_at(sigma, (start_s + end_s) / 2)
    scaling = whole.window(start_s - begin_s, end_s - start_s)
    path, path_start_s = _piece_at(trajectory, float(sigma.at((start_s + end_s) / 2)))
    local_time = _reduced(scaling, path_start_s)

    def position(t: FloatArray, order: int) -> FloatArray:
        place = np.clip(local_time(t), 0.0, path.duration_s)
        if order == 0:
            return path.at(place)
        rates = [scaling.at(t, k) for k in range(1, order + 1)]
        return np.asarray(
            sum(path.at(place, k) * _bell(order, k, rates) for k in range(1, order + 1))
        )

    declared = [piece.highest_order for piece in (scaling, path) if isinstance(piece, Smooth)]
    return Smooth(end_s - start_s, position, min([MAX_DERIVATIVE_ORDER, *declared]))


def _reduced(scaling: Piece, offset_s: float) -> Callable[[FloatArray], FloatArray]:
    """Build the function scaling(t) - offset_s.

    In a closed form the constant is shifted first, as the difference of two long times has no
    significant digits left.
    """
    if isinstance(scaling, Smooth):
        return lambda t: scaling.at(t) - offset_s
    return add_closed(scaling, polynomial(scaling.duration_s, (-offset_s,))).at


def _piece_at(trajectory: Trajectory, t_s: float) -> tuple[Piece, float]:
    """Find the piece at t_s, and its start."""
    k = int(np.searchsorted(trajectory.breaks_s[1:-1], t_s, side="right"))
    return trajectory.pieces[k], float(trajectory.breaks_s[k])


def _bell(n: int, k: int, rates: Sequence[FloatArray]) -> FloatArray | float:
    """Compute the partial Bell polynomial B(n, k) of the derivatives of the inner function."""
    if k == 0 or n < k:
        return float(n == k)
    return sum(
        comb(n - 1, i - 1) * rates[i - 1] * _bell(n - i, k - 1, rates) for i in range(1, n - k + 2)
    )
