"""Controllability and observability, mode by mode: test of Popov, Belevitch and Hautus (PBH).

The condition number of the raw controllability matrix says little: 4.5e7 for the harmonic drive of
source 001, by units alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.errors import NotControllable, NotObservable, ServoError
from rig.drives.servo.two_mass import TwoMass

MIN_MEASURE = 1e-8  # below it gains lose half their digits to rounding
MIN_RATE_1_S = 1.0  # of the unit of time: no joint of a drive has all its poles below


class Units(NamedTuple):
    """Units of states and time that make the entries of a matrix similar in size."""

    states: FloatArray  # (n,)
    rate_1_s: float

    def matrix(self, a: FloatArray) -> FloatArray:
        """Convert the matrix a (n, n) of x' = a x to these units."""
        return np.asarray(a * self.states / self.states[:, None] / self.rate_1_s)

    @property
    def dual(self) -> Units:
        """Units for the transposed matrix."""
        return Units(1.0 / self.states, self.rate_1_s)


class ModeControllability(NamedTuple):
    """Distance of an eigenvalue from being uncontrollable."""

    eigenvalue_1_s: complex
    # smallest singular value of [A - lambda 1, b], A scaled to its spectral radius, b to length 1
    measure: float


def joint_units(joint: TwoMass) -> Units:
    """Choose the units of the states of a joint.

    Time by its fastest pole (at least MIN_RATE_1_S), angles in rad, speeds in rad per unit of time.
    """
    rate_1_s = max(float(np.max(np.abs(joint.poles_1_s))), MIN_RATE_1_S)
    return Units(np.array([1.0, rate_1_s, 1.0, rate_1_s]), rate_1_s)


def balanced_units(a: FloatArray) -> Units:
    """Choose units for states of unknown meaning.

    Rows get the norm of their columns (balancing); time by the fastest eigenvalue.
    """
    from scipy.linalg import matrix_balance

    _, (states, _) = matrix_balance(a, permute=False, separate=True)
    return Units(
        np.asarray(states, dtype=np.float64), float(np.max(np.abs(np.linalg.eigvals(a)))) or 1.0
    )


def mode_controllability(
    a: FloatArray, b: FloatArray, units: Units | None = None
) -> tuple[ModeControllability, ...]:
    """Compute the PBH measure of every mode, least controllable mode first (Hautus 1969).

    State matrix a (n, n), input b (n,). Without units the matrix is balanced. Raises ServoError for
    shapes that do not fit and for values that are not finite.
    """
    a, b = check_shapes(a, b)
    units = units or balanced_units(a)
    scaled, column = units.matrix(a), b / units.states
    column /= np.linalg.norm(column) or 1.0
    rows = []
    for value in np.linalg.eigvals(scaled):
        pencil = np.column_stack([scaled - value * np.eye(len(a)), column])
        singular_values = np.linalg.svd(pencil, compute_uv=False)
        eigenvalue_1_s = complex(value * units.rate_1_s)
        rows.append(ModeControllability(eigenvalue_1_s, float(singular_values[-1])))
    return tuple(sorted(rows, key=lambda row: row.measure))


def check_controllable(a: FloatArray, b: FloatArray, units: Units | None = None) -> None:
    """Check that the input b (n,) controls every mode of a (n, n).

    Raises NotControllable, and ServoError for shapes that do not fit.
    """
    least_controllable = mode_controllability(a, b, units)[0]
    if not least_controllable.measure > MIN_MEASURE:
        raise NotControllable(
            f"the mode at {_format(least_controllable.eigenvalue_1_s)} 1/s is not controllable: "
            f"measure = {least_controllable.measure:.3g}; must be > {MIN_MEASURE:g}: couple it to "
            "the input (stiffness, damper), move the actuator, or remove it from the model"
        )


def check_observable(a: FloatArray, c: FloatArray, units: Units | None = None) -> None:
    """Check that every mode of a (n, n) is observable by the sensor c (n,).

    Raises NotObservable, and ServoError for shapes that do not fit.
    """
    least_observable = mode_controllability(np.asarray(a).T, c, units and units.dual)[0]
    if not least_observable.measure > MIN_MEASURE:
        raise NotObservable(
            f"the mode at {_format(least_observable.eigenvalue_1_s)} 1/s is not observable: "
            f"measure = {least_observable.measure:.3g}; must be > {MIN_MEASURE:g}: couple it to "
            "the sensor (stiffness, damper), measure another state, or remove it from the model"
        )


def check_shapes(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Convert both to arrays; raises ServoError unless a is (n, n) and b (n,), both finite."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if a.ndim != 2 or a.shape[0] != a.shape[1] or b.shape != a.shape[:1] or b.size == 0:
        raise ServoError(
            f"a state matrix of shape {a.shape} with a vector of shape {b.shape}; "
            "must be (n, n) and (n,)"
        )
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(b))):
        raise ServoError(
            "a state matrix or its vector contains nan or inf; must be finite: "
            "look for a division by a parameter that is 0"
        )
    return a, b


def _format(value: complex) -> str:
    return (
        f"{value.real:.6g}" if value.imag == 0.0 else f"{value.real:.6g} +- {abs(value.imag):.6g}j"
    )
