"""Least-squares fit of one model of a decay to the samples of a window."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_model import (
    DAMPING_TERMS,
    MODE_SIZE,
    TERMS,
    DecayModel,
    ModeSum,
    ParameterLayout,
    mode_sum,
)
from rig.analysis.identify.large_swing import LargeSwing
from rig.analysis.identify.least_squares import (
    MIN_GAIN_REL,
    influence,
    levenberg_marquardt,
    unit_covariance,
)
from rig.analysis.identify.sampled import Sampled, noise_rms

FloatArray = npt.NDArray[np.float64]

EXACT = 2e-6  # residual over the range of the values; the closed model is this exact at 0.3 rad
SPIKE_SIGMA = 6.0
LARGE_MIN_GAIN = 1e-4  # an integration costs more than a hundredth of a sigma is worth
MAX_SPIKES = 0.1  # of the samples


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedDecay:
    """Fitted model of a window, and what it left."""

    record: Sampled
    model: DecayModel
    elliptic: bool
    is_large: bool  # integrated
    p: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    dropped: int = 0  # samples left out as spikes

    @property
    def layout(self) -> ParameterLayout:
        """Modes and terms."""
        return self.model.layout

    @property
    def tau(self) -> FloatArray:
        """Times (N,) since the start of the window [s]."""
        return np.asarray(self.record.t_s - self.record.t_s[0])

    @property
    def variance(self) -> float:
        """Variance of a sample about the model."""
        degrees = max(1.0, self.residual.size - self.layout.size * self.record.correlated_frames)
        return float(self.residual @ self.residual) / degrees

    @property
    def is_exact(self) -> bool:
        """Tell if the model leaves no more than its own error: a computed record."""
        return math.sqrt(self.variance) < EXACT * float(np.ptp(self.record.values))

    @property
    def criterion(self) -> float:
        """Bayesian information criterion, of as many samples as are independent."""
        count = self.residual.size / self.record.correlated_frames
        cost = max(float(self.residual @ self.residual), 1e-300)
        return count * math.log(cost) + self.layout.size * math.log(count)

    def covariance(self, pseudo_inverse: FloatArray) -> FloatArray:
        """Covariance (P, P) of the parameters from noise alone; the influence is (P, N)."""
        record = self.record
        unit = unit_covariance(
            pseudo_inverse, self.tau, record.correlated_frames, record.frame_period_s
        )
        return self.variance * unit

    def residual_noise(self) -> float:
        """White noise of the residual, from its fourth differences."""
        return noise_rms(self.residual, self.record.correlated_frames)

    def predict(self, record: Sampled) -> FloatArray:
        """Compute the values (M,) of the closed model at other stamps, before the window too."""
        model = ModeSum(
            tau=record.t_s - self.record.t_s[0],
            layout=self.layout,
            elliptic=self.elliptic,
            average_frames=record.average_frames,
            frame_period_s=record.frame_period_s,
            span_s=self.record.duration_s,
        )
        return model(self.p)[0]


def fit(
    record: Sampled,
    layout: ParameterLayout,
    start: FloatArray,
    *,
    elliptic: bool,
    is_large: bool = False,
) -> FittedDecay:
    """Minimise the squares from a start on."""
    model: DecayModel
    if is_large:
        model = LargeSwing(record, layout)
    else:
        model = mode_sum(record, layout, elliptic=elliptic)
    with np.errstate(all="ignore"):  # steps that overflow have infinite cost
        p, residual, jacobian = levenberg_marquardt(
            model,
            record.values,
            start,
            _inside(layout, float(start[0]) if is_large else None),
            LARGE_MIN_GAIN if is_large else MIN_GAIN_REL,
        )
    return FittedDecay(
        record=record,
        model=model,
        elliptic=elliptic,
        is_large=is_large,
        p=p,
        residual=residual,
        jacobian=jacobian,
    )


def refit(previous: FittedDecay, record: Sampled, start: FloatArray | None = None) -> FittedDecay:
    """Fit the same model to other samples."""
    return fit(
        record,
        previous.layout,
        previous.p if start is None else start,
        elliptic=previous.elliptic,
        is_large=previous.is_large,
    )


def without_spikes(found: FittedDecay) -> FittedDecay:
    """Leave out the samples that stand alone, away from their neighbours, and fit again."""
    from scipy.ndimage import median_filter

    record = found.record
    width = 2 * record.correlated_frames + 3
    slow = median_filter(found.residual, width, mode="mirror")
    noise = max(found.residual_noise(), record.quantum / math.sqrt(12))
    is_spike = np.abs(found.residual - slow) > SPIKE_SIGMA * noise
    count = int(np.count_nonzero(is_spike))
    if noise == 0 or count == 0 or count > MAX_SPIKES * is_spike.size:
        return found
    kept = record.kept(np.flatnonzero(~is_spike))
    shift_s = float(kept.t_s[0] - record.t_s[0])
    again = refit(found, kept, advanced(found.p, found.layout, shift_s))
    return replace(again, dropped=found.dropped + count)


def with_term(found: FittedDecay, term: str) -> FittedDecay:
    """Fit again with one term more, from its best small step."""
    layout = found.layout.with_term(term)
    start = np.append(found.p, 0.0)
    gain, step = _score(found, layout)
    if gain > 0:
        start[-1] = step
    if not found.layout.is_decay(start):
        start[-1] = 0.0
    return fit(found.record, layout, start, elliptic=found.elliptic, is_large=found.is_large)


def strongest_first(found: FittedDecay) -> FittedDecay:
    """Order the modes by their energy over the window."""
    amplitudes = [found.model.amplitude(found.p, k, found.tau) for k in range(found.layout.modes)]
    order = np.argsort([-float(amplitude @ amplitude) for amplitude in amplitudes], kind="stable")
    if np.array_equal(order, np.arange(order.size)):
        return found
    columns = (MODE_SIZE * order[:, None] + np.arange(MODE_SIZE)).ravel()
    columns = np.concatenate([columns, np.arange(found.layout.offset, found.layout.size)])
    return replace(found, p=found.p[columns], jacobian=found.jacobian[:, columns])


def term_gains(found: FittedDecay) -> dict[str, float]:
    """Estimate by how many variances each absent term reduces the squares: a score test.

    Terms of damping exist in models of one mode, and only with the sign of a loss.
    """
    gains = {}
    for term in TERMS:
        is_absent = term not in found.layout.terms
        if is_absent and (found.layout.modes == 1 or term not in DAMPING_TERMS):
            gain, step = _score(found, found.layout.with_term(term))
            if term not in DAMPING_TERMS or step > 0:
                gains[term] = gain
    return gains


def advanced(p: FloatArray, layout: ParameterLayout, shift_s: float) -> FloatArray:
    """Move the start of the parameters by shift_s, amplitudes by viscous damping alone."""
    moved = p.copy()
    for k in range(layout.modes):
        w, decay, _, _ = layout.mode(p, k)
        moved[4 * k + 2] *= math.exp(-decay * shift_s)
        moved[4 * k + 3] += w * shift_s
    return moved


def _score(found: FittedDecay, layout: ParameterLayout) -> tuple[float, float]:
    """Gain in variances and step of the last parameter of a larger layout."""
    if found.is_large and layout.terms[-1] in DAMPING_TERMS:
        _, J = LargeSwing(found.record, layout)(np.append(found.p, 0.0))
    else:
        _, J = mode_sum(found.record, layout, elliptic=found.elliptic)(np.append(found.p, 0.0))
    column = J[:, -1]
    rest = column - found.jacobian @ (influence(found.jacobian) @ column)
    square = float(rest @ rest)
    if square <= 1e-12 * float(column @ column):
        return 0.0, 0.0
    step = float(rest @ found.residual) / square
    gain = step * step * square / found.variance / found.record.correlated_frames
    return gain, step


def _inside(layout: ParameterLayout, large_from: float | None) -> Callable[[FloatArray], bool]:
    """Make the bounds; an integrated swing keeps near the frequency that it starts from."""

    def is_inside(p: FloatArray) -> bool:
        if large_from is not None and not (p[2] < math.pi and 0.5 < p[0] / large_from < 2):
            return False
        return layout.is_decay(p)

    return is_inside
