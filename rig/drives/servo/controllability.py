"""Whether an input moves every mode and a sensor shows it: the test of Popov, Belevitch and Hautus, eigenvalue by eigenvalue.

Ranks of the raw reachability matrix say little: of the harmonic drive of source 001 its condition is 4.5e7, by units alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.errors import NotControllable, NotObservable, ServoError
from rig.drives.servo.two_mass import TwoMass

MIN_MEASURE = 1e-8  # of the measure: gains would lose half their digits to rounding
MIN_RATE_1_S = 1.0  # of the time unit: a joint that swings in hours is no drive


class Units(NamedTuple):
    """What states and time are measured in while a matrix is worked on, so that its entries are alike."""

    states: FloatArray  # (n,)
    rate_1_s: float

    def matrix(self, a: FloatArray) -> FloatArray:
        """a (n, n) of x' = a x in these units."""
        return np.asarray(a * self.states / self.states[:, None] / self.rate_1_s)

    @property
    def dual(self) -> Units:
        """Of the transposed matrix."""
        return Units(1.0 / self.states, self.rate_1_s)


class ModeControllability(NamedTuple):
    """How far an eigenvalue is from being out of reach."""

    eigenvalue_1_s: complex
    measure: float  # smallest singular value of [A - lambda 1, b], A scaled to its spectral radius and b to length 1


def joint_units(joint: TwoMass) -> Units:
    """Of its states: time by its fastest pole (1 rad/s at least), angles in rad, speeds in rad per unit of time."""
    rate_1_s = max(float(np.max(np.abs(joint.poles_1_s))), MIN_RATE_1_S)
    return Units(np.array([1.0, rate_1_s, 1.0, rate_1_s]), rate_1_s)


def balanced_units(a: FloatArray) -> Units:
    """For states of unknown meaning: rows as long as columns, time by the fastest eigenvalue."""
    from scipy.linalg import matrix_balance

    _, (states, _) = matrix_balance(a, permute=False, separate=True)
    return Units(
        np.asarray(states, dtype=np.float64), float(np.max(np.abs(np.linalg.eigvals(a)))) or 1.0
    )


def mode_controllability(
    a: FloatArray, b: FloatArray, units: Units | None = None
) -> tuple[ModeControllability, ...]:
    """Of the state matrix a (n, n) with the input b (n,), one a mode, the hardest first (Hautus 1969).

    Without units the matrix is balanced_units. Raises ServoError for shapes that do not fit and for what is not finite.
    """
    a, b = check_shapes(a, b)
    units = units or balanced_units(a)
    scaled, column = units.matrix(a), b / units.states
    column /= np.linalg.norm(column) or 1.0
    rows = []
    for value in np.linalg.eigvals(scaled):
        pencil = np.column_stack([scaled - value * np.eye(len(a)), column])
        rows.append(
            ModeControllability(
                complex(value * units.rate_1_s), float(np.linalg.svd(pencil, compute_uv=False)[-1])
            )
        )
    return tuple(sorted(rows, key=lambda row: row.measure))


def check_controllable(a: FloatArray, b: FloatArray, units: Units | None = None) -> None:
    """Raises NotControllable unless the input b (n,) moves every mode of a (n, n); ServoError for shapes that do not fit."""
    hardest = mode_controllability(a, b, units)[0]
    if not hardest.measure > MIN_MEASURE:
        raise NotControllable(
            f"the mode at {_told(hardest.eigenvalue_1_s)} 1/s is not reached by the input: measure = {hardest.measure:.3g}; "
            f"must be > {MIN_MEASURE:g}: couple it to the input (stiffness, damper), move the actuator, or leave it out"
        )


def check_observable(a: FloatArray, c: FloatArray, units: Units | None = None) -> None:
    """Raises NotObservable unless the sensor c (n,) shows every mode of a (n, n); ServoError for shapes that do not fit."""
    hardest = mode_controllability(np.asarray(a).T, c, units and units.dual)[0]
    if not hardest.measure > MIN_MEASURE:
        raise NotObservable(
            f"the mode at {_told(hardest.eigenvalue_1_s)} 1/s is not seen by the sensor: measure = {hardest.measure:.3g}; "
            f"must be > {MIN_MEASURE:g}: couple it to the sensor (stiffness, damper), measure another state, or leave it out"
        )


def check_shapes(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both as arrays. Raises ServoError unless a is (n, n) and b (n,), both finite."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if a.ndim != 2 or a.shape[0] != a.shape[1] or b.shape != a.shape[:1] or b.size == 0:
        raise ServoError(
            f"a state matrix of shape {a.shape} with a vector of shape {b.shape}; must be (n, n) and (n,)"
        )
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(b))):
        raise ServoError(
            "a state matrix or its vector holds nan or inf; must be finite: look for a division by a datum of 0"
        )
    return a, b


def _told(value: complex) -> str:
    return (
        f"{value.real:.6g}" if value.imag == 0.0 else f"{value.real:.6g} +- {abs(value.imag):.6g}j"
    )
