"""One run of the study: an experiment in virtual time, its figures and its curves."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from planners.models.chain import ChainModel
from rig.analysis.analyze import RunAnalysis
from rig.analysis.run_log import RunLog
from rig.analysis.summary import Quantities, Summary
from rig.analysis.true_load import true_motion
from rig.errors import RunFailed
from rig.run import config
from rig.run.calibration import file as calibration_file
from rig.run.calibration.expected_pivot import expected_pivot
from rig.run.cameras import cameras
from rig.run.config import CameraSection, Experiment
from rig.run.job import plan_move, prepare
from rig.run.load_model import planner_model
from rig.run.runs import LOG
from rig.run.runtime import bench
from rig.run.runtime.execute import execute
from rig.studies.source_004.free_modes import natural_frequencies_hz
from rig.studies.source_004.measured_modes import fit_modes, largest_link_swing
from rig.studies.source_004.rule import BasisValue, RunFigures
from rig.studies.source_004.spec import CAMERA_QUANTITIES, MEASURED

FloatArray = npt.NDArray[np.float64]
BEFORE_S = 0.2  # of the curves, before the move
ROWS_OVER_JOINT = 5  # left out over the joint of the first link, which rises as it swings
AFTER_S = 3.0  # after it: one and a half periods of the load


class RunCurves(NamedTuple):
    """Curves of a run, from shortly before its move; times count from the start of the move."""

    t_s: FloatArray  # (N,)
    swing_rad: FloatArray  # (N,) true, of the lowest link, along x
    position_m: FloatArray  # (N,) of the platform, true
    move_s: float  # duration of the move; 0 of a free swing


class RepeatedRun(NamedTuple):
    """Figures and curves of one experiment."""

    figures: RunFigures
    curves: RunCurves


def repeat(experiment: str, folder: Path) -> RepeatedRun:
    """Run a shipped experiment in virtual time and analyse it; the log is left in folder.

    A load of several links, which is judged by the truth in a run, is watched by the camera, too.
    experiment: NAME, or NAME:SEED for another seed than that of the file. Raises RunFailed for a
    run that was stopped, and what keeps a run from starting.
    """
    name, _, seed = experiment.partition(":")
    changes = [f"experiment.seed={seed}"] if seed else []
    chosen = _watched(config.read_experiment(name, changes))
    job = prepare(chosen, plan_move(chosen), bench.plant(chosen))
    outcome = execute(job, "virtual", folder, _no_progress)
    if outcome.exit_code != 0:
        raise RunFailed(f"{experiment} was stopped: {'; '.join(outcome.reasons)}")
    analysis = RunAnalysis(folder / LOG)
    values = _values(analysis)
    if planner_model(chosen).links_count > 1:
        _measure_links(values, analysis.run, chosen)
    figures = RunFigures(experiment=experiment, values=values)
    return RepeatedRun(figures, _curves(analysis.run))


def _no_progress(t_ns: int, operator: Any) -> None:
    """Show nothing: a run takes about a second."""


def _values(analysis: RunAnalysis) -> dict[str, dict[str, BasisValue]]:
    """Collect the values of every quantity of the spec."""
    s = analysis.summary
    metrics = analysis.run.plan.metrics or {}
    lag_ms = s.latency_ms.command
    return {
        "residual_swing": _swing(s, "residual_swing_rad"),
        "peak_swing": _swing(s, "peak_swing_rad"),
        "acceleration": {
            "planned": BasisValue(value=metrics.get("peak_acceleration_m_s2")),
            "reached": BasisValue(value=s.motion.reached_acceleration_m_s2),
        },
        "speed": {"reached": BasisValue(value=s.motion.reached_speed_m_s)},
        "reversal": {"reached": BasisValue(value=_reversal_m(analysis.run))},
        "command_lag": {"measured": BasisValue(value=None if lag_ms is None else lag_ms * 1e-3)},
        "tracking_swing": _tracking_swing(s),
        "cable_length": _measured(s, "cable_length_m"),
        "damping_ratio": _measured(s, "damping_ratio"),
        "natural_frequency": _measured(s, "natural_frequency_hz", 2 * math.pi),
        **_mode_frequencies(analysis.run),
    }


def _watched(chosen: Experiment) -> Experiment:
    """Watch a load of several links by the camera, in the rows of its first link alone."""
    model = planner_model(chosen)
    if not isinstance(model, ChainModel) or model.links_count == 1:
        return chosen
    with_camera = msgspec.structs.replace(chosen, camera=CameraSection())
    camera = cameras(with_camera)[0]
    _, calibration = calibration_file.find(with_camera, camera)
    pivot = expected_pivot(camera, calibration, None)
    joint_row = pivot.home_px[1] + pivot.pixels_per_m * model.links[0].length_m
    rows = math.floor(joint_row) - ROWS_OVER_JOINT
    vision = msgspec.structs.replace(with_camera.vision, rows=rows)
    return msgspec.structs.replace(with_camera, vision=vision)


def _measure_links(
    values: dict[str, dict[str, BasisValue]], run: RunLog, chosen: Experiment
) -> None:
    """Replace what the camera measured of a cable by what it tells of several links.

    The free swing of the first link shows the modes, and the model how the others move in them.
    The peak swing, of the lowest link as a rule, is not in these rows.
    """
    for quantity in CAMERA_QUANTITIES:
        values.get(quantity, {}).pop(MEASURED, None)
    modes = planner_model(chosen).modes()
    eigenvalues = modes.eigenvalues_1_s
    pairs = [k for k in np.argsort(np.abs(eigenvalues)) if eigenvalues[k].imag > 0.0]
    model_hz = (np.abs(eigenvalues[pairs]) / (2.0 * math.pi)).tolist()
    swing = run.single_frames
    after = swing.t_s >= run.t_settled_s
    t_s = swing.t_s[after] - run.t_settled_s
    found = fit_modes(t_s, swing.angle_rad[after], model_hz)
    if not found:
        return
    links = planner_model(chosen).links_count
    residual_rad, sigma_rad = largest_link_swing(found, np.abs(modes.mode_shapes[:links, pairs]))
    values["residual_swing"][MEASURED] = BasisValue(value=residual_rad, sigma=sigma_rad)
    for name, mode in zip(("frequency_1", "frequency_2"), found, strict=False):
        if mode.frequency_hz is not None:
            measured = BasisValue(value=mode.frequency_hz, sigma=mode.sigma_frequency_hz)
            values[name][MEASURED] = measured


def _mode_frequencies(run: RunLog) -> dict[str, dict[str, BasisValue]]:
    """Fit the two slowest modes of a load of several links to its true swing after the move."""
    motion = true_motion(run)
    if motion.angles_rad.shape[1] < 2:
        return {}
    free = motion.t_s >= run.t_settled_s
    angles_rad = motion.angles_rad[free, :, 0]
    rates_rad_s = motion.rates_rad_s[free, :, 0]
    found = natural_frequencies_hz(motion.t_s[free], angles_rad, rates_rad_s)
    names = ("frequency_1", "frequency_2")
    return {name: {"true": BasisValue(value=hz)} for name, hz in zip(names, found, strict=False)}


def _swing(s: Summary, key: str) -> dict[str, BasisValue]:
    true = getattr(s.truth or Quantities(), key)
    return {"true": BasisValue(value=true), **_measured(s, key)}


def _measured(s: Summary, key: str, factor: float = 1.0) -> dict[str, BasisValue]:
    value = getattr(s.measured, key)
    sigma = getattr(s.sigma, key) or 0.0
    if value is None:
        return {"measured": BasisValue(value=None, sigma=sigma * factor)}
    return {"measured": BasisValue(value=value * factor, sigma=sigma * factor)}


def _tracking_swing(s: Summary) -> dict[str, BasisValue]:
    """Subtract the residual swing that the plan predicts on the nonlinear cable of the model."""
    planned = s.planned.residual_swing_rad
    found = {}
    for basis, residual in _swing(s, "residual_swing_rad").items():
        value = None
        if planned is not None and residual.value is not None:
            value = residual.value - planned
        found[basis] = BasisValue(value=value, sigma=residual.sigma)
    return found


def _reversal_m(run: RunLog) -> float | None:
    """Find the smaller of the excursions beyond goal and start [m]; None without a move."""
    if run.plan.time_s == 0:
        return None
    x = run.robot[:, 3]
    start, goal = x[0], x[0] + run.plan.distance_m
    return float(min(x.max() - max(start, goal), min(start, goal) - x.min()))


def _curves(run: RunLog) -> RunCurves:
    t, _, _, position = run.truth.T
    angle = true_motion(run).angles_rad[:, -1, 0]
    from_move_s = t - run.t_move_s
    end_s = (run.plan.time_s or run.plan.watch_s) + AFTER_S
    shown = (from_move_s >= -BEFORE_S) & (from_move_s <= end_s)
    return RunCurves(from_move_s[shown], angle[shown], position[shown], run.plan.time_s)
