"""Notch filter: zeros on a lightly damped pole pair, and a well damped pole pair in its place.

    N(s) = (s^2 + 2 z1 w s + w^2) / (s^2 + 2 z2 w s + w^2),   z1 small, z2 large

(source 001, notch filter). |N| is 1 at 0 and at infinity, and z1 / z2 at w.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from planners.trajectories.pieces import FloatArray
from rig.drives.servo.block import check_period, discretise
from rig.drives.servo.errors import ServoError, check_below_nyquist, check_datum, check_range
from rig.drives.servo.loops import PolePair

MAX_BAND_DEPTH = math.sqrt(0.5)  # a shallower notch has no -3 dB band
MAX_POLE_DAMPING = 100.0  # damping ratio of the poles


@dataclass(frozen=True, kw_only=True)
class Notch:
    """Notch filter by frequency and damping ratios of numerator and denominator.

    Raises ServoError for values out of bounds, and for numerator_damping >= denominator_damping.
    """

    frequency_rad_s: float
    numerator_damping: float
    denominator_damping: float = 1.0

    def __post_init__(self) -> None:
        check_datum("frequency_rad_s", self.frequency_rad_s)
        check_range(
            "denominator_damping", self.denominator_damping, 1e-6, MAX_POLE_DAMPING, "1 is usual"
        )
        if not 0.0 <= self.numerator_damping < self.denominator_damping:
            raise ServoError(
                f"numerator_damping = {self.numerator_damping}; must be 0 or more and < "
                f"denominator_damping = {self.denominator_damping}, otherwise it is no notch: "
                "use the damping ratio of the poles to be cancelled"
            )

    @classmethod
    def tuned_to(cls, mode: PolePair, denominator_damping: float = 1.0) -> Notch:
        """Build the notch with its zeros on a pole pair.

        Raises ServoError for a pair that is unstable or damped as much as the denominator.
        """
        return cls(
            frequency_rad_s=mode.frequency_rad_s,
            numerator_damping=mode.damping,
            denominator_damping=denominator_damping,
        )

    @classmethod
    def of_band(cls, frequency_rad_s: float, band_rad_s: float, depth: float = 0.0) -> Notch:
        """Build the notch from the width of its -3 dB band and from its depth.

        z2 = (band / 2 w) / sqrt(1 - 2 depth^2), z1 = depth z2. depth is the gain at the frequency.
        Raises ServoError for a depth of 1 / sqrt(2) or more, which has no such band, and for values
        out of bounds.
        """
        check_datum("frequency_rad_s", frequency_rad_s)
        check_datum("band_rad_s", band_rad_s)
        if not 0.0 <= depth < MAX_BAND_DEPTH:
            raise ServoError(
                f"depth = {depth}; must be 0 or more and < {MAX_BAND_DEPTH:.6g}, otherwise there "
                "is no -3 dB band: choose a deeper notch"
            )
        damping = band_rad_s / (2.0 * frequency_rad_s) / math.sqrt(1.0 - 2.0 * depth**2)
        return cls(
            frequency_rad_s=frequency_rad_s,
            numerator_damping=depth * damping,
            denominator_damping=damping,
        )

    @property
    def depth(self) -> float:
        """Gain at the frequency: z1 / z2."""
        return self.numerator_damping / self.denominator_damping

    @property
    def depth_db(self) -> float:
        """Gain at the frequency, 20 log10(depth) [dB]; -inf for undamped zeros."""
        return 20.0 * math.log10(self.depth) if self.depth else -math.inf

    @property
    def band_rad_s(self) -> float:
        """Width of the -3 dB band: 2 w sqrt(z2^2 - 2 z1^2).

        Raises ServoError for a notch whose depth is less than 3 dB.
        """
        if not self.depth < MAX_BAND_DEPTH:
            raise ServoError(
                f"numerator_damping = {self.numerator_damping}; must be < "
                f"{self.denominator_damping * MAX_BAND_DEPTH:.6g} (denominator_damping / sqrt(2)) "
                "to have a -3 dB band: raise denominator_damping"
            )
        return (
            2.0
            * self.frequency_rad_s
            * math.sqrt(self.denominator_damping**2 - 2.0 * self.numerator_damping**2)
        )

    @property
    def edges_rad_s(self) -> tuple[float, float]:
        """Edges of the -3 dB band; their product is w^2. Raises ServoError like band_rad_s."""
        half = self.band_rad_s / 2.0
        centre = math.hypot(self.frequency_rad_s, half)
        return centre - half, centre + half

    @property
    def numerator(self) -> FloatArray:
        """Numerator, highest power first."""
        w = self.frequency_rad_s
        return np.array([1.0, 2.0 * self.numerator_damping * w, w * w])

    @property
    def denominator(self) -> FloatArray:
        """Denominator, highest power first."""
        w = self.frequency_rad_s
        return np.array([1.0, 2.0 * self.denominator_damping * w, w * w])

    @property
    def system(self) -> Any:
        """Continuous filter as control.TransferFunction."""
        import control

        return control.tf(self.numerator, self.denominator)

    def sampled(self, period_s: float, *, prewarp: bool = True) -> Any:
        """Discretise by the bilinear transform; control.StateSpace.

        With prewarp it is exact at the frequency, without it lies at digital_frequency_rad_s.
        Raises BeyondNyquist for a frequency at or above the Nyquist frequency, ServoError for a
        sample time out of bounds.
        """
        self._check_sampling(period_s)
        return discretise(
            self.system, period_s, prewarp_rad_s=self.frequency_rad_s if prewarp else None
        )

    def digital_frequency_rad_s(self, period_s: float) -> float:
        """Compute the frequency of the notch sampled without prewarp.

        (2 / Ts) atan(w Ts / 2). Raises like sampled.
        """
        self._check_sampling(period_s)
        return 2.0 / period_s * math.atan(self.frequency_rad_s * period_s / 2.0)

    def _check_sampling(self, period_s: float) -> None:
        check_period(period_s)
        check_below_nyquist(
            "frequency_rad_s",
            self.frequency_rad_s,
            period_s,
            "reduce the sample time, or remove the notch",
        )
