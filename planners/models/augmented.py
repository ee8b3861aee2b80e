"""A model with its own sensitivities as further states: a plan that ends with them at zero forgives a wrong parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from planners.errors import PlanError, unknown_name
from planners.models.model import Model, StateSpace
from planners.trajectories.pieces import FloatArray

STENCILS = (  # of order 4: steps from the value, weights of the first derivative times 12
    ((-2, -1, 1, 2), (1.0, -8.0, 8.0, -1.0)),
    ((0, 1, 2, 3, 4), (-25.0, 48.0, -36.0, 16.0, -3.0)),
    ((0, -1, -2, -3, -4), (25.0, -48.0, 36.0, -16.0, 3.0)),
)
STEPS = tuple(10.0**-k for k in range(1, 13))  # the largest that hardly moves the matrices is taken
HARDLY = 8e-3  # of the largest entry, from end to end of the stencil
NO_EFFECT_REL = (
    1e-11  # of the largest entry: a parameter that moves no more within a step moves nothing
)
TIED = 1e-11  # least singular value of the scaled matrix of the rank test; what is tied leaves 1e-15, five odd links 5e-9
SAME_RATE = 1e-3  # eigenvalues of a Jordan block scatter by less, of the fastest


def augmented(
    model: Model,
    input: str,
    parameters: Sequence[str],
    *,
    states: Literal["angles", "all"] = "angles",
) -> StateSpace:
    """The model's state space, and for each parameter p the sensitivities s = dx/dp of the angles and their rates.

    s' = A s + (dA/dp) x + (dB/dp) u (source 004, 3.2.1 and 3.2.2, there without the last term, u/l^2). A state's
    sensitivity is named after both, e.g. angle_1_rad_per_length_2, in the state's unit over the parameter's SI unit.
    "all" takes in position and speed, which an acceleration that is commanded leaves unreachable. Raises PlanError for
    a parameter that the model does not have, that moves none of these states, or that is named twice.
    """
    space, n = model.state_space(input), model.links_count
    if len(set(parameters)) < len(parameters):
        raise PlanError(
            f"parameters = {tuple(parameters)}; each must be there once: leave the repeated ones out"
        )
    kept = slice(2 if states == "angles" else 0, 2 + 2 * n)
    names, size = space.states[kept], len(space.states)
    count = len(names)
    total = size + count * len(parameters)
    a, b = np.zeros((total, total)), np.zeros((total, 1))
    a[:size, :size], b[:size] = space.a, space.b
    for k, name in enumerate(parameters):
        rows = slice(size + k * count, size + (k + 1) * count)
        slope = _slope(model, input, name)[kept]
        a[rows, rows], a[rows, :size], b[rows] = space.a[kept, kept], slope[:, :-1], slope[:, -1:]
    more = (f"{state}_per_{parameter}" for parameter in parameters for state in names)
    return StateSpace((*space.states, *more), space.input, a, b)


def unreachable(space: StateSpace) -> tuple[str, ...]:
    """States in combinations that the input cannot move, by the rank of [rate - a, b] (Popov, Belevitch and Hautus).

    Two parameters are always so, whatever they are: both ask the input for the same double zeros at the load's rates.
    """
    speed = max(float(np.abs(np.linalg.eigvals(space.a)).max()), 1e-300)
    a, b = space.a / speed, space.b / speed
    reach = np.abs(b[:, 0])  # what each state can amount to
    for _ in space.states:
        reach = np.maximum(reach, np.abs(a) @ reach)
    deaf = reach == 0.0
    scale = np.where(deaf, 1.0, reach)
    a, b = a * scale / scale[:, None], b / scale[:, None]
    for rate in _rates(a):
        left, sizes, _ = np.linalg.svd(np.hstack([rate * np.eye(len(a)) - a, b]))
        tied = np.abs(left[:, sizes <= TIED])
        deaf |= (tied > SAME_RATE).any(axis=1)
    return tuple(name for name, out in zip(space.states, deaf, strict=True) if out)


def check_reachable(space: StateSpace) -> StateSpace:
    """The state space, if its input can bring every state anywhere; PlanError naming those it cannot."""
    tied = unreachable(space)
    if tied:
        raise PlanError(
            f"{len(tied)} of {len(space.states)} states are tied to others ({', '.join(tied)}); must be 0 for {space.input} "
            "to bring each where it should be: take the sensitivities of the angles alone, and of one parameter"
        )
    return space


def _rates(a: FloatArray) -> list[complex]:
    """Eigenvalues, those of a Jordan block replaced by their mean, which rounding spares."""
    left, out = list(np.linalg.eigvals(a).astype(complex)), []
    while left:
        near = [rate for rate in left if abs(rate - left[0]) <= SAME_RATE]
        left = [rate for rate in left if abs(rate - left[0]) > SAME_RATE]
        out.append(complex(np.mean(near)))
    return out


def _slope(model: Model, input: str, name: str) -> FloatArray:
    """d[A, B]/dp: (states, states + 1)."""
    if name not in model.parameters:
        raise unknown_name("parameter", name, model.parameters)
    largest = np.abs(_matrices(model, input)).max()
    for step in STEPS:
        around, weights = _around(model, input, name, step)
        if around is not None and np.abs(around - around[0]).max() <= HARDLY * largest:
            change = np.tensordot(weights, around, axes=1) / 12.0
            break
    else:
        raise PlanError(
            f"{name} = {model.parameters[name]}; the model must be smooth there: take it from the edge of its range"
        )
    if np.abs(change).max() <= NO_EFFECT_REL * largest:
        raise PlanError(
            f"parameter = {name!r} moves nothing under input = {input!r}; must be one the motion depends on: leave it out"
        )
    return np.asarray(change / step)


def _around(
    model: Model, input: str, name: str, step: float
) -> tuple[FloatArray | None, FloatArray]:
    """The matrices at the first stencil whose values are all the model's to take, and its weights."""
    value = model.parameters[name]
    for offsets, weights in STENCILS:
        try:
            models = [model.with_parameter(name, value + k * step) for k in offsets]
        except PlanError:
            continue
        return np.array([_matrices(other, input) for other in models]), np.array(weights)
    return None, np.zeros(0)


def _matrices(model: Model, input: str) -> FloatArray:
    space = model.state_space(input)
    return np.hstack([space.a, space.b])
