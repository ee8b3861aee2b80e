"""Analysis of a loop: pole pairs, zeros, margins, condition number of the eigenvectors."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from planners.trajectories.pieces import ComplexArray, FloatArray
from rig.drives.servo.errors import ServoError

ZERO_POLE = 1e-9  # absolute value of a discrete pole that counts as 0
ZERO_GAIN = 1e-9  # a gain margin below it is 0 but for rounding
REAL_POLE_REL = 1e-9  # imaginary part of a real pole, relative to its absolute value


class PolePair(NamedTuple):
    """Frequency |p| and damping ratio -Re p / |p| of a pole or of a conjugate pair.

    A real pole has the damping ratio 1, an unstable real one -1.
    """

    frequency_rad_s: float
    damping: float


class Margins(NamedTuple):
    """Margins of a loop opened at one place, valid if the closed loop is stable.

    inf or 0 where the loop has no such crossing.
    """

    upper_gain_margin: float  # largest factor on the gain
    lower_gain_margin: float  # lowest factor on the gain
    phase_margin_deg: float
    crossover_rad_s: float  # frequency of |L| = 1 with that phase
    peak_sensitivity: float  # largest |1 / (1 + L)|


class LoopAnalysis(NamedTuple):
    """Poles, zeros, margins and condition number of a closed loop."""

    poles_1_s: ComplexArray  # of a discrete loop log(z) / period
    zeros_1_s: ComplexArray
    margins: Margins
    eigenvector_condition: float  # condition number, see eigenvector_condition()

    @property
    def pole_pairs(self) -> tuple[PolePair, ...]:
        """Pole pairs, slowest first."""
        return pole_pairs(self.poles_1_s)

    @property
    def stable(self) -> bool:
        """True if every pole decays; the margins are meaningless otherwise."""
        return bool(np.all(self.poles_1_s.real < 0.0))


def analyse_loop(opened: Any, closed: Any) -> LoopAnalysis:
    """Compute poles, zeros, margins and condition number of a loop.

    control.StateSpace or control.TransferFunction: opened at the plant input, and closed from
    setpoint to output.
    """
    return LoopAnalysis(
        poles(closed), zeros(closed), margins(opened), eigenvector_condition(closed)
    )


def poles(system: Any) -> ComplexArray:
    """Compute the poles [1/s], of a discrete system their continuous equivalents."""
    return continuous_equivalents(system.poles(), system.dt)


def zeros(system: Any) -> ComplexArray:
    """Compute the finite zeros [1/s], of a discrete system their continuous equivalents."""
    found = np.asarray(system.zeros(), dtype=np.complex128)
    return continuous_equivalents(found[np.isfinite(found)], system.dt)


def pole_pairs(poles_1_s: ComplexArray | FloatArray) -> tuple[PolePair, ...]:
    """List the pole pairs, one of each conjugate pair, slowest first.

    A pole at 0 has the damping ratio 1.
    """
    kept = [
        p
        for p in np.asarray(poles_1_s, dtype=np.complex128).tolist()
        if p.imag >= -REAL_POLE_REL * abs(p)
    ]
    rows = [PolePair(abs(p), -p.real / abs(p) if abs(p) else 1.0) for p in kept]
    return tuple(sorted(rows))


def oscillatory_pairs(poles_1_s: ComplexArray | FloatArray) -> tuple[PolePair, ...]:
    """List the pole pairs that are complex conjugate."""
    kept = [p for p in np.asarray(poles_1_s, dtype=np.complex128) if abs(p.imag) > 1e-6 * abs(p)]
    return pole_pairs(np.array(kept))


def margins(opened: Any) -> Margins:
    """Compute the margins of L = P C with negative feedback; the poles decide its stability.

    In time of the loop's fastest pole, and of a sampled loop along w = (2 / T)(z - 1) / (z + 1),
    which has its margins: the polynomials of nine poles near z = 1, or of powers of 1000 rad/s,
    leave no digit of them. Raises ServoError for a sampled loop with a pole at z = -1, which that
    does not reach.
    """
    import control

    system = control.ss(opened)
    a, b, c, d = (np.asarray(part) for part in (system.A, system.B, system.C, system.D))
    period_s = float(system.dt or 0.0)
    if period_s:
        a, b, c, d = _bilinear_w(a, b, c, d, period_s)
    end = float(d[0, 0])  # L at infinite frequency; of a sampled loop at the Nyquist frequency
    rate_1_s = float(np.max(np.abs(np.linalg.eigvals(a)), initial=0.0)) or 1.0
    scaled = control.ss(a / rate_1_s, b / rate_1_s, c, d)
    gains, phases, distances, _, crossings, _ = control.stability_margins(scaled, returnall=True)
    gains = np.append(gains, -1.0 / end) if end < 0.0 else gains
    nearest = int(np.argmin(np.abs(phases))) if len(phases) else None
    crossover = math.inf if nearest is None else float(crossings[nearest]) * rate_1_s
    if period_s and nearest is not None:
        crossover = 2.0 / period_s * math.atan(crossover * period_s / 2.0)
    return Margins(
        upper_gain_margin=float(min(gains[gains > 1.0], default=math.inf)),
        lower_gain_margin=float(max(gains[(gains < 1.0) & (gains > ZERO_GAIN)], default=0.0)),
        phase_margin_deg=math.inf if nearest is None else float(phases[nearest]),
        crossover_rad_s=crossover,
        peak_sensitivity=1.0 / float(min(*distances, abs(1.0 + end), math.inf)),
    )


def _bilinear_w(a: Any, b: Any, c: Any, d: Any, period_s: float) -> tuple[Any, Any, Any, Any]:
    """Transform a sampled loop by the bilinear transform, z = (1 + w T / 2) / (1 - w T / 2).

    Raises ServoError for a pole at z = -1.
    """
    one = np.eye(len(a))
    if len(a) and np.min(np.abs(np.linalg.eigvals(a) + 1.0)) < ZERO_POLE:
        raise ServoError(
            "a sampled loop with a pole at z = -1; must have none: "
            "add a filter, as it oscillates at the Nyquist frequency"
        )
    inverse = np.linalg.inv(one + a)
    return (
        2.0 / period_s * inverse @ (a - one),
        2.0 / period_s * inverse @ b,
        2.0 * c @ inverse,
        d - c @ inverse @ b,
    )


def eigenvector_condition(system: Any) -> float:
    """Compute the condition number of the eigenvector matrix of the state matrix.

    Columns of length 1; 1 is the optimum, and beyond 1e7 two eigenvectors are nearly parallel
    (source 001). States are balanced first: their units say nothing about robustness.
    """
    import control
    from scipy.linalg import matrix_balance

    a = np.asarray(control.ss(system).A)
    if a.size == 0:
        return 1.0
    balanced, _ = matrix_balance(a, permute=False)
    _, vectors = np.linalg.eig(balanced)
    return float(np.linalg.cond(vectors))


def continuous_equivalents(found: Any, dt: Any) -> ComplexArray:
    """Convert poles or zeros of a discrete system to log(z) / dt [1/s].

    Those at 0, which are mere delays, are left out.
    """
    values = np.asarray(found, dtype=np.complex128)
    if not dt:
        return values
    return np.asarray(np.log(values[np.abs(values) > ZERO_POLE]) / float(dt))
