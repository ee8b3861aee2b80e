"""`rig calibrate offsets`: drive to points with a swing-free plan, watch two periods at each, fit, and write the table."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from comms.clock import utc_now
from comms.messages import AngleSample
from planners import catalog
from planners.problem import Problem
from planners.trajectories.motion import Motion
from planners.trajectories.trajectory import Trajectory
from rig.analysis.identify.offsets import OffsetCalibration, SwingRecord, calibrate_offsets
from rig.analysis.run_log import SETTLE_S, RunLog
from rig.run.calibration.file import Calibration
from rig.run.config import Experiment
from rig.run.load_model import load_model

POINTS_M = (-0.2, -0.1, 0.0, 0.1, 0.2)
HOP_S = 2.0
PERIODS = 2.0  # watched at each point


class Tour(NamedTuple):
    """A motion through the points, and when it stands at each: (from, to) [s] from the start of the move."""

    motion: Motion
    stands_s: list[tuple[float, float]]


def experiment_for(base: Experiment) -> Experiment:
    """The base experiment with its table laid aside, every frame by itself, and time to come to rest."""
    replace = msgspec.structs.replace
    return replace(
        base,
        experiment=replace(
            base.experiment, name="calibrate", kind="free_decay", quiet_s=0.5, watch_s=0.5
        ),
        vision=replace(base.vision, calibration="none", average_frames=1),
        safety=replace(base.safety, initial_swing_rad=0.1),
    )


def tour(experiment: Experiment, points_m: tuple[float, ...] = POINTS_M) -> Tour:
    """From the start through the points and back, each hop planned not to swing."""
    e = experiment
    model = load_model(e)
    stand_s = SETTLE_S + PERIODS * 2 * math.pi / model.natural_frequency_rad_s
    here, path, stands = e.move.start_m, Trajectory.hold(e.move.start_m, 0.01), []
    for point in (*points_m, e.move.start_m):
        if point != here:
            hop = Problem(start_m=here, distance_m=point - here, time_s=HOP_S, model=model)
            path, here = path.then(catalog.plan(e.experiment.planner, hop).motion.x), point
        stands.append((path.duration_s + SETTLE_S, path.duration_s + stand_s))
        path = path.then(Trajectory.hold(point, stand_s))
    return Tour(Motion.along("x", path), stands[:-1])


def fit(
    run: RunLog, experiment: Experiment, stands_s: list[tuple[float, float]]
) -> tuple[OffsetCalibration, Calibration]:
    """The calibration in a run's log. Raises AnalysisError when a point was not seen well enough."""
    vision = experiment.vision
    samples = [a for a in run.angles if a.valid]
    watches = [_watch(samples, run.t_move_s + t0, run.t_move_s + t1) for t0, t1 in stands_s]
    found = calibrate_offsets(
        watches,
        pivot_home_px=vision.rough_pivot_px,
        pixels_per_m=vision.rough_pixels_per_m,
        natural_frequency_hz=load_model(experiment).natural_frequency_rad_s / (2 * math.pi),
    )
    frames = run.frames
    calibration = Calibration(
        made=utc_now().isoformat(timespec="seconds"),
        camera=next(iter(frames.values())).camera if frames else "unknown",
        seed=experiment.experiment.seed,
        width=experiment.camera.width,
        height=experiment.camera.height,
        pivot_home_px=(round(found.pivot_home_px[0], 4), round(found.pivot_home_px[1], 4)),
        pixels_per_m=round(found.pixels_per_m, 4),
        x_m=[round(float(x), 6) for x in found.x_m],
        offset_rad=[round(float(o), 9) for o in found.offset_rad],
        sigma_offset_rad=[round(float(s), 9) for s in found.sigma_offset_rad],
    )
    return found, calibration


def default_path(folder: Path, calibration: Calibration) -> Path:
    """calibration_<date>_<camera>.toml."""
    return folder / f"calibration_{utc_now():%Y-%m-%d}_{calibration.camera}.toml"


def _watch(samples: list[AngleSample], t0_s: float, t1_s: float) -> SwingRecord:
    rows = [
        (a.t_valid_ns * 1e-9, a.raw_rad, a.platform_m, a.pivot_miss_px)
        for a in samples
        if t0_s <= a.t_valid_ns * 1e-9 <= t1_s
    ]
    t, raw, platform, miss = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return SwingRecord(t_s=t, raw_rad=raw, platform_m=platform, pivot_miss_px=miss)
