"""Verdict on a run, with its reasons."""

from __future__ import annotations

import numpy as np

from rig.analysis.delays import MAX_REFERENCE_LATENESS_NS
from rig.analysis.quantities import peak_gap_s
from rig.analysis.run_log import RunLog
from rig.analysis.summary import Across, Summary
from rig.analysis.true_load import pushed_after, true_motion

MIN_VALID_SHARE = 0.95  # of the frames, that must give an angle
MAX_LATE_SHARE = 0.01  # of the references
MAX_SWING_ERROR_RAD = 0.5e-3  # rms against the truth of a simulated plant, outside the move
MAX_ACROSS_RAD = 0.5e-3  # swing across the plane of the camera
NEGATIVE_SIGMAS = 5.0
BAD_DATA_CODE = 6


def add_verdict(summary: Summary, run: RunLog, fit_failure: str) -> None:
    """Set verdict, exit status and reasons of a summary.

    bad: the run did not end in order, or its data are insufficient. doubtful: it did, with reasons
    to doubt the numbers.
    """
    bad = _defects(summary, run, fit_failure)
    doubts = _doubts(summary, run)
    if bad or summary.exit_status != "ok":
        summary.verdict = "bad"
        if summary.exit_status == "ok":
            summary.exit_status = "bad_data"
    elif doubts:
        summary.verdict = "doubtful"
    if summary.exit_code == 0 and summary.verdict != "good":
        summary.exit_code = BAD_DATA_CODE
    summary.reasons += bad + doubts


def _defects(summary: Summary, run: RunLog, fit_failure: str) -> list[str]:
    """List the reasons for the verdict bad that the run itself has not given."""
    defects = []
    if summary.running_s is not None:
        return [f"still running, {summary.running_s:.0f} s so far: analysed as far as it is logged"]
    if not summary.complete:
        defects.append(f"the log is incomplete: {run.log.damage}; the rest was analysed")
    if summary.exit_status != "ok":
        if not summary.reasons and not defects:
            defects.append(f"the run ended with exit status '{summary.exit_status}'")
    elif summary.move_deg is not None and summary.joint is None:
        defects.append("the move of the joint is not in the log to its end")
    elif run.facts.rate_hz and fit_failure:
        defects.append(f"no swing could be fitted: {fit_failure}")
    return defects


def _load_doubts(summary: Summary, run: RunLog) -> list[str]:
    """List what the camera, which fits one straight cable in one plane, cannot judge."""
    if not run.facts.rate_hz:
        return []
    doubts = []
    motion = true_motion(run)
    if motion.angles_rad.shape[1] > 1:
        doubts.append(
            f"the load has {motion.angles_rad.shape[1]} links; the camera fits one straight cable: "
            "judge it by the truth, without a camera (--set camera.rate_hz=0)"
        )
    across_rad = float(np.abs(motion.angles_rad[..., 1 - run.main_plane]).max(initial=0.0))
    if across_rad > MAX_ACROSS_RAD and summary.across is None:
        doubts.append(
            f"the load swung {across_rad * 1e3:.1f} mrad across the plane that the camera sees; "
            f"must be <= {MAX_ACROSS_RAD * 1e3:g} mrad: look for what pushed it, or add a camera "
            "of the plane y"
        )
    if pushed_after(run):
        doubts.append(
            "the bench pushed the load, or changed its cable, in the time that the fit uses: put "
            "it before the end of the move"
        )
    ratio, sigma = summary.measured.damping_ratio, summary.sigma.damping_ratio
    if ratio is not None and sigma is not None and ratio < -NEGATIVE_SIGMAS * sigma:
        doubts.append(
            f"the damping ratio is {ratio:.2g}, {-ratio / sigma:.0f} standard deviations below 0: "
            "something drives the swing"
        )
    return doubts


def _frame_doubts(summary: Summary) -> list[str]:
    """List the cameras that gave too few angles."""
    doubts = []
    if summary.angles_valid < MIN_VALID_SHARE * summary.frames:
        reasons = ", ".join(f"{reason} {n}" for reason, n in sorted(summary.refusals.items()))
        doubts.append(
            f"{summary.angles_valid} of {summary.frames} frames gave an angle ({reasons}); "
            f"must be >= {MIN_VALID_SHARE:.0%}"
        )
    across = summary.across
    if across is not None and across.angles_valid < MIN_VALID_SHARE * across.frames:
        doubts.append(
            f"{across.angles_valid} of {across.frames} frames of camera {across.camera} gave an "
            f"angle; must be >= {MIN_VALID_SHARE:.0%}"
        )
    return doubts


def _doubts(summary: Summary, run: RunLog) -> list[str]:
    """List the reasons to doubt the numbers of a run."""
    doubts = []
    for name, row in summary.links.items():
        if row.unexplained:
            doubts.append(f"link '{name}': {row.unexplained} packets unaccounted")
    for name, row in summary.links.items():
        if row.lost_kernel:
            doubts.append(f"link '{name}': {row.lost_kernel} lost by the kernel")
    doubts += _frame_doubts(summary)
    gap_s = peak_gap_s(run)
    if gap_s is not None and run.angles and summary.complete and summary.running_s is None:
        doubts.append(
            f"no angle from {gap_s[0]:.2f} to {gap_s[1]:.2f} s: the peak swing is not given, "
            "because it may have been then"
        )
    motion = summary.motion
    if motion.setpoints_outside:
        doubts.append(
            f"{motion.setpoints_outside} setpoints left the [safety] envelope "
            f"(policy {motion.policy}): {motion.asked_text}"
        )
    doubts += [f"no count from {end}: its packets cannot be balanced" for end in run.uncounted]
    doubts += _load_doubts(summary, run)
    joint = summary.joint
    if joint is not None and joint.arrived is False and summary.exit_status == "ok":
        doubts.append(
            f"the load of the joint ended {joint.final_error_deg:.3g} degrees off its goal of "
            f"{summary.move_deg:g} degrees; must be within 1 %: look at torque limit, controller "
            "and gear ratio"
        )
    late = summary.lateness
    too_late = late.references_late > MAX_LATE_SHARE * late.references
    if too_late and run.facts.reference_delay_ms * 1e6 < MAX_REFERENCE_LATENESS_NS:
        doubts.append(
            f"{late.references_late} of {late.references} references accepted > 30 ms late; "
            f"must be <= {MAX_LATE_SHARE:.0%}: the machine is too busy"
        )
    error_rad = summary.swing_error.outside_move_rad
    if error_rad is not None and error_rad > MAX_SWING_ERROR_RAD:
        doubts.append(
            f"measured swing is {error_rad * 1e3:.2f} mrad rms off the truth; "
            f"must be <= {MAX_SWING_ERROR_RAD * 1e3} mrad: {_cause_of_error(summary.across)}"
        )
    return doubts


def _cause_of_error(across: Across | None) -> str:
    """Name what makes the first camera measure wrong, as far as the other one tells."""
    if across is None or (across.peak_rad or 0.0) <= MAX_ACROSS_RAD:
        return (
            "calibrate again; for a camera pitched by more than 1 degree give its distance, too "
            "(vision.camera_distance_m)"
        )
    return (
        "a swing across is seen in perspective where the platform stands beside its home "
        "position: stop what pushes the load, or end the move at home"
    )
