"""Shifts of the modes caused by a parameter error, for plans that are robust against it."""

from __future__ import annotations

import numpy as np

from planners.errors import PlanError
from planners.models.model import Cart, Model, Modes

MIN_SHIFT_REL = 1e-9  # shift of an eigenvalue per shift of the parameter; below it is rounding
PARAMETER_STEP_REL = 1e-4  # change of a parameter to find the modes that it shifts


def shifted_modes(model: Model, cart: Cart, robust: tuple[str, ...]) -> tuple[int, ...]:
    """Find the modes whose eigenvalue any of the parameters shifts: indices, upper half plane.

    Raises PlanError for a parameter that shifts no mode, or one that shifts an overdamped mode.
    """
    modes = model.modes(cart)
    shifted = set[int]()
    upper = np.flatnonzero(modes.eigenvalues_1_s.imag >= 0.0)
    for name in robust:
        value = model.parameters[name]
        above, below = perturbed_modes(model, cart, name)
        high, low = above.eigenvalues_1_s[upper], below.eigenvalues_1_s[upper]
        shift = np.abs(high - low) / np.abs(high) / (2 * PARAMETER_STEP_REL)
        if not np.any(shift > MIN_SHIFT_REL):
            raise PlanError(
                f"robust = {name!r}; must shift the frequency or damping of a mode by more than "
                f"{MIN_SHIFT_REL:g}, and {name} = {value:g} shifts none: leave it out"
            )
        shifted |= set(upper[shift > MIN_SHIFT_REL].tolist())
    for k in shifted:
        if modes.eigenvalues_1_s[k].imag == 0.0:
            raise PlanError(
                f"robust = {robust} shifts an overdamped mode (eigenvalue "
                f"{modes.eigenvalues_1_s[k].real:.4g} 1/s); every mode it shifts must oscillate: "
                "reduce the damping of the joints, or leave it out"
            )
    return tuple(sorted(shifted))


def perturbed_modes(model: Model, cart: Cart, name: str) -> tuple[Modes, Modes]:
    """Compute the modes a small step above and below a parameter's value.

    At an edge of the parameter's range the value itself takes the place of the step.
    """
    value = model.parameters[name]
    step = PARAMETER_STEP_REL * (abs(value) or 1.0)
    out = []
    for side in (step, -step):
        try:
            out.append(model.with_parameter(name, value + side).modes(cart))
        except PlanError:
            out.append(model.modes(cart))
    return out[0], out[1]
