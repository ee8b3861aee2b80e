"""A linear block as a drive runs it: sampled once by python-control, then one step a sample."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.errors import Improper, ServoError, check_below_nyquist, check_range

MIN_PERIOD_S, MAX_PERIOD_S = 1e-7, 10.0  # of a drive's sample time
Method = Literal["bilinear", "zoh"]


def check_period(period_s: float) -> None:
    """Raises ServoError for a sample time that no drive has."""
    check_range(
        "period_s", period_s, MIN_PERIOD_S, MAX_PERIOD_S, "give the drive's sample time in seconds"
    )


def discretise(
    system: Any, period_s: float, *, method: Method = "bilinear", prewarp_rad_s: float | None = None
) -> Any:
    """A continuous control.StateSpace or TransferFunction, sampled: bilinear (Tustin), exact at prewarp_rad_s if given,
    or with its input held (zoh).

    Raises Improper for more zeros than poles, BeyondNyquist for a prewarp frequency the sampling cannot hold, ServoError for a
    sample time out of bounds.
    """
    import control

    check_period(period_s)
    if isinstance(system, control.TransferFunction):
        zeros, poles = len(system.num[0][0]) - 1, len(system.den[0][0]) - 1
        if zeros > poles:
            raise Improper(
                f"a block with {zeros} zeros and {poles} poles; must have no more zeros than poles: filter it"
            )
    if prewarp_rad_s is not None:
        check_below_nyquist("prewarp_rad_s", prewarp_rad_s, period_s, "sample faster")
    if method == "zoh":
        return control.sample_system(control.ss(system), period_s, method="zoh")
    return control.sample_system(
        control.ss(system), period_s, method="bilinear", prewarp_frequency=prewarp_rad_s
    )


class Block:
    """y = C x + D u, then x = A x + B u. Starts at rest; inputs and outputs are plain floats."""

    def __init__(self, system: Any) -> None:
        """A discrete control.StateSpace with one output. Raises ServoError for another one."""
        if not system.dt or system.noutputs != 1:
            raise ServoError(
                f"a block of {system.noutputs} outputs with sample time {system.dt}; must have one output and be sampled: "
                "call discretise first"
            )
        self.system = system
        self._whole = np.block(
            [[system.A, system.B], [system.C, system.D]]
        )  # (n + 1, n + m): [x; u] to [next x; y]
        self._states = system.nstates
        self._x: FloatArray = np.zeros(system.nstates + system.ninputs)

    def step(self, *inputs: float) -> float:
        """The output now, for the inputs now."""
        self._x[self._states :] = inputs
        after = self._whole @ self._x
        self._x[: self._states] = after[:-1]
        return float(after[-1])

    def reset(self) -> None:
        """Back to rest."""
        self._x[:] = 0.0
