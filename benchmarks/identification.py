"""How right the identification of a decay is, and whether its uncertainty holds
(`python -m benchmarks.identification [--short] [--records N] [--rows WORD] [--ideal]`).

Each row draws records from integrated truths, with clock, angle scale and gain drift drawn from
the budget of the identification; --ideal draws none, for the rmse over the bound. Columns: rmse
over the Cramer-Rao bound of white noise (known systematics removed to first order), share within
two of the whole sigma, median error over sigma, share flagged doubtful or refused.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.decays import FREQUENCY_HZ, Disturbance, Swing, bound, record
from benchmarks.timing import interpreter_line, is_short
from rig.analysis.identify.identification import Identification
from rig.analysis.identify.identify import identify_record
from rig.analysis.identify.identify_options import IdentifyOptions

CLEAN = Disturbance()
MEAN_OF_5 = Disturbance(average_frames=5)
BEAT = (1.02, 1.0)
UP = 1.47 / 0.61


class Row(NamedTuple):
    """A case of the table."""

    name: str
    swing: Swing = Swing()
    disturbance: Disturbance = CLEAN
    kind: str = "pendulum"


ROWS = (
    Row("base"),
    Row("zeta 0.001", Swing(damping_ratio=0.001)),
    Row("zeta 0.005", Swing(damping_ratio=0.005)),
    Row("zeta 0.02", Swing(damping_ratio=0.02)),
    Row("zeta 0.05", Swing(damping_ratio=0.05)),
    Row("zeta 0.1", Swing(damping_ratio=0.1)),
    Row("zeta 0.2", Swing(damping_ratio=0.2)),
    Row("3 s", Swing(duration_s=3)),
    Row("5 s", Swing(duration_s=5)),
    Row("10 s", Swing(duration_s=10)),
    Row("10 s zeta 0.01", Swing(duration_s=10, damping_ratio=0.01)),
    Row("60 mrad, mean of 5", Swing(amplitude=0.06), MEAN_OF_5),
    Row("2 mrad, mean of 5", Swing(amplitude=0.002), MEAN_OF_5),
    Row("1 mrad", Swing(amplitude=0.001)),
    Row("offset 20 mrad", disturbance=Disturbance(offset=0.02)),
    Row("trend 1 mrad", disturbance=Disturbance(trend=1e-3)),
    Row("trend 5 mrad", disturbance=Disturbance(trend=5e-3)),
    Row("quadratic drift 3 mrad", disturbance=Disturbance(trend_squared=3e-3)),
    Row("5 % lost", disturbance=Disturbance(lost=0.05)),
    Row("5 % lost in bursts of 10", disturbance=Disturbance(lost=0.05, burst=10)),
    Row("jitter 2 ms, stamped", disturbance=Disturbance(jitter_s=2e-3)),
    Row("jitter 2 ms, nominal", disturbance=Disturbance(jitter_s=2e-3, stamps_nominal=True)),
    Row("AR1 noise 0.9", disturbance=Disturbance(ar1=0.9)),
    Row("AR1 noise 0.98", disturbance=Disturbance(ar1=0.98)),
    Row("random walk", disturbance=Disturbance(walk=True)),
    Row("quantised 1 mrad, no noise", disturbance=Disturbance(noise=0, quantum=1e-3)),
    Row("quantised 1 mrad", disturbance=Disturbance(quantum=1e-3)),
    Row("1 % outliers 20 mrad", disturbance=Disturbance(outliers=0.01)),
    Row("drag q 0.01", Swing(drag=0.01)),
    Row("drag q 0.1", Swing(drag=0.1)),
    Row("drag q 0.05, 0.7 rad", Swing(drag=0.05, amplitude=0.7)),
    Row("friction 2e-4", Swing(friction=2e-4)),
    Row("0.3 rad", Swing(amplitude=0.3)),
    Row("0.5 rad", Swing(amplitude=0.5)),
    Row("0.7 rad", Swing(amplitude=0.7)),
    Row("2 rad, zeta 0.01", Swing(amplitude=2.0, damping_ratio=0.01)),
    Row("linear 0.3", Swing(amplitude=0.3, force="linear"), kind="linear"),
    Row("Duffing +0.5, 0.3", Swing(amplitude=0.3, force="cubic", cubic=0.5), kind="linear"),
    Row("Duffing -0.5, 0.3", Swing(amplitude=0.3, force="cubic", cubic=-0.5), kind="linear"),
    Row("2nd mode 20 %", disturbance=Disturbance(second=(UP, 0.2))),
    Row("2nd mode 2 %", disturbance=Disturbance(second=(UP, 0.02))),
    Row("2nd mode 60 %, linear", Swing(force="linear"), Disturbance(second=(UP, 0.6)), "linear"),
    Row("beat 2 %, 5 %", disturbance=Disturbance(second=(1.02, 0.05))),
    Row("beat 2 %, 30 %", disturbance=Disturbance(second=(1.02, 0.3))),
    Row("beat 2 %, 100 %", disturbance=Disturbance(second=(1.02, 1.0))),
    Row(
        "beat 2 %, 30 %, 120 s",
        Swing(duration_s=120, force="linear"),
        Disturbance(second=(1.02, 0.3)),
        "linear",
    ),
)


class Outcome(NamedTuple):
    """One record."""

    result: Identification
    frequency_error: float  # over the bound, known systematics removed; nan where refused
    damping_error: float
    frequency_sigmas: float  # whole error over whole sigma
    damping_sigmas: float


def main() -> None:
    """Measure and print."""
    count = 2 if is_short() else int(_argument("--records", "60"))
    word = _argument("--rows", "zeta" if is_short() else "")
    print(interpreter_line(), end="\n\n")
    print(
        f"{'case':28s}{'f/CRB':>8s}{'z/CRB':>8s}{'f 2s':>6s}{'z 2s':>6s}{'med f':>6s}{'med z':>6s}"
        f"{'flag':>6s}  reasons (records {count})"
    )
    for row in ROWS:
        if word in row.name:
            _print_row(row, count)


def _print_row(row: Row, count: int) -> None:
    rng = np.random.default_rng(abs(hash_of(row.name)))
    outcomes = [_outcome(row, rng) for _ in range(count)]
    answered = [o for o in outcomes if o.result.modes]
    flagged = sum(o.result.verdict != "good" for o in outcomes) / count
    codes = Counter(code for o in outcomes for code in {r.code for r in o.result.reasons})
    terms = Counter(term for o in outcomes for term in o.result.terms)
    modes = Counter(len(o.result.modes) for o in outcomes)
    errors = np.array([o[1:] for o in answered]) if answered else np.full((1, 4), np.nan)
    rmse = np.sqrt(np.mean(errors[:, :2] ** 2, axis=0))
    cover = np.mean(np.abs(errors[:, 2:]) <= 2, axis=0)
    median = np.median(np.abs(errors[:, 2:]), axis=0)
    fails = "" if max(flagged, cover.min()) >= 0.9 else "  <--"
    notes = " ".join(f"{name}:{n}" for name, n in (codes + terms).most_common())
    print(
        f"{row.name:28s}{rmse[0]:8.2f}{rmse[1]:8.2f}{cover[0]:6.2f}{cover[1]:6.2f}"
        f"{median[0]:6.2f}{median[1]:6.2f}{flagged:6.2f}  modes {dict(modes)} {notes}{fails}",
        flush=True,
    )


def _outcome(row: Row, rng: np.random.Generator) -> Outcome:
    options = IdentifyOptions(
        kind=row.kind, average_frames=row.disturbance.average_frames, frame_period_s=0.02
    )
    drawn_rel = (options.clock_ppm * 1e-6, options.angle_scale_rel, options.gain_drift_rel)
    clock, scale, drift = np.zeros(3) if "--ideal" in sys.argv else rng.normal(0, drawn_rel)
    drawn = replace(row.disturbance, clock=clock, scale=scale, gain_drift=drift)
    t, y, start_s = record(row.swing, drawn, rng)
    result = identify_record(t, y, options)
    if not result.modes:
        return Outcome(result, np.nan, np.nan, np.nan, np.nan)
    mode = min(result.modes, key=lambda mode: abs(mode.frequency_hz - FREQUENCY_HZ))
    frequency_hz = FREQUENCY_HZ * (1 + 3 / 8 * row.swing.cubic * mode.at_amplitude**2)
    damping = row.swing.damping_at(mode.at_amplitude)
    f_error = mode.frequency_hz - frequency_hz
    z_error = mode.damping_ratio - damping
    noise = max(row.disturbance.noise, row.disturbance.quantum / np.sqrt(12))
    f_bound, z_bound = bound(row.swing, noise, start_s)
    omega = 2 * np.pi * FREQUENCY_HZ
    pendulum = row.swing.force == "pendulum"
    known_f = -clock + pendulum * scale * mode.at_amplitude**2 / 8
    return Outcome(
        result,
        (f_error - known_f * FREQUENCY_HZ) / f_bound,
        (z_error + drift / (omega * row.swing.duration_s)) / z_bound,
        f_error / mode.sigma_frequency_hz,
        z_error / mode.sigma_damping_ratio,
    )


def hash_of(name: str) -> int:
    """Make a seed of a name, the same in every run."""
    return sum((k + 1) * ord(letter) for k, letter in enumerate(name))


def _argument(name: str, default: str) -> str:
    return sys.argv[sys.argv.index(name) + 1] if name in sys.argv else default


if __name__ == "__main__":
    main()
