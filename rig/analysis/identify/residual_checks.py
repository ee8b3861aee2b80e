"""Checks of a fit, each with the measured figures: what the residual says about the model."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import EXACT, FittedDecay
from rig.analysis.identify.identification import Reason
from rig.analysis.identify.local_damping import half_shifts
from rig.analysis.identify.sampled import Sampled, clock_doubt
from rig.analysis.identify.spectrum import line_amplitudes

FloatArray = npt.NDArray[np.float64]

QUIET_OVER_NOISE = 1.5  # a residual no larger than its noise may follow itself
MAX_RESIDUAL_OVER_NOISE = 3.0
WHITENESS_LAGS = 25
MIN_WHITENESS_P = 1e-3
MAX_HALF_SIGMAS = 4.0
MAX_SECOND_PEAK = 0.05  # of the amplitude
LINE_OVER_NOISE = 6.0  # of a residual line over the rms line, before it counts
MAX_HOLE_PERIODS = 0.5
MAX_HOLES = 0.2  # of the window
SLOW_STEP_S, SLOW_HZ = 1.0, 0.05  # beyond both, stamps are more likely milliseconds


def noise_floor(found: FittedDecay, quantum: float) -> float:
    """White noise of the record: fourth differences of what is left, and the quantum's share.

    Not below what the closed model leaves of an exact pendulum.
    """
    least = EXACT * float(np.ptp(found.record.values))
    return max(found.residual_noise(), quantum / math.sqrt(12), least)


def residual_reasons(found: FittedDecay, noise: float) -> list[Reason]:
    """Judge size, whiteness and lines of the residual."""
    reasons: list[Reason] = []
    rms = math.sqrt(found.variance)
    if found.is_exact:
        return reasons
    if rms > MAX_RESIDUAL_OVER_NOISE * noise:
        ratio = rms / max(noise, 1e-300)
        reasons.append(
            Reason("residual", f"the fit leaves {rms:.3g} rms, {ratio:.1f} times the noise")
        )
    chance = whiteness(found)
    if chance < MIN_WHITENESS_P:
        reasons.append(
            Reason(
                "not_white",
                f"the residual follows itself (portmanteau p = {chance:.1e} over "
                f"{WHITENESS_LAGS} lags): slow noise, or a term that the model lacks; the "
                "uncertainty is widened for it",
                is_doubt=rms > QUIET_OVER_NOISE * noise,
            )
        )
    amplitude = strongest_amplitude(found)
    lines_hz, lines = line_amplitudes(found.record, found.residual)
    highest = int(np.argmax(lines))
    usual = float(np.sqrt(np.mean(lines**2)))
    if lines[highest] > max(MAX_SECOND_PEAK * amplitude, LINE_OVER_NOISE * usual):
        reasons.append(
            Reason(
                "second_peak",
                f"the residual holds a line of {lines[highest] / amplitude:.1%} of the amplitude "
                f"at {lines_hz[highest]:.4g} Hz: allow one mode more",
            )
        )
    return reasons


def half_reasons(found: FittedDecay, drift_hz: float) -> tuple[list[Reason], float, float]:
    """Compare both halves of the window; also the model's share of the uncertainty.

    drift_hz: what the drift of the gain does to the frequency, sigma.
    Returns reasons, and half of the difference beyond two sigma of frequency [Hz] and damping.
    """
    halves = half_shifts(found)
    if halves is None or found.is_exact:
        return [], 0.0, 0.0
    reasons = []
    shares = []
    known = (drift_hz, 0.0)
    names = (("frequency", "Hz"), ("damping ratio", ""))
    for (name, unit), first, second, systematic in zip(names, *halves, known, strict=True):
        apart = abs(first.value - second.value)
        sigma = math.hypot(first.sigma, second.sigma, systematic)
        shares.append(math.sqrt(max(0.0, apart**2 - 4 * sigma**2)) / 2)
        if apart > MAX_HALF_SIGMAS * sigma:
            reasons.append(
                Reason(
                    "halves",
                    f"the halves of the window differ in {name} by {apart:.3g} {unit}".rstrip()
                    + f", {apart / sigma:.1f} sigma: the model does not hold throughout",
                )
            )
    return reasons, shares[0], shares[1]


def clock_reasons(record: Sampled, frequency_hz: float) -> list[Reason]:
    """Judge stamps and holes of the window."""
    reasons = []
    if record.step_s > SLOW_STEP_S and frequency_hz < SLOW_HZ:
        text = f"a sample every {record.step_s:.4g} s and a swing of {1 / frequency_hz:.4g} s"
        reasons.append(Reason("rate", text + ": are the stamps milliseconds?"))
    irregular = clock_doubt(record)
    if irregular:
        reasons.append(Reason("clock", f"irregular stamps: {irregular}"))
    steps = np.diff(record.t_s)
    longest = int(np.argmax(steps))
    periods = float(steps[longest]) * frequency_hz
    missing = float(np.sum(steps[steps > 1.5 * record.step_s] - record.step_s)) / record.duration_s
    if record.gap_count and (periods > MAX_HOLE_PERIODS or missing > MAX_HOLES):
        reasons.append(
            Reason(
                "holes",
                f"{record.gap_count} holes take {missing:.0%} of the window, the longest "
                f"{steps[longest]:.3g} s ({periods:.2g} periods) after {record.t_s[longest]:.6g} s",
            )
        )
    return reasons


def whiteness(found: FittedDecay) -> float:
    """Compute the probability of autocorrelations this large in white noise (Ljung & Box 1978).

    Of a moving average over n frames every n-th sample is taken, which share no frame.
    """
    from scipy.special import gammaincc

    stride = found.record.correlated_frames
    if stride > 1:
        frame = np.rint(found.tau / found.record.frame_period_s).astype(np.int64)
        values = found.residual[frame % stride == 0]
    else:
        values = found.residual
    count = values.size
    lags = min(WHITENESS_LAGS, count // 5)
    taken = found.layout.size
    power = float(values @ values)
    if lags < 2 or power == 0:
        return 1.0
    products = [float(values[lag:] @ values[:-lag]) / power for lag in range(1, lags + 1)]
    weights = 1 / (count - np.arange(1, lags + 1))
    statistic = count * (count + 2) * float(np.sum(weights * np.square(products)))
    # the fit takes about its parameters' share out of the lowest lags of a short record
    statistic *= max(0.2, 1 - 2 * taken / count)
    return float(gammaincc(lags / 2, statistic / 2))


def strongest_amplitude(found: FittedDecay) -> float:
    """Amplitude of the strongest mode at the start of the window."""
    start = np.zeros(1)
    return max(
        float(found.model.amplitude(found.p, k, start)[0]) for k in range(found.layout.modes)
    )
