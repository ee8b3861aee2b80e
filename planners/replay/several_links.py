"""Several links, by Gauss collocation: all nodes of a step at once, by fixed-point iteration."""

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

GAUSS_NODES = 12  # of Gauss on a span, exact to degree 23
FEW_NODES, SHORT_SPANS = 6, 8  # where so many spans share a step, each needs fewer
RADIANS_PER_STEP = 1.5  # of the load's fastest mode
KEPT_STEP_POINTS = 24  # kept of a step
RESOLVED = (
    1e-7  # what the last two terms of the rates' series may add to an angle [rad] or be left out
)
ROUNDS = 24  # a step that does not settle in so many is halved; 12 to 15 are usual
ROUND_CHANGE_TOLERANCE = 1e-13  # change in the last round, in radians or of the state itself
MIN_STEP_REL = 1e-4  # of a usual step; a load that asks for less spins out of any laboratory


class _Span(NamedTuple):
    """Part of a piece, short enough for one polynomial."""

    piece: Piece
    piece_start_s: float  # on the trajectory's time
    begin_s: float  # on the piece's
    duration_s: float


def play_several_links(
    equations: Equations, trajectory: Trajectory, angles: FloatArray, momenta: FloatArray
) -> Iterator[ReplaySegment]:
    step_s = RADIANS_PER_STEP / float(np.abs(np.linalg.eigvals(equations.swing()[0])).max())
    x = np.concatenate([angles, momenta])
    for step in _steps(trajectory, step_s):
        waiting = [step]
        while waiting:
            spans = waiting.pop()
            with np.errstate(over="ignore", invalid="ignore"):  # of an iteration that runs away
                stretch = _collocate(equations, spans, x)
            if stretch is None:
                waiting.extend(reversed(_halves(spans, MIN_STEP_REL * step_s)))
                continue
            yield stretch
            x = np.concatenate([stretch.angles[-1], stretch.momenta[-1]])


def _steps(trajectory: Trajectory, step_s: float) -> Iterator[list[_Span]]:
    """The trajectory in steps of many short spans or one long span."""
    step: list[_Span] = []
    for start, piece in zip(trajectory.breaks_s.tolist(), trajectory.pieces, strict=False):
        cells = (
            resolve(piece, 1).halves_s.min() * 2.0
            if isinstance(piece, Smooth)
            else piece.duration_s / piece.cell_count
        )
        count = math.ceil(piece.duration_s / min(cells, step_s))
        h = piece.duration_s / count
        for k in range(count):
            if step and h + sum(span.duration_s for span in step) > step_s:
                yield step
                step = []
            step.append(_Span(piece, start, k * h, h))
    yield step


def _halves(spans: list[_Span], shortest_s: float) -> tuple[list[_Span], list[_Span]]:
    if len(spans) > 1:
        return spans[: len(spans) // 2], spans[len(spans) // 2 :]
    (span,) = spans
    h = span.duration_s / 2.0
    if h < shortest_s:
        raise PlanError(
            f"the load at {span.piece_start_s + span.begin_s:.6g} s asks for steps of {h:.3g} s; must be >= {shortest_s:.3g} "
            "s: check the start, the masses and lengths, or give the move more time"
        )
    return [span._replace(duration_s=h)], [span._replace(begin_s=span.begin_s + h, duration_s=h)]


def _collocate(equations: Equations, spans: list[_Span], x: FloatArray) -> ReplaySegment | None:
    """One step from x = [angles, momenta], by fixed-point iteration at all nodes at once; None when it is too long."""
    n, count = x.size // 2, FEW_NODES if len(spans) >= SHORT_SPANS else GAUSS_NODES
    places, to_nodes, to_points, to_tail = _gauss(count)
    h = np.array([span.duration_s for span in spans])[:, None, None]
    v = np.array([span.piece.at(span.begin_s + span.duration_s * places, 1) for span in spans])
    unit = np.concatenate(
        [np.ones(n), equations.mass_kg_m2.diagonal() / h.sum()]
    )  # a radian, and what turns so far in the step
    nodes = np.tile(x, (len(spans), count, 1))  # (spans, count, 2n)
    for _ in range(ROUNDS):
        rates = _rates(equations, nodes.reshape(-1, 2 * n), v[:, :count].ravel()).reshape(
            nodes.shape
        )
        ends = x + np.cumsum(h * (to_points[-1:] @ rates), axis=0)  # (spans, 1, 2n)
        starts = np.concatenate([x[None, None], ends[:-1]])
        before, nodes = nodes, starts + h * (to_nodes @ rates)
        if not np.isfinite(nodes).all():
            return None
        if np.all(
            np.abs(nodes - before) <= ROUND_CHANGE_TOLERANCE * np.maximum(unit, np.abs(nodes))
        ):
            if np.abs(h * (to_tail @ rates[..., :n])).max() > RESOLVED:
                return None
            path = (starts + h * (to_points @ rates)).reshape(-1, 2 * n)
            times = [
                span.piece_start_s + span.begin_s + span.duration_s * places[count:]
                for span in spans
            ]
            return ReplaySegment(
                np.concatenate(times), path[:, :n], path[:, n:], v[:, count:].ravel()
            )
    return None


def _rates(equations: Equations, states: FloatArray, speeds: FloatArray) -> FloatArray:
    """d/dt of states [angles, momenta] (N, 2n) at speeds (N,)."""
    mass, coupling = equations.mass_kg_m2, equations.coupling_kg_m
    angles, momenta = states[:, : len(coupling)], states[:, len(coupling) :]
    c, s = np.cos(angles), np.sin(angles)
    turned = mass * (c[:, :, None] * c[:, None, :] + s[:, :, None] * s[:, None, :])
    rate = np.linalg.solve(turned, (momenta - coupling * c * speeds[:, None])[:, :, None])[:, :, 0]
    spin = rate * (s * ((c * rate) @ mass) - c * ((s * rate) @ mass))
    fall = coupling * s * (speeds[:, None] * rate + equations.gravity_m_s2)
    return np.hstack(
        [
            rate,
            -spin - fall - angles @ equations.springs_n_m_rad - rate @ equations.damping_n_m_s_rad,
        ]
    )


@lru_cache(maxsize=2)
def _gauss(nodes: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Gauss's nodes and the points to keep on [0, 1] (nodes + 1 + POINTS,); from values at the nodes, the integrals of
    their polynomial from 0 to each: (nodes, nodes) and (1 + POINTS, nodes); and its last Legendre terms: (2, nodes)."""
    from numpy.polynomial.legendre import leggauss, legint, legvander

    x, w = leggauss(nodes)
    to_series = (w[:, None] * legvander(x, nodes - 1) * (np.arange(nodes) + 0.5)).T
    to_integral = legint(to_series, lbnd=-1) / 2.0
    points = np.linspace(-1.0, 1.0, 1 + KEPT_STEP_POINTS)
    to_points = legvander(points, nodes) @ to_integral
    return (
        (np.concatenate([x, points]) + 1.0) / 2.0,
        legvander(x, nodes) @ to_integral,
        to_points,
        to_series[-2:],
    )
