"""Delays of a run: latencies of robot and vision, and late references."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.latency import (
    TrackingError,
    alignment_s,
    alignment_sigma_s,
    tracking_error,
)
from rig.analysis.run_log import RunLog
from rig.analysis.seen_swing import is_later
from rig.analysis.summary import Latency, Lateness

MAX_REFERENCE_LATENESS_NS = 30_000_000  # a later reference has missed its window
MIN_ROBOT_STATES = 11


def latency(run: RunLog) -> Latency:
    """Compute the latencies of a run; one that cannot be computed is None."""
    found = Latency()
    if run.t_start_s is None:
        return found
    tracking = tracking_of(run)
    if tracking is not None:
        found.command = _ms(tracking.delay_s)
        found.command_sigma = _ms(tracking.sigma_delay_s)
    arrival_ns = run.receipts(f"angle_{run.main_camera}")
    ages_ms = [
        (arrival_ns[a.seq] - a.t_valid_ns) * 1e-6
        for a in run.angles
        if a.valid and a.seq in arrival_ns
    ]
    found.vision = float(np.median(ages_ms)) if ages_ms else None
    delays_ms = _exposure_to_angle_ms(run, arrival_ns)
    found.exposure_to_angle_p99 = float(np.percentile(delays_ms, 99)) if delays_ms else None
    t_angle, angle, sigma = run.swing
    if run.truth.size and t_angle.size and t_angle[-1] > run.t_settled_s:
        with suppress(AnalysisError):
            found.alignment = _ms(alignment_s(t_angle, angle, *run.truth.T[:3]))
            rate = np.interp(t_angle, run.truth[:, 0], run.truth[:, 2])
            found.alignment_sigma = _ms(alignment_sigma_s(sigma, rate))
    return found


def tracking_of(run: RunLog) -> TrackingError | None:
    """Compare the platform with the plan; None for a run without a move."""
    _, _, t, actual = run.robot.T
    keep = is_later(t)
    if run.t_start_s is None or run.plan.time_s <= 0 or keep.sum() < MIN_ROBOT_STATES:
        return None
    return tracking_error(t[keep], actual[keep], run.planned_m)


def lateness(run: RunLog) -> Lateness:
    """Count the late ticks and the references accepted after their target."""
    arrival_ns = run.receipts("reference")
    accepted = [reference for reference in run.references() if reference.seq in arrival_ns]
    late_ns = np.array([arrival_ns[r.seq] - r.t_target_ns for r in accepted], dtype=np.float64)
    found = Lateness(
        late_ticks=run.late_ticks(),
        references=late_ns.size,
        references_late=int((late_ns > MAX_REFERENCE_LATENESS_NS).sum()),
    )
    if late_ns.size:
        found.reference_p99_ms = float(np.percentile(late_ns, 99)) * 1e-6
        found.reference_max_ms = float(late_ns.max()) * 1e-6
    return found


def _exposure_to_angle_ms(run: RunLog, arrival_ns: dict[int, int]) -> list[float]:
    """Compute the delays from end of exposure to arrival of the angle [ms].

    The vision task answers each delivered frame, in order, with one angle.
    """
    delivered = sorted(run.receipts(f"frame_{run.main_camera}").items(), key=lambda item: item[1])
    frames = run.frames
    return [
        (arrival_ns[k] - frames[seq].t_ns) * 1e-6
        for k, (seq, _) in enumerate(delivered)
        if k in arrival_ns and seq in frames
    ]


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else seconds * 1e3
