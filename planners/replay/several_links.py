"""Replay of several links by Gauss collocation, solved by fixed-point iteration."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from planners.errors import PlanError
from planners.models.model import Equations
from planners.replay.swing import ReplaySegment
from planners.trajectories.cells import resolve
from planners.trajectories.pieces import FloatArray, Piece, Smooth
from planners.trajectories.trajectory import Trajectory

GAUSS_NODES = 12  # on a span, exact to degree 23
SHORT_SPANS = 8  # spans in a step from which on fewer nodes are enough on each
SHORT_SPAN_NODES = 6
RADIANS_PER_STEP = 1.5  # of the load's fastest mode
KEPT_STEP_POINTS = 24  # points kept of a step
MAX_TAIL_RAD = 1e-7  # share of the last two terms of the rates' Legendre series in an angle
MAX_ROUNDS = 24  # a step that does not converge in so many is halved; 12 to 15 are usual
ROUND_CHANGE_TOLERANCE = 1e-13  # change in the last round, in radians or relative to the state
MIN_STEP_REL = 1e-4  # of a usual step; only an unphysical load requires shorter ones


class _Span(NamedTuple):
    """Part of a piece, short enough for one polynomial."""

    piece: Piece
    piece_start_s: float  # in the trajectory's time
    begin_s: float  # in the piece's time
    duration_s: float


def play_several_links(
    equations: Equations, trajectory: Trajectory, angles: FloatArray, momenta: FloatArray
) -> Iterator[ReplaySegment]:
    """Integrate the links step by step from angles and momenta (n,)."""
    step_s = RADIANS_PER_STEP / float(np.abs(np.linalg.eigvals(equations.swing()[0])).max())
    x = np.concatenate([angles, momenta])
    for step in _steps(trajectory, step_s):
        waiting = [step]
        while waiting:
            spans = waiting.pop()
            with np.errstate(over="ignore", invalid="ignore"):  # of an iteration that diverges
                segment = _collocate(equations, spans, x)
            if segment is None:
                waiting.extend(reversed(_halves(spans, MIN_STEP_REL * step_s)))
                continue
            yield segment
            x = np.concatenate([segment.angles[-1], segment.momenta[-1]])


def _steps(trajectory: Trajectory, step_s: float) -> Iterator[list[_Span]]:
    """Cut the trajectory into steps of many short spans or one long span."""
    step: list[_Span] = []
    for start, piece in zip(trajectory.breaks_s.tolist(), trajectory.pieces, strict=False):
        if isinstance(piece, Smooth):
            cell_s = resolve(piece, 1).halves_s.min() * 2.0
        else:
            cell_s = piece.duration_s / piece.cell_count
        count = math.ceil(piece.duration_s / min(cell_s, step_s))
        h = piece.duration_s / count
        for k in range(count):
            if step and h + sum(span.duration_s for span in step) > step_s:
                yield step
                step = []
            step.append(_Span(piece, start, k * h, h))
    yield step


def _halves(spans: list[_Span], min_step_s: float) -> tuple[list[_Span], list[_Span]]:
    """Halve a step. Raises PlanError if its halves are shorter than min_step_s."""
    if len(spans) > 1:
        return spans[: len(spans) // 2], spans[len(spans) // 2 :]
    (span,) = spans
    h = span.duration_s / 2.0
    if h < min_step_s:
        raise PlanError(
            f"the load at {span.piece_start_s + span.begin_s:.6g} s requires steps of {h:.3g} s; "
            f"must be >= {min_step_s:.3g} s: "
            "check the start, the masses and lengths, or give the move more time"
        )
    return [span._replace(duration_s=h)], [span._replace(begin_s=span.begin_s + h, duration_s=h)]


def _collocate(equations: Equations, spans: list[_Span], x: FloatArray) -> ReplaySegment | None:
    """Integrate one step from x = [angles, momenta], all its nodes at once.

    Returns None when the iteration does not converge or the polynomials do not resolve the motion:
    the step is too long.
    """
    n = x.size // 2
    count = SHORT_SPAN_NODES if len(spans) >= SHORT_SPANS else GAUSS_NODES
    gauss = _gauss(count)
    h = np.array([span.duration_s for span in spans])[:, None, None]
    v = np.array(
        [span.piece.at(span.begin_s + span.duration_s * gauss.places, 1) for span in spans]
    )
    # Units of the state: one radian, and the momentum that turns a link by it in the step.
    unit = np.concatenate([np.ones(n), equations.mass_kg_m2.diagonal() / h.sum()])
    nodes = np.tile(x, (len(spans), count, 1))  # (spans, count, 2n)
    for _ in range(MAX_ROUNDS):
        flat_rates = _rates(equations, nodes.reshape(-1, 2 * n), v[:, :count].ravel())
        rates = flat_rates.reshape(nodes.shape)
        ends = x + np.cumsum(h * (gauss.to_points[-1:] @ rates), axis=0)  # (spans, 1, 2n)
        starts = np.concatenate([x[None, None], ends[:-1]])
        before, nodes = nodes, starts + h * (gauss.to_nodes @ rates)
        if not np.isfinite(nodes).all():
            return None
        tolerance = ROUND_CHANGE_TOLERANCE * np.maximum(unit, np.abs(nodes))
        if np.all(np.abs(nodes - before) <= tolerance):
            if np.abs(h * (gauss.to_tail @ rates[..., :n])).max() > MAX_TAIL_RAD:
                return None
            path = (starts + h * (gauss.to_points @ rates)).reshape(-1, 2 * n)
            times = [
                span.piece_start_s + span.begin_s + span.duration_s * gauss.places[count:]
                for span in spans
            ]
            return ReplaySegment(
                np.concatenate(times), path[:, :n], path[:, n:], v[:, count:].ravel()
            )
    return None


def _rates(equations: Equations, states: FloatArray, speeds: FloatArray) -> FloatArray:
    """Compute d/dt of states [angles, momenta] (N, 2n) at speeds (N,)."""
    mass, coupling = equations.mass_kg_m2, equations.coupling_kg_m
    angles, momenta = states[:, : len(coupling)], states[:, len(coupling) :]
    c, s = np.cos(angles), np.sin(angles)
    turned_mass = mass * (c[:, :, None] * c[:, None, :] + s[:, :, None] * s[:, None, :])
    load_momenta = momenta - coupling * c * speeds[:, None]
    rate = np.linalg.solve(turned_mass, load_momenta[:, :, None])[:, :, 0]
    spin = rate * (s * ((c * rate) @ mass) - c * ((s * rate) @ mass))
    fall = coupling * s * (speeds[:, None] * rate + equations.gravity_m_s2)
    springs, dampers = angles @ equations.springs_n_m_rad, rate @ equations.damping_n_m_s_rad
    return np.hstack([rate, -spin - fall - springs - dampers])


class _Gauss(NamedTuple):
    """Gauss nodes on [0, 1], and matrices that act on the values of a polynomial at them."""

    places: FloatArray  # (nodes + 1 + KEPT_STEP_POINTS,) nodes, then the points to keep
    to_nodes: FloatArray  # (nodes, nodes) integral from 0 to each node
    to_points: FloatArray  # (1 + KEPT_STEP_POINTS, nodes) integral from 0 to each point
    to_tail: FloatArray  # (2, nodes) last two terms of the Legendre series


@lru_cache(maxsize=2)
def _gauss(nodes: int) -> _Gauss:
    """Compute the Gauss nodes and integration matrices of a span."""
    from numpy.polynomial.legendre import leggauss, legint, legvander

    x, w = leggauss(nodes)
    to_series = (w[:, None] * legvander(x, nodes - 1) * (np.arange(nodes) + 0.5)).T
    to_integral = legint(to_series, lbnd=-1) / 2.0
    points = np.linspace(-1.0, 1.0, 1 + KEPT_STEP_POINTS)
    return _Gauss(
        places=(np.concatenate([x, points]) + 1.0) / 2.0,
        to_nodes=legvander(x, nodes) @ to_integral,
        to_points=legvander(points, nodes) @ to_integral,
        to_tail=to_series[-2:],
    )
