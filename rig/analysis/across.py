"""Swing across the plane of the move, as the camera of the other plane saw it."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from rig.analysis.identify.decay import fit_decay, is_identifiable
from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.swing import peak_swing_rad
from rig.analysis.run_log import RunLog
from rig.analysis.seen_swing import SeenSwing
from rig.analysis.summary import Across
from rig.analysis.true_load import true_amplitude_rad, true_motion


def across(run: RunLog) -> Across | None:
    """Compute peak and residual swing across; None without a camera that sees it."""
    camera = run.across_camera
    if camera is None or run.t_start_s is None:
        return None
    found = Across(camera=camera)
    _add_measured(found, run, camera)
    _add_true(found, run)
    return found


def _add_measured(found: Across, run: RunLog, camera: int) -> None:
    t_start_s = run.t_start_s or 0.0
    samples = [a for a in run.angles_of(camera) if a.t_valid_ns * 1e-9 >= t_start_s]
    found.frames = len(samples)
    found.angles_valid = sum(a.valid for a in samples)
    frames = run.facts.average_frames
    single = run.single_frames_of(camera)
    started = single.t_s >= t_start_s
    single = SeenSwing(*(column[started] for column in single))
    with suppress(AnalysisError):
        found.peak_rad = peak_swing_rad(single.t_s, single.angle_rad, *run.swing_window_s)
        found.sigma_peak_rad = float(np.median(single.sigma_rad))
    mean = run.swing_of(camera)
    after = mean.t_s >= run.t_settled_s
    period_s = 1.0 / run.facts.rate_of(camera)
    with suppress(AnalysisError):
        fit = fit_decay(
            mean.t_s[after],
            mean.angle_rad[after],
            average_frames=frames,
            frame_period_s=period_s,
        )
        residual_rad = float(fit.amplitude_at(np.array(run.t_settled_s)))
        found.sigma_residual_rad = fit.sigma_amplitude_rad
        if is_identifiable(residual_rad, fit.sigma_amplitude_rad):
            found.residual_rad = residual_rad


def _add_true(found: Across, run: RunLog) -> None:
    motion = true_motion(run)
    plane = 1 - run.main_plane
    t_s = motion.t_s
    first_s, last_s = run.swing_window_s
    shown = (t_s >= first_s) & (t_s <= last_s)
    if not shown.any():
        return
    found.true_peak_rad = float(np.abs(motion.angles_rad[shown, 0, plane]).max())
    if t_s[-1] >= run.t_settled_s:
        found.true_residual_rad = true_amplitude_rad(run, motion, plane)
