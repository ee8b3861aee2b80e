"""Calibration tour: drive to points without residual swing, watch two periods at each, and fit."""

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
from rig.run.calibration import camera_file
from rig.run.calibration.expected_pivot import expected_pivot
from rig.run.calibration.file import Calibration
from rig.run.calibration.static_scene import is_before_structure
from rig.run.cameras import cameras
from rig.run.config import Experiment
from rig.run.load_model import planner_model
from vision.static_scene import StaticScene

POINTS_M = (-0.2, -0.1, 0.0, 0.1, 0.2)
MOVE_TIME_S = 2.0  # from point to point
WATCHED_PERIODS = 2.0  # at each point
PICTURES_HZ = 2.0  # in the log, at least: the static scene is taken from them
MIN_CLEAR_SHARE = 0.5  # of the angles at a point; fewer, and it is left out


class Tour(NamedTuple):
    """Motion through the points.

    dwells_s: (from, to) at each point [s], counted from the start of the move.
    """

    motion: Motion
    dwells_s: list[tuple[float, float]]


def experiment_for(base: Experiment) -> Experiment:
    """Change an experiment for the tour: no offset table, no average, a wider initial swing.

    A camera file stays: the table has what it leaves. The log has pictures in any case.
    """
    replace = msgspec.structs.replace
    beliefs = [replace(belief, calibration="none") for belief in base.vision.cameras]
    vision = replace(base.vision, calibration="none", average_frames=1, cameras=beliefs)
    return replace(
        base,
        experiment=replace(
            base.experiment, name="calibrate", kind="free_decay", quiet_s=0.5, watch_s=0.5
        ),
        vision=vision,
        safety=replace(base.safety, initial_swing_rad=0.1),
        record=replace(base.record, pictures_hz=max(base.record.pictures_hz, PICTURES_HZ)),
    )


def tour(experiment: Experiment, points_m: tuple[float, ...] = POINTS_M) -> Tour:
    """Plan from the start through the points and back, each move without residual swing."""
    e = experiment
    model = planner_model(e)
    dwell_s = SETTLE_S + WATCHED_PERIODS * 2 * math.pi / model.natural_frequency_rad_s
    position_m = e.move.start_m
    path = Trajectory.hold(e.move.start_m, 0.01)
    dwells_s = []
    for point in (*points_m, e.move.start_m):
        if point != position_m:
            distance_m = point - position_m
            move = Problem(
                start_m=position_m, distance_m=distance_m, time_s=MOVE_TIME_S, model=model
            )
            path = path.then(catalog.plan(e.experiment.planner, move).motion.x)
            position_m = point
        dwells_s.append((path.duration_s + SETTLE_S, path.duration_s + dwell_s))
        path = path.then(Trajectory.hold(point, dwell_s))
    return Tour(Motion.along("x", path), dwells_s[:-1])  # the last one is the return to the start


def fit(
    run: RunLog,
    experiment: Experiment,
    dwells_s: list[tuple[float, float]],
    scene: StaticScene | None = None,
) -> tuple[OffsetCalibration, Calibration]:
    """Fit the calibration of the first camera to the log of a tour.

    scene: what never moves. A point at which the cable hangs before a static line is left out: the
    tracker, which knew no scene, cannot tell them apart. Raises AnalysisError for a point with too
    few valid frames, and where no two points are left.
    """
    camera = cameras(experiment)[0]
    file = camera_file.find(experiment, camera)
    expected = expected_pivot(camera, None, file)
    samples = [a for a in run.angles if a.valid]
    records = []
    for t0_s, t1_s in dwells_s:
        watched = _within(samples, run.t_move_s + t0_s, run.t_move_s + t1_s)
        clear = watched
        if scene is not None:
            clear = [a for a in watched if not is_before_structure(a, scene)]
        if len(clear) >= MIN_CLEAR_SHARE * len(watched):
            records.append(_record(clear))
    found = calibrate_offsets(
        records,
        pivot_home_px=expected.home_px,
        pixels_per_m=expected.pixels_per_m,
        natural_frequency_hz=planner_model(experiment).natural_frequency_rad_s / (2 * math.pi),
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
        background=round(float(np.median([a.background for a in samples])), 2),
        camera_made=file.made if file else None,
    )
    return found, calibration


def default_path(folder: Path, calibration: Calibration) -> Path:
    """Name the file calibration_<date>_<camera>.toml in folder."""
    return folder / f"calibration_{utc_now():%Y-%m-%d}_{calibration.camera}.toml"


def _within(samples: list[AngleSample], t0_s: float, t1_s: float) -> list[AngleSample]:
    """Select the samples stamped within [t0_s, t1_s]."""
    return [a for a in samples if t0_s <= a.t_valid_ns * 1e-9 <= t1_s]


def _record(samples: list[AngleSample]) -> SwingRecord:
    rows = [
        (a.t_valid_ns * 1e-9, a.cable.angle_rad, a.platform_m, a.pivot_miss_px)
        for a in samples
        if a.cable is not None
    ]
    t, raw, platform, miss = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return SwingRecord(t_s=t, raw_rad=raw, platform_m=platform, pivot_miss_px=miss)
