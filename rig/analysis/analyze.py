"""From a log to a Summary. What cannot be said is None; why a run is doubtful or bad is said in words."""

from __future__ import annotations

import math
from collections import Counter
from contextlib import suppress
from pathlib import Path

import numpy as np

from comms.records import LinkRow
from rig.analysis.identify.decay import (
    DecayFit,
    cable_length_m,
    cable_length_sigma_m,
    fit_decay,
    identifiable,
)
from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.latency import alignment_s, command_latency_s, swing_error_rms_rad
from rig.analysis.identify.swing import initial_swing_rad, peak_swing_rad, residual_amplitude_rad
from rig.analysis.run_log import RunLog
from rig.analysis.summary import (
    Latency,
    Lateness,
    LinkSummary,
    Planned,
    Quantities,
    Summary,
    SwingError,
)

LATE_NS = 30_000_000  # a reference accepted later than this after its target missed its window
MIN_VALID = 0.95  # share of frames that must give an angle
MAX_LATE = 0.01  # share of late references
MAX_SWING_ERROR_RAD = 0.5e-3  # rms against the truth of a simulated bench, outside the move


class RunAnalysis:
    """A log, its summary and the fit behind it; what the report draws."""

    def __init__(self, path: Path) -> None:
        """Raises LogError when path is no run of ours."""
        self.run = RunLog.open(path)
        self.fit, self.fit_failure = _fit(self.run)
        self.summary = _summary(self.run, self.fit, self.fit_failure)


def _fit(run: RunLog) -> tuple[DecayFit | None, str]:
    if run.t_start_s is None:
        return None, "the run never started"
    rate_hz = run.facts.rate_hz
    if rate_hz == 0:
        return None, "run without a camera"
    t, angle, _ = run.swing
    after = t >= run.t_settled_s
    frames = run.facts.average_frames
    try:
        return fit_decay(
            t[after], angle[after], average_frames=frames, frame_period_s=1.0 / rate_hz
        ), ""
    except AnalysisError as error:
        return None, str(error)


def _summary(run: RunLog, fit: DecayFit | None, fit_failure: str) -> Summary:
    start, stop = run.log.metadata["run.start"], run.log.metadata.get("run.stop", {})
    measured, sigma = _measured(run, fit)
    looked = [a for a in run.angles if a.t_valid_ns * 1e-9 >= (run.t_start_s or 0.0)]
    summary = Summary(
        run_id=start["run_id"],
        run_dir=str(run.folder),
        mode=start["mode"],
        experiment=start["experiment"],
        exit_status=stop.get("exit_status", "bad_data"),
        exit_code=int(stop.get("exit_code", 6)),
        verdict="good",
        reasons=[line for line in stop.get("reasons", "").splitlines() if line],
        planner=run.plan.planner,
        move_m=run.plan.distance_m,
        move_time_s=run.plan.time_s,
        measured=measured,
        sigma=sigma,
        truth=_truth(run),
        planned=_planned(run),
        latency_ms=_latency(run),
        links={name: _link(row) for name, row in run.links().items()},
        digest=stop.get("digest") or None,
        initial_swing_rad=_initial_swing(run),
        swing_error=_swing_error(run),
        lateness=_lateness(run),
        frames=len(looked),
        angles_valid=sum(a.valid for a in looked),
        refusals=dict(Counter(a.reason.value for a in looked if not a.valid)),
        swing_fit_rms_rad=fit.residual_rms_rad if fit else None,
        complete=run.log.complete,
        loop_s=_number(stop.get("loop_s")),
        cpu_share={name: float(share) for name, share in _pairs(stop, "cpu_share")},
        scheduling=dict(_pairs(stop, "scheduling")),
        events=[f"{e.t_ns * 1e-9:8.3f} s  {e.level}: {e.text}" for e in run.events()],
    )
    _judge(summary, run, fit_failure)
    return summary


