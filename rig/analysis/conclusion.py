"""Conclusion of a run in one sentence, and the setting of the model that follows from it.

A cause is named only where it explains the measurement: the plan is applied to a load of the
measured length, and its residual swing must come out as measured. Otherwise the conclusion says
that the cause is not known.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np

from rig.analysis.run_log import RunLog
from rig.analysis.summary import JointFigures, Summary

AS_PLANNED_RAD = 0.3e-3  # a residual swing this close to the planned one is as planned
EXPLAINED_REL = 0.25  # of the measured residual swing: error of a prediction that explains it
MIN_LENGTH_ERROR_M = 1e-3  # what g, known to 0.01 m/s2, leaves uncertain of a length
SIGNIFICANT_SIGMAS = 5.0
SWING_SIGMAS = 20.0  # of the amplitude: smallest swing that tells a length
LENGTH_DIGITS = 3  # of a setting, to 1 mm


class Setting(msgspec.Struct, frozen=True, kw_only=True):
    """A key of the experiment file with its better value."""

    section: str
    key: str
    value: str

    @property
    def toml(self) -> str:
        """Line to paste, with its table."""
        return f"[{self.section}] {self.key} = {self.value}"

    @property
    def option(self) -> str:
        """Option of `rig run` that sets it."""
        return f"--set {self.section}.{self.key}={self.value}"


class Conclusion(msgspec.Struct, frozen=True, kw_only=True):
    """One sentence, the setting that follows from it, and the command that runs with it."""

    sentence: str
    setting: Setting | None = None
    command: str = ""


def conclude(run: RunLog, summary: Summary) -> Conclusion:
    """Draw the conclusion of an analysed run."""
    if summary.verdict == "bad":
        reason = summary.reasons[0] if summary.reasons else f"exit status {summary.exit_status}"
        return Conclusion(sentence=f"The run gave no valid result: {reason}.")
    if summary.joint is not None:
        return Conclusion(sentence=_joint_sentence(summary.joint))
    error_m = _length_error_m(run, summary)
    setting = None if error_m is None else _setting(summary)
    command = f"{repeat_command(run, summary)} {setting.option}" if setting else ""
    if run.facts.rate_hz == 0.0:
        sentence = _unseen_sentence(summary)
    elif summary.move_time_s == 0.0:
        sentence = _free_decay_sentence(run, summary, error_m)
    else:
        sentence = _move_sentence(run, summary, error_m)
    return Conclusion(sentence=sentence, setting=setting, command=command)


def repeat_command(run: RunLog, summary: Summary) -> str:
    """Name the command that repeats a run: the one in its log, else that of its experiment."""
    recorded = run.log.metadata["run.start"].get("command", "")
    return recorded or f"rig run {summary.experiment}"


def predicted_residual_rad(run: RunLog, length_m: float) -> float:
    """Residual swing that the plan leaves on a pendulum of this length: small angles, no damping.

    The platform moves from sample to sample at constant speed, so its acceleration is a train of
    impulses d_k / h: A = |sum d_k exp(j w t_k)| / (h w L) with d_k the second difference of the
    position and w = sqrt(g / L).
    """
    omega_rad_s = math.sqrt(run.facts.gravity_m_s2 / length_m)
    h_s = run.plan.period_ns * 1e-9
    x_m = np.array([position[0] for position in run.plan.positions_m])
    steps = np.diff(x_m, 2, prepend=x_m[:1], append=x_m[-1:])
    waves = np.exp(1j * omega_rad_s * h_s * np.arange(steps.size))
    return float(abs(np.sum(steps * waves)) / (h_s * omega_rad_s * length_m))


def _length_error_m(run: RunLog, summary: Summary) -> float | None:
    """Measured minus modelled length of the cable; None where it is not significant."""
    length_m = summary.measured.cable_length_m
    sigma_m = summary.sigma.cable_length_m
    if run.facts.is_chain or length_m is None or sigma_m is None:
        return None
    swing_rad, noise_rad = summary.measured.residual_swing_rad, summary.sigma.residual_swing_rad
    if swing_rad is None or noise_rad is None or swing_rad < SWING_SIGMAS * noise_rad:
        return None  # hardly a swing: its period is that of the noise
    if run.plant_params.get("length_changes"):
        return None  # it had several lengths
    error_m = length_m - run.facts.cable_length_m
    bound_m = max(MIN_LENGTH_ERROR_M, SIGNIFICANT_SIGMAS * sigma_m)
    return error_m if abs(error_m) > bound_m else None


def _setting(summary: Summary) -> Setting:
    length_m = summary.measured.cable_length_m or 0.0
    return Setting(section="model", key="length_m", value=f"{length_m:.{LENGTH_DIGITS}f}")


def _joint_sentence(joint: JointFigures) -> str:
    share = joint.residual_measured
    sentence = (
        f"Under {joint.controller} the load keeps {share:.1%} ± {joint.residual_sigma:.1%} of its "
        "top speed after the move, by its accelerometer"
    )
    if joint.settled_s is None:
        return f"{sentence}."
    return f"{sentence}; it stays below 1 % from {joint.settled_s * 1e3:.0f} ms after the end on."


def _unseen_sentence(summary: Summary) -> str:
    """Conclude a run without a camera from the truth, where there is one."""
    unseen = "The run had no camera; the swing was not measured."
    residual_rad = summary.truth.residual_swing_rad if summary.truth else None
    if residual_rad is None or summary.move_time_s == 0.0:
        return unseen
    planned_rad = summary.planned.residual_swing_rad
    instead = "" if planned_rad is None else f", {planned_rad * 1e3:.2f} mrad planned"
    return f"{unseen} In truth the load keeps {residual_rad * 1e3:.2f} mrad{instead}."


def _free_decay_sentence(run: RunLog, summary: Summary, error_m: float | None) -> str:
    frequency_hz = summary.measured.natural_frequency_hz
    if frequency_hz is None:
        return "The load was watched; its frequency is not identifiable in this run."
    swings = f"The load swings at {frequency_hz:.4f} Hz"
    if run.facts.is_chain:
        return f"{swings}."
    if error_m is None:
        return f"{swings}; its cable has the length of the model."
    return f"{swings}; its cable is {_compared(error_m)} the model's."


def _move_sentence(run: RunLog, summary: Summary, error_m: float | None) -> str:
    residual_rad = summary.measured.residual_swing_rad
    planned_rad = summary.planned.residual_swing_rad
    if residual_rad is None:
        return (
            "No residual swing is identifiable after the move: it is smaller than its uncertainty."
        )
    keeps = f"The load keeps {residual_rad * 1e3:.1f} mrad"
    if planned_rad is not None and abs(residual_rad - planned_rad) <= AS_PLANNED_RAD:
        return f"{keeps}, as planned ({planned_rad * 1e3:.1f} mrad)."
    instead = "" if planned_rad is None else f" instead of {planned_rad * 1e3:.1f} mrad"
    lost = summary.links["reference"].lost if "reference" in summary.links else 0
    if lost:
        also = "" if error_m is None else f", and its cable is {_compared(error_m)} the model's"
        return f"{keeps}{instead}; {lost} references were lost on their way{also}."
    if error_m is not None and _explains(run, summary, residual_rad):
        return f"{keeps}{instead} because its cable is {_compared(error_m)} the model's."
    before_rad = summary.initial_swing_rad or 0.0
    if before_rad > AS_PLANNED_RAD:
        return f"{keeps}{instead}; it swung {before_rad * 1e3:.1f} mrad before the move."
    return f"{keeps}{instead}; the cause is not identifiable from this run."


def _explains(run: RunLog, summary: Summary, residual_rad: float) -> bool:
    """Tell whether the measured length alone makes the plan leave what was measured."""
    length_m = summary.measured.cable_length_m
    if length_m is None:
        return False
    predicted_rad = predicted_residual_rad(run, length_m)
    return abs(predicted_rad - residual_rad) <= max(AS_PLANNED_RAD, EXPLAINED_REL * residual_rad)


def _compared(error_m: float) -> str:
    """Word a difference of length, e.g. "20 mm shorter than"."""
    return f"{abs(error_m) * 1e3:.0f} mm {'shorter' if error_m < 0 else 'longer'} than"
