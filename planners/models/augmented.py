"""Model augmented by its sensitivities: a plan that ends with them at zero is robust."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from planners.errors import PlanError, unknown_name
from planners.models.model import Model, StateSpace
from planners.trajectories.pieces import FloatArray

# Finite differences of order 4: steps from the value, weights of the first derivative times 12.
STENCILS = (
    ((-2, -1, 1, 2), (1.0, -8.0, 8.0, -1.0)),
    ((0, 1, 2, 3, 4), (-25.0, 48.0, -36.0, 16.0, -3.0)),
    ((0, -1, -2, -3, -4), (25.0, -48.0, 36.0, -16.0, 3.0)),
)
STEPS = tuple(10.0**-k for k in range(1, 13))  # the largest that keeps MAX_STENCIL_CHANGE_REL
MAX_STENCIL_CHANGE_REL = 8e-3  # change over the stencil, relative to the largest matrix entry
NO_EFFECT_REL = 1e-11  # change in a step, relative to the largest entry, that counts as none
# Smallest singular value of the scaled matrix of the PBH test: an uncontrollable state leaves
# 1e-15, five odd links leave 5e-9.
MIN_SINGULAR_VALUE = 1e-11
MIN_COMPONENT = 1e-3  # of a unit left singular vector, for a state to be part of a combination
SAME_EIGENVALUE_REL = 1e-3  # of the fastest: scatter of the eigenvalues of a Jordan block


def augmented(
    model: Model,
    input: str,
    parameters: Sequence[str],
    *,
    states: Literal["angles", "all"] = "angles",
) -> StateSpace:
    """Augment the state space by the sensitivities s = dx/dp for each parameter p.

    s' = A s + (dA/dp) x + (dB/dp) u (source 004, 3.2.1 and 3.2.2, there without the last term,
    u/l^2), for the angles and their rates; states = "all" adds position and speed, which are
    uncontrollable if the acceleration is commanded. A sensitivity is named after state and
    parameter, e.g. angle_1_rad_per_length_2, in the state's unit over the parameter's SI unit.
    Raises PlanError for a parameter that the model does not have, that affects none of these
    states, or that is named twice.
    """
    space, n = model.state_space(input), model.links_count
    if len(set(parameters)) < len(parameters):
        raise PlanError(
            f"parameters = {tuple(parameters)}; each must be there once: "
            "leave the repeated ones out"
        )
    kept = slice(2 if states == "angles" else 0, 2 + 2 * n)
    names = space.states[kept]
    size, count = len(space.states), len(names)
    total = size + count * len(parameters)
    a, b = np.zeros((total, total)), np.zeros((total, 1))
    a[:size, :size] = space.a
    b[:size] = space.b
    all_names = list(space.states)
    for k, parameter in enumerate(parameters):
        rows = slice(size + k * count, size + (k + 1) * count)
        derivative = _parameter_derivative(model, input, parameter)[kept]
        a[rows, rows] = space.a[kept, kept]
        a[rows, :size] = derivative[:, :-1]
        b[rows] = derivative[:, -1:]
        all_names += [f"{state}_per_{parameter}" for state in names]
    return StateSpace(tuple(all_names), space.input, a, b)


def uncontrollable(space: StateSpace) -> tuple[str, ...]:
    """List the states in uncontrollable combinations, by the rank of [eigenvalue - a, b] (PBH).

    Popov, Belevitch and Hautus. The sensitivities to two parameters are never controllable
    together: both require the same double zeros of the input at the load's eigenvalues.
    """
    speed = max(float(np.abs(np.linalg.eigvals(space.a)).max()), 1e-300)
    a, b = space.a / speed, space.b / speed
    magnitudes = np.abs(b[:, 0])  # of each state, as a unit input drives it
    for _ in space.states:
        magnitudes = np.maximum(magnitudes, np.abs(a) @ magnitudes)
    found = magnitudes == 0.0
    scale = np.where(found, 1.0, magnitudes)
    a, b = a * scale / scale[:, None], b / scale[:, None]
    for eigenvalue in _merged_eigenvalues(a):
        pencil = np.hstack([eigenvalue * np.eye(len(a)) - a, b])
        left, singular_values, _ = np.linalg.svd(pencil)
        combinations = np.abs(left[:, singular_values <= MIN_SINGULAR_VALUE])
        found |= (combinations > MIN_COMPONENT).any(axis=1)
    return tuple(name for name, hit in zip(space.states, found, strict=True) if hit)


def check_controllable(space: StateSpace) -> StateSpace:
    """Return the state space if it is controllable; PlanError names the uncontrollable states."""
    names = uncontrollable(space)
    if names:
        raise PlanError(
            f"{len(names)} of {len(space.states)} states are uncontrollable ({', '.join(names)}); "
            f"must be 0 for {space.input} to reach every goal state: "
            "take the sensitivities of the angles alone, and of one parameter"
        )
    return space


def _merged_eigenvalues(a: FloatArray) -> list[complex]:
    """Compute the eigenvalues; those of a Jordan block are replaced by their mean.

    Rounding scatters the eigenvalues of the block, but not their mean.
    """
    remaining = list(np.linalg.eigvals(a).astype(complex))
    merged = []
    while remaining:
        first = remaining[0]
        near = [value for value in remaining if abs(value - first) <= SAME_EIGENVALUE_REL]
        remaining = [value for value in remaining if abs(value - first) > SAME_EIGENVALUE_REL]
        merged.append(complex(np.mean(near)))
    return merged


def _parameter_derivative(model: Model, input: str, name: str) -> FloatArray:
    """Compute d[A, B]/dp by finite differences: (states, states + 1)."""
    if name not in model.parameters:
        raise unknown_name("parameter", name, model.parameters)
    largest = np.abs(_matrices(model, input)).max()
    for step in STEPS:
        values, weights = _stencil_values(model, input, name, step)
        if values is None:
            continue
        if np.abs(values - values[0]).max() <= MAX_STENCIL_CHANGE_REL * largest:
            change = np.tensordot(weights, values, axes=1) / 12.0
            break
    else:
        raise PlanError(
            f"{name} = {model.parameters[name]}; the model must be smooth there: "
            "take it from the edge of its range"
        )
    if np.abs(change).max() <= NO_EFFECT_REL * largest:
        raise PlanError(
            f"parameter = {name!r} has no effect under input = {input!r}; must be one that the "
            "motion depends on: leave it out"
        )
    return np.asarray(change / step)


def _stencil_values(
    model: Model, input: str, name: str, step: float
) -> tuple[FloatArray | None, FloatArray]:
    """Evaluate [A, B] at the first stencil that stays in the parameter's range, with weights."""
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