def _measured(run: RunLog, fit: DecayFit | None) -> tuple[Quantities, Quantities]:
    measured, sigma = Quantities(), Quantities()
    t, angle, sigma_rad = run.single_frames
    if run.t_start_s is not None and t.size:
        with suppress(AnalysisError):
            measured.peak_swing_rad = peak_swing_rad(t, angle, *_swing_window(run))
            sigma.peak_swing_rad = float(np.median(sigma_rad))
    if fit is None or not math.isfinite(fit.sigma_amplitude_rad):
        return measured, sigma
    g = run.facts.gravity_m_s2
    length = cable_length_m(fit.natural_frequency_hz, g)
    sigma_length = cable_length_sigma_m(fit.natural_frequency_hz, fit.sigma_natural_frequency_hz, g)
    found = {
        "residual_swing_rad": (
            float(fit.amplitude_at(np.array(run.t_settled_s))),
            fit.sigma_amplitude_rad,
        ),
        "natural_frequency_hz": (fit.natural_frequency_hz, fit.sigma_natural_frequency_hz),
        "damping_ratio": (fit.damping_ratio, fit.sigma_damping_ratio),
        "cable_length_m": (length, sigma_length),
    }
    for name, (value, deviation) in found.items():
        setattr(sigma, name, deviation)
        if identifiable(value, deviation):
            setattr(measured, name, value)
    return measured, sigma


def _swing_window(run: RunLog) -> tuple[float, float]:
    """When the peak swing is looked for: the move until settled, or all of a free decay."""
    if run.plan.time_s > 0:
        return run.t_move_s, run.t_settled_s
    return run.t_move_s, run.t_move_s + run.plan.watch_s


def _truth(run: RunLog) -> Quantities | None:
    omega = run.true_omega_rad_s
    if omega is None:
        return None
    load = run.world["pendulum"]
    truth = Quantities(
        natural_frequency_hz=omega / (2 * math.pi),
        damping_ratio=load["damping_ratio"],
        cable_length_m=load["length_m"],
    )
    t, angle, rate, _ = run.truth.T
    if run.t_start_s is not None and t.size > 1 and t[-1] >= run.t_settled_s:
        from scipy.interpolate import CubicHermiteSpline

        t0, t1 = _swing_window(run)
        curve = CubicHermiteSpline(t, angle, rate)
        at = float(run.t_settled_s)
        truth.residual_swing_rad = residual_amplitude_rad(
            float(curve(at)), float(curve(at, 1)), omega
        )
        truth.peak_swing_rad = peak_swing_rad(t, angle, t0, t1)
    return truth


def _planned(run: RunLog) -> Planned:
    metrics = run.plan.metrics or {}
    return Planned(
        peak_swing_rad=metrics.get("peak_swing_rad"),
        residual_swing_rad=metrics.get("residual_swing_nonlinear_rad"),
    )


def _latency(run: RunLog) -> Latency:
    latency = Latency()
    if run.t_start_s is None:
        return latency
    _, _, t, actual = run.robot.T
    keep = np.concatenate([[True], np.diff(t) > 0]) if t.size else np.zeros(0, dtype=bool)
    if run.plan.time_s > 0 and keep.sum() > 10:
        latency.command = _ms(command_latency_s(t[keep], actual[keep], run.planned_m))
    arrival = run.receipts("angle")
    late = [
        (arrival[a.seq] - a.t_valid_ns) * 1e-6 for a in run.angles if a.valid and a.seq in arrival
    ]
    latency.vision = float(np.median(late)) if late else None
    hop = _exposure_to_angle_ms(run, arrival)
    latency.exposure_to_angle_p99 = float(np.percentile(hop, 99)) if hop else None
    t_seen, _, _ = run.swing
    if run.truth.size and t_seen.size and t_seen[-1] > run.t_settled_s:
        with suppress(AnalysisError):
            latency.alignment = _ms(alignment_s(*run.swing[:2], *run.truth.T[:3]))
    return latency


def _exposure_to_angle_ms(run: RunLog, arrival: dict[int, int]) -> list[float]:
    """End of exposure to the angle's arrival; vision answers each delivered frame, in order, with one angle."""
    delivered = sorted(run.receipts("frame").items(), key=lambda item: item[1])
    frames = run.frames
    return [
        (arrival[k] - frames[seq].t_ns) * 1e-6
        for k, (seq, _) in enumerate(delivered)
        if k in arrival and seq in frames
    ]


def _swing_error(run: RunLog) -> SwingError:
    """Measured against true angle, at the stamps as they are."""
    error = SwingError()
    if run.truth.size == 0 or run.t_start_s is None:
        return error
    t, angle, _ = run.swing
    inside = (t >= run.t_move_s) & (t <= run.t_settled_s) & (run.plan.time_s > 0)
    for name, keep in (
        ("during_move_rad", inside),
        ("outside_move_rad", ~inside & (t >= run.t_start_s)),
    ):
        with suppress(AnalysisError):
            setattr(error, name, swing_error_rms_rad(t[keep], angle[keep], *run.truth.T[:3]))
    return error


