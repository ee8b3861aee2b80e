"""Search of the free decay in a record: thinning, window, model, and what was cut."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.decay_fit import FittedDecay, fit, refit
from rig.analysis.identify.decay_window import (
    extended,
    faded_after,
    start_of_decay,
    stop_before_rise,
)
from rig.analysis.identify.identification import Reason
from rig.analysis.identify.identify_options import MAX_MODES, IdentifyOptions
from rig.analysis.identify.large_search import LARGE_RAD, large_fit
from rig.analysis.identify.mode_search import first_fit, search
from rig.analysis.identify.refusals import (
    refuse_clipped,
    refuse_growing,
    refuse_large_unit,
    refuse_spliced,
)
from rig.analysis.identify.sampled import MIN_SAMPLES, Sampled, thinned
from rig.analysis.identify.spectrum import line_amplitudes, strongest_frequency_hz
from rig.analysis.identify.turning_points import TurningPoints, turning_points

FloatArray = npt.NDArray[np.float64]

SAMPLES_PER_PERIOD = 24  # kept of the highest line
MIN_SAMPLES_PER_PERIOD = 6.0  # below which turning points cannot be seen: no window is sought
MIN_THINNED = 2000  # samples; fewer are not worth thinning
HIGHEST_LINE = 0.05  # of the strongest one
LINE_OVER_NOISE = 10.0
LINEAR_GAIN = 25.0  # variances that a linear oscillator fits better by, before it counts
GOOD_RESIDUAL = 2.0  # times the noise: no reason to look for another window


def decay_of(record: Sampled, options: IdentifyOptions) -> tuple[FittedDecay, list[Reason]]:
    """Fit the free decay of a record; raises RefusedError where there is none."""
    frequency_hz = strongest_frequency_hz(record, record.values)
    refuse_clipped(record, frequency_hz)
    notes: list[Reason] = []
    record = _thinned(record, frequency_hz, notes)
    if 1 / (frequency_hz * record.step_s) < MIN_SAMPLES_PER_PERIOD:
        found = _window_fit(record, 0, record.values.size, options)
        _note_cuts(found, record, notes)
        return found, notes
    points = turning_points(record, frequency_hz)
    start = start_of_decay(points)
    refuse_spliced(record.part(int(points.sample[start]), record.values.size), frequency_hz)
    refuse_growing(record, points, start)
    amplitude = float(points.half_swings[start])
    if options.is_pendulum:
        refuse_large_unit(amplitude)
    if options.is_pendulum and amplitude > LARGE_RAD:
        found = large_fit(record, points, start, notes)
        if options.modes is not None and options.modes > 1:
            text = f"one mode is fitted beyond {LARGE_RAD} rad, {options.modes} were asked for"
            notes.append(Reason("amplitude", text))
    else:
        found = _closed_fit(record, points, start, options, notes)
    _note_cuts(found, record, notes)
    return found, notes


def _closed_fit(
    record: Sampled,
    points: TurningPoints,
    start: int,
    options: IdentifyOptions,
    notes: list[Reason],
) -> FittedDecay:
    """Fit by the closed model from the first large turning point on, to a rise where it helps."""
    first = int(points.sample[start])
    if options.is_pendulum and record.values.size - first >= MIN_SAMPLES:
        notes += kind_doubts(record.part(first, record.values.size))
    found = _window_fit(record, first, record.values.size, options)
    stop = stop_before_rise(points, start)
    if stop is None or stop - first < 2 * MIN_SAMPLES:
        return found
    if math.sqrt(found.variance) < GOOD_RESIDUAL * found.residual_noise():
        return found
    shorter = _window_fit(record, first, stop, options)
    return shorter if shorter.variance < found.variance / 4 else found


def kind_doubts(window: Sampled) -> list[Reason]:
    """Doubt a pendulum in radians whose frequency does not follow the amplitude."""
    pendulum = first_fit(window, elliptic=True)
    linear = fit(window, pendulum.layout, pendulum.p, elliptic=False)
    lost = float(pendulum.residual @ pendulum.residual - linear.residual @ linear.residual)
    gain = lost / linear.variance / window.correlated_frames
    if gain < LINEAR_GAIN:
        return []
    amplitude = float(pendulum.model.amplitude(pendulum.p, 0, np.zeros(1))[0])
    return [
        Reason(
            "kind",
            f"the frequency does not follow the amplitude of {amplitude:.3g} rad as that of a "
            f"pendulum does (a linear oscillator fits better by {gain:.0f} variances): is the "
            "unit radian, and is it a pendulum?",
        )
    ]


def _window_fit(record: Sampled, first: int, stop: int, options: IdentifyOptions) -> FittedDecay:
    if record.values.size - first < MIN_SAMPLES:
        first = 0
    whole = record.part(0, stop)
    window = record.part(first, stop)
    found = first_fit(window, elliptic=options.is_pendulum)
    faded = faded_after(found)
    if faded is not None and faded > MIN_SAMPLES and faded < 0.8 * window.values.size:
        whole = record.part(0, first + faded)
        found = refit(found, window.part(0, faded))
    found = extended(found, whole, first)
    found = search(found, options.modes, MAX_MODES)
    reached = int(np.searchsorted(whole.t_s, found.record.t_s[0]))
    return extended(found, whole, reached)


def _thinned(record: Sampled, frequency_hz: float, notes: list[Reason]) -> Sampled:
    """Average blocks of samples where the highest line leaves many in a period."""
    if record.average_frames > 1 or record.values.size < 2 * MIN_THINNED:
        return record
    lines_hz, lines = line_amplitudes(record, record.values)
    usual = float(np.sqrt(np.mean(lines**2)))
    strong = lines > max(
        HIGHEST_LINE * float(lines.max()), LINE_OVER_NOISE * float(np.median(lines))
    )
    highest_hz = max(frequency_hz, float(lines_hz[strong].max()) if strong.any() else 0.0)
    if usual == 0:
        return record
    block = int(1 / (SAMPLES_PER_PERIOD * highest_hz * record.step_s))
    block = min(block, record.values.size // MIN_THINNED)
    if block < 2:
        return record
    notes.append(Reason("thinned", f"{block} samples averaged to one before the fit", False))
    return thinned(record, block)


def _note_cuts(found: FittedDecay, record: Sampled, notes: list[Reason]) -> None:
    lead_s = float(found.record.t_s[0] - record.t_s[0])
    tail_s = float(record.t_s[-1] - found.record.t_s[-1])
    if lead_s > record.step_s:
        notes.append(Reason("lead_in", f"{lead_s:.4g} s before the free decay left out", False))
    if tail_s > record.step_s:
        notes.append(Reason("tail", f"{tail_s:.4g} s after the decay left out", False))
    if found.dropped:
        notes.append(Reason("spikes", f"{found.dropped} samples left out as spikes", False))
    terms = found.layout.terms
    notes += [Reason("term", f"the record asks for the term {term}", False) for term in terms]
