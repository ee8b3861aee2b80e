"""Tables and JSON document of `rig motor-check`."""

from __future__ import annotations

import math
from typing import NamedTuple

from rich.table import Table

from rig.drives.motor import LIMIT_EXCESS_REL, Verdict
from rig.studies.sizing.motor_task import MotorTask
from rig.ui.cli.page import Column, boxed_table, print_paragraph, print_table

LIMIT_NAMES = {
    "torque": "peak torque",
    "thermal": "rms torque",
    "speed": "peak speed",
    "power": "peak power",
}
# a printed figure may differ from the exact one by the rounding to its last digits
PRINTED_ROUNDING_REL = 1e-5


class CheckRow(NamedTuple):
    """Row of the table: required value against the limit of the motor."""

    limit: str  # key of LIMIT_NAMES and of the margins
    value: float
    at: str  # instant of the peak, or the whole cycle
    bound: float
    unit: str
    printed: float | None = None  # figure of the source


def document(task: MotorTask, v: Verdict) -> dict[str, object]:
    """Create the JSON document of a motor check."""
    need = v.effort
    printed = task.published
    return {
        "feasible": v.feasible,
        "verdict": "good" if v.feasible else "bad",
        "reasons": violations(task, v),
        "law": task.motion.law,
        "time_s": need.duration_s,
        "rest_s": task.motion.rest_s,
        "inertia_kg_m2": task.drivetrain.inertia_kg_m2,
        "friction_n_m_s_rad": task.drivetrain.friction_n_m_s_rad,
        "peak_torque_n_m": need.peak_torque_n_m.value,
        "peak_torque_t_s": need.peak_torque_n_m.t_s,
        "rms_torque_n_m": need.rms_torque_n_m,
        "cycle_rms_torque_n_m": v.cycle_torque_n_m,
        "peak_speed_rad_s": need.peak_speed_rad_s.value,
        "peak_speed_t_s": need.peak_speed_rad_s.t_s,
        "peak_power_w": need.peak_power_w.value,
        "peak_power_t_s": need.peak_power_w.t_s,
        "least_rest_s": v.least_rest_s,
        "margins": v.margins,
        "tightest": v.tightest,
        "published": {
            "rms_torque_n_m": printed.rms_torque_n_m,
            "peak_speed_rad_s": printed.peak_speed_rad_s,
            "reason": printed.reason,
        },
    }


def violations(task: MotorTask, v: Verdict) -> list[str]:
    """List the limits that the motion exceeds, each with value, bound and remedy."""
    m = task.motor
    need = v.effort
    texts = {
        "torque": f"peak torque {need.peak_torque_n_m.value:.6g} N m; "
        f"must be <= {m.peak_torque_n_m:g}: take more time",
        "thermal": f"rms torque {v.cycle_torque_n_m:.6g} N m; "
        f"must be <= {m.continuous_torque_n_m:g}: rest {v.least_rest_s:.4g} s after each motion",
        "speed": f"peak speed {need.peak_speed_rad_s.value:.6g} rad/s; "
        f"must be <= {m.max_speed_rad_s:g}: lower the gear ratio or take more time",
        "power": f"peak power {need.peak_power_w.value:.6g} W; "
        f"must be <= {m.peak_power_w:g}: take more time",
    }
    return [texts[name] for name, margin in v.margins.items() if margin < -LIMIT_EXCESS_REL]


def print_tables(task: MotorTask, v: Verdict) -> None:
    """Print required values, limits and margins, and the verdict."""
    print_table(_check_table(task, v))
    d = task.drivetrain
    print_paragraph(
        f"at the motor shaft: inertia {d.inertia_kg_m2:.6g} kg m², "
        f"viscous friction {d.friction_n_m_s_rad:.6g} N m s/rad"
    )
    if task.published.reason:
        print_paragraph(f"≠ {task.published.reason}", "dim")
    for reason in violations(task, v):
        print_paragraph(f"  - {reason}", indent="    ")
    verdict = "feasible" if v.feasible else "not feasible"
    tightest = f"least margin: {LIMIT_NAMES[v.tightest]}, {v.margins[v.tightest]:+.2%}"
    print_paragraph(f"verdict: {verdict}; {tightest}", "green" if v.feasible else "red")


def _check_table(task: MotorTask, v: Verdict) -> Table:
    motion = task.motion
    if motion.distance_m is not None:
        distance = f"{motion.distance_m:g} m"
    else:
        distance = f"{motion.distance_rad:g} rad"
    rest = f", {motion.rest_s:g} s rest" if motion.rest_s else ""
    title = f"{motion.law}: {distance} in {v.effort.duration_s:g} s{rest}"
    columns: list[str | Column] = ["limit", "required", Column("at", drop=1), "allowed", "margin"]
    if task.has_figures:
        columns.append(Column("source prints", drop=2))
    view = boxed_table(title, columns)
    for row in _check_rows(task, v):
        margin = v.margins[row.limit]
        allowed, margin_text = "unlimited", ""
        if math.isfinite(row.bound):
            allowed, margin_text = f"{row.bound:g} {row.unit}", f"{margin:+.2%}"
        cells = [
            LIMIT_NAMES[row.limit],
            f"{row.value:.6g} {row.unit}",
            row.at,
            allowed,
            margin_text,
        ]
        if task.has_figures:
            cells.append(_printed_figure(row.printed, row.value))
        view.add_row(*cells, style="red" if margin < -LIMIT_EXCESS_REL else "")
    return view


def _check_rows(task: MotorTask, v: Verdict) -> list[CheckRow]:
    m = task.motor
    torque = v.effort.peak_torque_n_m
    speed = v.effort.peak_speed_rad_s
    power = v.effort.peak_power_w
    return [
        CheckRow("torque", torque.value, _instant(torque.t_s), m.peak_torque_n_m, "N m"),
        CheckRow(
            "thermal",
            v.cycle_torque_n_m,
            "cycle",
            m.continuous_torque_n_m,
            "N m",
            task.published.rms_torque_n_m,
        ),
        CheckRow(
            "speed",
            speed.value,
            _instant(speed.t_s),
            m.max_speed_rad_s,
            "rad/s",
            task.published.peak_speed_rad_s,
        ),
        CheckRow("power", power.value, _instant(power.t_s), m.peak_power_w, "W"),
    ]


def _instant(t_s: float) -> str:
    return f"{t_s:.4g} s"


def _printed_figure(printed: float | None, exact: float) -> str:
    """Format a printed figure, marked ≠ where it is not the exact one rounded."""
    if printed is None:
        return ""
    mark = " ≠" if abs(printed / exact - 1.0) > PRINTED_ROUNDING_REL else ""
    return f"{printed:g}{mark}"