def _initial_swing(run: RunLog) -> float | None:
    if run.t_start_s is None or run.plan.time_s == 0:
        return None
    t, angle, _ = run.swing
    quiet = (t >= run.t_start_s) & (t < run.t_move_s)
    try:
        return initial_swing_rad(
            t[quiet], angle[quiet], math.sqrt(run.facts.gravity_m_s2 / run.facts.cable_length_m)
        )
    except AnalysisError:
        return None


def _lateness(run: RunLog) -> Lateness:
    arrival = run.receipts("reference")
    late = np.array(
        [arrival[r.seq] - r.t_target_ns for r in run.references() if r.seq in arrival],
        dtype=np.float64,
    )
    lateness = Lateness(
        late_ticks=run.late_ticks(),
        references=late.size,
        references_late=int((late > LATE_NS).sum()),
    )
    if late.size:
        lateness.reference_p99_ms = float(np.percentile(late, 99)) * 1e-6
        lateness.reference_max_ms = float(late.max()) * 1e-6
    return lateness


def _link(row: LinkRow) -> LinkSummary:
    c = row.count
    return LinkSummary(
        sent=c.sent,
        delivered=c.delivered,
        lost=c.lost,
        duplicated=c.duplicated,
        late=c.late,
        rejected=c.rejected,
        lost_link=c.lost_link,
        lost_kernel=c.lost_kernel,
        lost_queue=c.lost_queue,
        unexplained=c.unaccounted,
    )


def _judge(s: Summary, run: RunLog, fit_failure: str) -> None:
    """bad: the run did not end as asked, or says nothing; doubtful: it did, with something to explain."""
    bad = (
        [f"the log is incomplete: {run.log.damage}; what is left was analysed"]
        if not s.complete
        else []
    )
    if s.exit_status != "ok":
        bad += [] if s.reasons or bad else [f"the run ended with exit status '{s.exit_status}'"]
    elif run.facts.rate_hz and fit_failure:
        bad.append(f"no swing could be fitted: {fit_failure}")
    doubts = _doubts(s, run)
    if bad or s.exit_status != "ok":
        s.verdict = "bad"
        s.exit_status = "bad_data" if s.exit_status == "ok" else s.exit_status
    elif doubts:
        s.verdict = "doubtful"
    if s.exit_code == 0 and s.verdict != "good":
        s.exit_code = 6
    s.reasons += bad + doubts


def _doubts(s: Summary, run: RunLog) -> list[str]:
    doubts = [
        f"link '{n}': {row.unexplained} packets unexplained"
        for n, row in s.links.items()
        if row.unexplained
    ]
    doubts += [
        f"link '{n}': {row.lost_kernel} lost by the kernel"
        for n, row in s.links.items()
        if row.lost_kernel
    ]
    if s.frames and s.angles_valid < MIN_VALID * s.frames:
        why = ", ".join(f"{reason} {n}" for reason, n in sorted(s.refusals.items()))
        doubts.append(
            f"{s.angles_valid} of {s.frames} frames gave an angle ({why}); must be >= {MIN_VALID:.0%}"
        )
    doubts += [f"no count from {end}: its packets cannot be balanced" for end in run.uncounted]
    late = s.lateness
    if (
        late.references_late > MAX_LATE * late.references
        and run.facts.reference_delay_ms * 1e6 < LATE_NS
    ):
        doubts.append(
            f"{late.references_late} of {late.references} references accepted > 30 ms late: the machine is too busy"
        )
    error = s.swing_error.outside_move_rad
    if error is not None and error > MAX_SWING_ERROR_RAD:
        bound = MAX_SWING_ERROR_RAD * 1e3
        doubts.append(
            f"measured swing is {error * 1e3:.2f} mrad rms off the truth; must be <= {bound} mrad: calibrate again"
        )
    return doubts


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else seconds * 1e3


def _pairs(metadata: dict[str, str], key: str) -> list[tuple[str, str]]:
    return [
        (name, value)
        for name, _, value in (word.partition("=") for word in metadata.get(key, "").split())
    ]


def _number(text: str | None) -> float | None:
    return float(text) if text else None
