"""Coverage of the uncertainty of a run: random simulated benches, from the picture to the figures.

    python -m benchmarks.coverage [--runs N] [--seed S]

Each run is a free decay of a cable before a camera with a pitch that its calibration knows. Clock,
gravity and scale of the camera are drawn from the budget. Printed for each quantity: how often the
truth lies within two standard deviations, the median of error over sigma, and how often it was
given at all.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

from rig.analysis.analyze import RunAnalysis
from rig.analysis.summary import QUANTITIES
from rig.errors import RigError
from rig.run import config, experiment
from rig.run.calibration import file as calibration_file
from rig.run.calibration.file import Calibration
from rig.run.runs import LOG

TERMS = config.AnalysisSection()
TABLE_M = (-0.2, -0.1, 0.0, 0.1, 0.2)
WIDTH, HEIGHT = 640, 480
FOCAL_PX, DISTANCE_M, ABOVE_M = 1000.0, 1.0, 0.28  # of the simulated camera
WATCH_S = 24.0  # in which the scale drifts by `gain_drift_rel`


def calibration_of(pitch_rad: float, path: Path) -> None:
    """Write the calibration of a camera with a pitch, by the projection of a hanging cable."""
    sine, cosine = math.sin(pitch_rad), math.cos(pitch_rad)
    depth_m = DISTANCE_M * cosine - ABOVE_M * sine
    row_px = HEIGHT / 2 + FOCAL_PX * (-DISTANCE_M * sine - ABOVE_M * cosine) / depth_m
    found = Calibration(
        made="2026-11-30T00:00:00+00:00",
        camera="red_plane",
        seed=1,
        width=WIDTH,
        height=HEIGHT,
        pivot_home_px=(WIDTH / 2, row_px),
        pixels_per_m=FOCAL_PX / depth_m,
        x_m=list(TABLE_M),
        offset_rad=[math.atan(-x * sine / DISTANCE_M) for x in TABLE_M],
        sigma_offset_rad=[1e-6] * len(TABLE_M),
    )
    calibration_file.save(found, path)


def changes_of(rng: np.random.Generator, folder: Path) -> list[str]:
    """Draw a bench; returns `section.key=value` changes of the experiment free_decay."""
    pitch_deg = rng.uniform(0.0, 3.0)
    path = folder / "calibration.toml"
    calibration_of(math.radians(pitch_deg), path)
    gravity_m_s2 = rng.normal(9.81, TERMS.gravity_sigma_m_s2)
    return [
        f"experiment.seed={rng.integers(1, 10**6)}",
        f"experiment.watch_s={WATCH_S}",
        "bench.robot.kind=cartesian",
        f"bench.pendulum.length_m={rng.uniform(0.3, 2.0):.6f}",
        f"bench.pendulum.damping_ratio={10.0 ** rng.uniform(-4.0, math.log10(0.2)):.8f}",
        f"bench.pendulum.initial_swing_rad={10.0 ** rng.uniform(-2.3, -0.523):.6f}",
        f"bench.pendulum.gravity_m_s2={gravity_m_s2:.6f}",
        f"bench.clock_ppm={rng.normal(0.0, TERMS.clock_ppm):.3f}",
        f"bench.camera.pitch_deg={pitch_deg:.6f}",
        f"bench.camera.gain_drift_rel={rng.normal(0.0, TERMS.gain_drift_rel):.8f}",
        f"vision.calibration={path}",
        "safety.initial_swing_rad=1.5",
    ]


def main() -> None:
    """Run the benches and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    scores: dict[str, list[float]] = defaultdict(list)
    verdicts: dict[str, int] = defaultdict(int)
    for number in range(arguments.runs):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            changes = changes_of(rng, folder)
            try:
                chosen = config.read_experiment("free_decay", changes)
                ran = experiment.run(
                    chosen,
                    "virtual",
                    folder / "runs",
                    lambda t_ns, operator: None,
                    lambda j, p: None,
                )
            except RigError as error:
                verdicts[f"not run: {error}"] += 1
                continue
            summary = RunAnalysis(ran.folder / LOG).summary
        verdicts[summary.verdict] += 1
        parts = []
        for quantity in QUANTITIES:
            value = getattr(summary.measured, quantity.key)
            sigma = getattr(summary.sigma, quantity.key)
            true = None if summary.truth is None else getattr(summary.truth, quantity.key)
            if value is None or sigma is None or true is None:
                continue
            score = (value - true) / sigma
            scores[quantity.key].append(score)
            if abs(score) > 3.0:
                parts.append(f"{quantity.key} {score:+.1f}")
        if parts:
            print(number, summary.verdict, "; ".join(parts), " ".join(changes[3:10]), flush=True)
    print(f"\n{arguments.runs} runs: {dict(verdicts)}")
    print(f"{'quantity':24} {'given':>6} {'within 2 sigma':>15} {'median |error|/sigma':>22}")
    for key, values in scores.items():
        absolute = np.abs(values)
        print(
            f"{key:24} {len(values):6d} {100 * np.mean(absolute <= 2):14.1f}% "
            f"{np.median(absolute):22.2f}"
        )


if __name__ == "__main__":
    main()
