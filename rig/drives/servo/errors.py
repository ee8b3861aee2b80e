"""Errors of rig/drives/servo/ and range checks: what, value, bound and next step."""

from __future__ import annotations

import math


class ServoError(Exception):
    """Root of all errors of rig/drives/servo/.

    E.g. `period_s = -1; must be 1e-07 to 10: give the sample time of the drive in s`.
    """


class NotControllable(ServoError):
    """Mode that the input does not control.

    E.g. a load behind a coupling without stiffness.
    """


class NotObservable(ServoError):
    """Mode that the measurement does not show."""


class PolesNotAssignable(ServoError):
    """Poles that no gains can assign: not conjugate, unstable, wrong count, or too fast."""


class BeyondNyquist(ServoError):
    """Frequency at or above the Nyquist frequency, e.g. a notch at 4000 rad/s with 1 ms."""


class Improper(ServoError):
    """Filter of too low a relative degree: it would have to differentiate."""


def check_range(what: str, value: float, low: float, high: float, advice: str) -> None:
    """Check low <= value <= high; raises ServoError otherwise, also for NaN."""
    if not low <= value <= high:
        raise ServoError(f"{what} = {value}; must be {low:g} to {high:g}: {advice}")


def check_datum(what: str, value: float, *, zero: bool = False) -> None:
    """Check 1e-12 <= value <= 1e12, or 0 if allowed by zero; raises ServoError otherwise."""
    if not (zero and value == 0.0):
        check_range(what, value, 1e-12, 1e12, "take it from the data sheet or measure it")


def check_below_nyquist(what: str, frequency_rad_s: float, period_s: float, advice: str) -> None:
    """Check that a frequency is below pi / period_s; raises BeyondNyquist otherwise."""
    nyquist_rad_s = math.pi / period_s
    if not frequency_rad_s < nyquist_rad_s:
        raise BeyondNyquist(
            f"{what} = {frequency_rad_s:.6g} rad/s with a sample time of {period_s:g} s; "
            f"must be < {nyquist_rad_s:.6g} rad/s, the Nyquist frequency: {advice}"
        )
