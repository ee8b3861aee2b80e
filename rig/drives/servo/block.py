"""Discrete linear block: sampled once by python-control, then one step per sample."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.errors import Improper, ServoError, check_below_nyquist, check_range

MIN_PERIOD_S, MAX_PERIOD_S = 1e-7, 10.0  # bounds of the sample time of a drive
Method = Literal["bilinear", "zoh"]


def check_period(period_s: float) -> None:
    """Check the sample time; raises ServoError outside MIN_PERIOD_S to MAX_PERIOD_S."""
    check_range(
        "period_s", period_s, MIN_PERIOD_S, MAX_PERIOD_S, "give the sample time of the drive in s"
    )


def discretise(
    system: Any, period_s: float, *, method: Method = "bilinear", prewarp_rad_s: float | None = None
) -> Any:
    """Discretise a continuous control.StateSpace or control.TransferFunction.

    bilinear is Tustin's method, exact at prewarp_rad_s if given; zoh holds the input for a sample.
    Raises Improper for more zeros than poles, BeyondNyquist for a prewarp frequency at or above the
    Nyquist frequency, ServoError for a sample time out of bounds.
    """
    import control

    check_period(period_s)
    if isinstance(system, control.TransferFunction):
        zeros, poles = len(system.num[0][0]) - 1, len(system.den[0][0]) - 1
        if zeros > poles:
            raise Improper(
                f"a block with {zeros} zeros and {poles} poles; must have no more zeros than "
                "poles: add poles (a low-pass filter)"
            )
    if prewarp_rad_s is not None:
        check_below_nyquist("prewarp_rad_s", prewarp_rad_s, period_s, "reduce the sample time")
    if method == "zoh":
        return control.sample_system(control.ss(system), period_s, method="zoh")
    return control.sample_system(
        control.ss(system), period_s, method="bilinear", prewarp_frequency=prewarp_rad_s
    )


class Block:
    """Discrete state space with one output: y = C x + D u, then x = A x + B u.

    Starts at rest. Inputs and outputs are plain floats.
    """

    def __init__(self, system: Any) -> None:
        """Take a discrete control.StateSpace with one output; raises ServoError for another one."""
        if not system.dt or system.noutputs != 1:
            raise ServoError(
                f"a block of {system.noutputs} outputs with sample time {system.dt}; "
                "must have one output and be sampled: call discretise first"
            )
        self.system = system
        # (n + 1, n + m): [x; u] to [next x; y]
        self._matrix = np.block([[system.A, system.B], [system.C, system.D]])
        self._states = system.nstates
        self._x: FloatArray = np.zeros(system.nstates + system.ninputs)

    def step(self, *inputs: float) -> float:
        """Compute the output for the inputs of this sample and advance the state."""
        self._x[self._states :] = inputs
        next_x_and_y = self._matrix @ self._x
        self._x[: self._states] = next_x_and_y[:-1]
        return float(next_x_and_y[-1])

    def reset(self) -> None:
        """Set the state to rest."""
        self._x[:] = 0.0
