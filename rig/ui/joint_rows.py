"""Figures of the move of an elastic joint in rows, for terminal and report."""

from __future__ import annotations

from rig.analysis.summary import JointFigures, Summary


def joint_rows(s: Summary) -> list[tuple[str, str, str]]:
    """List name, measured and true value; none where the move was not recorded to its end."""
    joint = s.joint
    if joint is None:
        return []
    measured = f"{joint.residual_measured:.2%} ± {joint.residual_sigma:.2%}"
    return [
        ("residual vibration, of top speed", measured, _percent(joint.residual)),
        ("below 1 % of top speed after the end, ms", "", _settled(joint)),
        ("speed error, rms, of top speed", "", _percent(joint.speed_error)),
        ("overshoot, mdeg", "", _milli(joint.overshoot_deg)),
        ("final error, mdeg", "", _milli(joint.final_error_deg)),
        ("torque, peak, N m", f"{joint.peak_torque_n_m:.3f}", ""),
        ("torque, rms over the move, N m", f"{joint.rms_torque_n_m:.3f}", ""),
        ("torque, rms at rest, N m", f"{joint.rest_torque_n_m:.4f}", ""),
        ("time at the torque limit, ms", f"{joint.at_limit_s * 1e3:.0f}", ""),
    ]


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{share:.2%}"


def _milli(value: float | None) -> str:
    return "-" if value is None else f"{value * 1e3:.2f}"


def _settled(joint: JointFigures) -> str:
    if joint.residual is None:
        return "-"
    return "never" if joint.settled_s is None else f"{joint.settled_s * 1e3:.0f}"
