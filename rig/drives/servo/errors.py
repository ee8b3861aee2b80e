"""What rig/drives/servo/ refuses: a message says what, the value, the bound and the next step."""

from __future__ import annotations

import math


class ServoError(Exception):
    """Root of everything rig/drives/servo/ raises, e.g. `period_s = -1; must be > 0: give the drive's sample time`."""


class NotControllable(ServoError):
    """The input does not move a state that is to be moved, e.g. a load behind a coupling without stiffness."""


class NotObservable(ServoError):
    """The measurement does not show a state that is to be estimated."""


class PolesNotAssignable(ServoError):
    """Eigenvalues that cannot be assigned: not conjugate, unstable, too many, faster than the sampling."""


class BeyondNyquist(ServoError):
    """A frequency that the sampling cannot hold, e.g. a notch at 4000 rad/s with 1 ms."""


class Improper(ServoError):
    """A filter whose relative degree is too low: it would have to differentiate or to know the future."""


def check_range(what: str, value: float, low: float, high: float, advice: str) -> None:
    """Raises ServoError unless low <= value <= high; NaN is outside."""
    if not low <= value <= high:
        raise ServoError(f"{what} = {value}; must be {low:g} to {high:g}: {advice}")


def check_datum(what: str, value: float, *, zero: bool = False) -> None:
    """Raises ServoError unless 1e-12 <= value <= 1e12; some data may be 0 as well."""
    if not (zero and value == 0.0):
        check_range(what, value, 1e-12, 1e12, "take it from the data sheet or measure it")


def check_below_nyquist(what: str, frequency_rad_s: float, period_s: float, advice: str) -> None:
    """Raises BeyondNyquist unless the frequency is below pi / period_s."""
    half_rad_s = math.pi / period_s
    if not frequency_rad_s < half_rad_s:
        raise BeyondNyquist(
            f"{what} = {frequency_rad_s:.6g} rad/s with a sample time of {period_s:g} s; must be < {half_rad_s:.6g} rad/s, "
            f"half the sampling: {advice}"
        )
