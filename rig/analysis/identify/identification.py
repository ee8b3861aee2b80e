"""Result of the identification of a free decay."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


class Reason(NamedTuple):
    """Reason why a result is doubtful or refused, or what was done to the record (a note)."""

    code: str
    text: str  # with the measured figures
    is_doubt: bool = True


class BudgetRow(NamedTuple):
    """One standard deviation that a cause adds to frequency and damping ratio of the first mode."""

    term: str
    frequency_hz: float
    damping_ratio: float
    cable_length_m: float = 0.0


class DampingAt(NamedTuple):
    """Damping ratio in a part of the window."""

    amplitude: float
    damping_ratio: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class Mode:
    """One mode of the decay; sigma is the whole standard deviation, sigma_noise that of the noise.

    The frequency is undamped; that of a pendulum belongs to small swings.
    """

    frequency_hz: float
    damping_ratio: float  # at at_amplitude
    amplitude: float  # turning point at the start of the window [unit of the record]
    at_amplitude: float
    sigma_frequency_hz: float
    sigma_damping_ratio: float
    sigma_amplitude: float
    sigma_noise_frequency_hz: float
    sigma_noise_damping_ratio: float
    decay_time_s: float  # to 1/e; inf without decay
    q: float


@dataclass(frozen=True, kw_only=True)
class SecondOpinion:
    """The strongest mode by other methods; nan where a method gives nothing."""

    frequency_hz: float  # matrix pencil
    damping_ratio: float
    frequency_difference_hz: float  # pencil minus fit
    damping_difference: float
    decrement_damping_ratio: float  # logarithmic decrement over decrement_periods
    decrement_periods: int
    hann_peak_hz: float  # of the windowed FFT
    hamming_peak_hz: float
    fft_bin_hz: float


def no_array() -> FloatArray:
    """Make an empty array."""
    return np.zeros(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Traces:
    """Arrays for a page: samples of the window as fitted (N,), and what was left."""

    t_s: FloatArray = field(default_factory=no_array)
    values: FloatArray = field(default_factory=no_array)
    fitted: FloatArray = field(default_factory=no_array)
    residual: FloatArray = field(default_factory=no_array)
    spectrum_hz: FloatArray = field(default_factory=no_array)  # (M,)
    residual_amplitude: FloatArray = field(default_factory=no_array)  # (M,) of a sinusoid
    singular_values: FloatArray = field(default_factory=no_array)  # (L,) of the Hankel matrix
    stabilisation_order: FloatArray = field(default_factory=no_array)  # (K,) poles of the pencil
    stabilisation_hz: FloatArray = field(default_factory=no_array)  # (K,)
    stabilisation_damping: FloatArray = field(default_factory=no_array)  # (K,)


@dataclass(frozen=True, kw_only=True, eq=False)
class Identification:
    """Modes of a free decay with their whole uncertainty, and the verdict on the fit.

    A refused record has no modes and no frequency.
    """

    verdict: str  # good, doubtful or refused
    reasons: tuple[Reason, ...]  # of the verdict
    notes: tuple[Reason, ...]  # what was cut, dropped or added to the model
    kind: str  # pendulum or linear
    unit: str
    samples: int
    rate_hz: float
    gaps: int
    window_s: tuple[float, float] | None = None
    modes: tuple[Mode, ...] = ()  # most energy over the window first
    terms: tuple[str, ...] = ()  # of the model beside viscous damping and an offset
    offset: float | None = None
    small_amplitude_frequency_hz: float | None = None  # pendulum only
    cable_length_m: float | None = None  # of the equivalent simple pendulum
    sigma_cable_length_m: float | None = None
    damping_over_amplitude: tuple[DampingAt, ...] = ()
    noise_rms: float | None = None  # from fourth differences, not below quantum/sqrt(12)
    residual_over_noise: float | None = None
    second_opinion: SecondOpinion | None = None
    budget: tuple[BudgetRow, ...] = ()
    traces: Traces = field(default_factory=Traces)
