"""Analysis of a log: summary of the run, and the fit behind it.

A value that cannot be determined is None. A verdict other than good has its reasons in words.
"""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path

from comms.messages import AngleSample
from comms.records import LinkRow
from rig.analysis import delays, quantities, verdict
from rig.analysis.across import across
from rig.analysis.field_bus import field_bus
from rig.analysis.identified_swing import chain_modes
from rig.analysis.identify.decay import DecayFit, fit_decay
from rig.analysis.identify.errors import AnalysisError
from rig.analysis.joint import joint_run
from rig.analysis.motion import motion_peaks
from rig.analysis.run_log import RunLog
from rig.analysis.summary import LinkSummary, Summary
from rig.analysis.uncertainty import total


class RunAnalysis:
    """A log, its summary and the fit behind it; input of the report."""

    def __init__(self, path: Path, running_s: float | None = None) -> None:
        """running_s: duration so far of a run that goes on; None for one that has ended.

        Raises LogError when path is not the log of a run.
        """
        self.run = RunLog.open(path)
        self.fit, self.fit_failure = _fit(self.run)
        self.joint = joint_run(self.run)
        self.summary = _summary(self.run, self.fit)
        if self.joint is not None:
            self.summary.joint = self.joint.figures
        self.summary.running_s = running_s
        verdict.add_verdict(self.summary, self.run, self.fit_failure)


def _fit(run: RunLog) -> tuple[DecayFit | None, str]:
    """Fit the swing after the move; the text is the reason where there is no fit."""
    if run.t_start_s is None:
        return None, "the run never started"
    rate_hz = run.facts.rate_hz
    if rate_hz == 0:
        return None, "run without a camera"
    t, angle, _ = run.swing
    after = t >= run.t_settled_s
    frames = run.facts.average_frames
    try:
        fit = fit_decay(t[after], angle[after], average_frames=frames, frame_period_s=1.0 / rate_hz)
    except AnalysisError as error:
        return None, str(error)
    return fit, ""


def _summary(run: RunLog, fit: DecayFit | None) -> Summary:
    """Summarise a run, with the verdict good."""
    start = run.log.metadata["run.start"]
    stop = run.log.metadata.get("run.stop", {})
    measured, noise, budget = quantities.measured_quantities(run, fit)
    angles = _angles_after_start(run)
    return Summary(
        run_id=start["run_id"],
        run_dir=str(run.folder),
        mode=start["mode"],
        experiment=start["experiment"],
        exit_status=stop.get("exit_status", "bad_data"),
        exit_code=_exit_code(stop),
        verdict="good",
        reasons=[line for line in stop.get("reasons", "").splitlines() if line],
        planner=run.plan.planner,
        move_m=run.plan.distance_m,
        move_time_s=run.plan.time_s,
        measured=measured,
        sigma=total(budget),
        sigma_noise=noise,
        budget=budget,
        modes=chain_modes(run),
        truth=quantities.true_quantities(run),
        planned=quantities.planned_quantities(run),
        latency_ms=delays.latency(run),
        links={name: _link(row) for name, row in run.links().items()},
        digest=stop.get("digest") or None,
        settling_s=quantities.settling(run),
        initial_swing_rad=quantities.initial_swing(run),
        swing_error=quantities.swing_error(run),
        lateness=delays.lateness(run),
        motion=motion_peaks(run),
        across=across(run),
        field_bus=field_bus(run),
        move_deg=None if run.plan.angle_rad is None else math.degrees(run.plan.angle_rad),
        frames=len(angles),
        angles_valid=sum(a.valid for a in angles),
        refusals=dict(Counter(a.reason.value for a in angles if not a.valid)),
        swing_fit_rms_rad=fit.residual_rms_rad if fit else None,
        complete=run.log.complete,
        loop_s=_number(stop.get("loop_s")),
        cpu_share=_shares(stop),
        scheduling=dict(_pairs(stop, "scheduling")),
        events=[f"{e.t_ns * 1e-9:8.3f} s  {e.level}: {e.text}" for e in run.events()],
    )


def _angles_after_start(run: RunLog) -> list[AngleSample]:
    """Select the angle samples of the run proper; all of them when it never started."""
    t_start_s = run.t_start_s or 0.0
    return [a for a in run.angles if a.t_valid_ns * 1e-9 >= t_start_s]


def _link(row: LinkRow) -> LinkSummary:
    count = row.count
    return LinkSummary(
        sent=count.sent,
        delivered=count.delivered,
        lost=count.lost,
        duplicated=count.duplicated,
        late=count.late,
        superseded=count.superseded,
        foreign=count.foreign,
        rejected=count.rejected,
        lost_link=count.lost_link,
        lost_kernel=count.lost_kernel,
        lost_queue=count.lost_queue,
        unexplained=count.unaccounted,
    )


def _pairs(metadata: dict[str, str], key: str) -> list[tuple[str, str]]:
    """Split a metadata text "name=value name=value"."""
    pairs = []
    for word in metadata.get(key, "").split():
        name, _, value = word.partition("=")
        pairs.append((name, value))
    return pairs


def _exit_code(stop: dict[str, str]) -> int:
    """Read the exit code; that of bad data where it is missing or no number."""
    text = stop.get("exit_code", "")
    return int(text) if text.isdecimal() else verdict.BAD_DATA_CODE


def _shares(stop: dict[str, str]) -> dict[str, float]:
    """Read the CPU shares by process, those that are numbers."""
    shares = {}
    for name, text in _pairs(stop, "cpu_share"):
        share = _number(text)
        if share is not None:
            shares[name] = share
    return shares


def _number(text: str | None) -> float | None:
    """Read a number; None where it is missing or no number."""
    try:
        return float(text or "")
    except ValueError:
        return None
