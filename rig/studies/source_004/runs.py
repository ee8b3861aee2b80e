"""One run of the study: an experiment in virtual time, its figures and its curves."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.analyze import RunAnalysis
from rig.analysis.run_log import RunLog
from rig.analysis.summary import Quantities, Summary
from rig.analysis.true_load import true_motion
from rig.errors import RunFailed
from rig.run import config
from rig.run.job import plan_move, prepare
from rig.run.runs import LOG
from rig.run.runtime import bench
from rig.run.runtime.execute import execute
from rig.studies.source_004.free_modes import natural_frequencies_hz
from rig.studies.source_004.rule import BasisValue, RunFigures
from rig.studies.source_004.spec import CAMERA_QUANTITIES, MEASURED

FloatArray = npt.NDArray[np.float64]
BEFORE_S = 0.2  # of the curves, before the move
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

    experiment: NAME, or NAME:SEED for another seed than that of the file. Raises RunFailed for a
    run that was stopped, and what keeps a run from starting.
    """
    name, _, seed = experiment.partition(":")
    changes = [f"experiment.seed={seed}"] if seed else []
    chosen = config.read_experiment(name, changes)
    job = prepare(chosen, plan_move(chosen), bench.plant(chosen))
    outcome = execute(job, "virtual", folder, _no_progress)
    if outcome.exit_code != 0:
        raise RunFailed(f"{experiment} was stopped: {'; '.join(outcome.reasons)}")
    analysis = RunAnalysis(folder / LOG)
    has_camera = chosen.camera.rate_hz > 0
    values = _values(analysis)
    if not has_camera:
        _drop_measured(values)
    figures = RunFigures(experiment=experiment, values=values, has_camera=has_camera)
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


def _drop_measured(values: dict[str, dict[str, BasisValue]]) -> None:
    """Remove the values that come from the camera."""
    for quantity in CAMERA_QUANTITIES:
        values.get(quantity, {}).pop(MEASURED, None)


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
