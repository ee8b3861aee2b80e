"""`rig motor-check`: whether a motor can repeat a motion, and what it has to spare."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from planners.laws import LAWS
from rig.drives.motor import LIMIT_EXCESS_REL, Verdict, check_motor
from rig.errors import REFUSED, ConfigError
from rig.run.toml_file import read_toml
from rig.studies.sizing.motor_task import EXAMPLES, MotorTask, example_tables, task_of
from rig.ui.cli.output import out, print_json, wide

UNITS = {"torque": "N m", "thermal": "N m", "speed": "rad/s", "power": "W"}
TITLES = {
    "torque": "the peak torque",
    "thermal": "the rms torque",
    "speed": "the speed",
    "power": "the power",
}
LAST_DIGITS = 1e-5  # share by which rounding to the printed digits may change a figure
NEEDED = {  # without a file: the option that gives the key
    ("motor", "continuous_torque_n_m"): "--continuous-torque",
    ("motor", "peak_torque_n_m"): "--peak-torque",
    ("motor", "max_speed_rad_s"): "--max-speed",
    ("drivetrain", "motor_inertia_kg_m2"): "--motor-inertia",
    ("motion", "time_s"): "--time",
}


def motor_check(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="TOML with the sections motor, drivetrain and motion; options win over it.",
            metavar="TASK.toml",
        ),
    ] = None,
    example: Annotated[
        str | None,
        typer.Option(
            help=f"A worked task of source 000 instead of a file: {' or '.join(EXAMPLES)}."
        ),
    ] = None,
    continuous_torque: Annotated[float | None, typer.Option(help="Of the motor in N m.")] = None,
    peak_torque: Annotated[float | None, typer.Option(help="Of the motor in N m.")] = None,
    max_speed: Annotated[float | None, typer.Option(help="Of the motor in rad/s.")] = None,
    peak_power: Annotated[
        float | None, typer.Option(help="Of the motor in W; no limit unless given.")
    ] = None,
    motor_inertia: Annotated[float | None, typer.Option(help="Of the rotor in kg m².")] = None,
    load_inertia: Annotated[
        float | None, typer.Option(help="About the output shaft in kg m²; 0 unless given.")
    ] = None,
    motor_friction: Annotated[
        float | None, typer.Option(help="At the rotor in N m s/rad; 0 unless given.")
    ] = None,
    load_friction: Annotated[
        float | None, typer.Option(help="At the output shaft in N m s/rad; 0 unless given.")
    ] = None,
    gear_ratio: Annotated[
        float | None,
        typer.Option(help="Turns of the motor for one of the output shaft; 1 unless given."),
    ] = None,
    radius: Annotated[
        float | None,
        typer.Option(help="With --distance: what it rolls off in m (a screw: lead / 2π)."),
    ] = None,
    law: Annotated[
        str | None, typer.Option(help=f"One of {', '.join(LAWS)}; cycloidal unless given.")
    ] = None,
    angle: Annotated[
        float | None, typer.Option(help="Of the output shaft in rad; or --distance.")
    ] = None,
    distance: Annotated[float | None, typer.Option(help="In m, with --radius; or --angle.")] = None,
    time: Annotated[float | None, typer.Option(help="Of the motion in s.")] = None,
    acceleration: Annotated[
        float | None,
        typer.Option(
            help="With --law trapezoidal, in rad/s² or m/s² like the way; ramps of T/3 unless given."
        ),
    ] = None,
    rest: Annotated[
        float | None, typer.Option(help="Standstill after each motion in s; 0 unless given.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Draw the motion in the torque-speed plane, and its torque: .svg, .png or .pdf."
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
) -> int:
    """Check torque, heat, speed and power of a motor that repeats a motion, with margins; exit 3 when it cannot."""
    if file is not None and example is not None:
        raise ConfigError(
            f"--example {example} with file '{file}'; must be one of the two: leave one out"
        )
    tables = (
        read_toml(file, "motor task")
        if file is not None
        else example_tables(example)
        if example is not None
        else {}
    )
    linear = distance is not None or (angle is None and "distance_m" in _table(tables, "motion"))
    changes: dict[str, dict[str, Any]] = {
        "motor": {
            "continuous_torque_n_m": continuous_torque,
            "peak_torque_n_m": peak_torque,
            "max_speed_rad_s": max_speed,
            "peak_power_w": peak_power,
        },
        "drivetrain": {
            "motor_inertia_kg_m2": motor_inertia,
            "load_inertia_kg_m2": load_inertia,
            "motor_friction_n_m_s_rad": motor_friction,
            "load_friction_n_m_s_rad": load_friction,
            "gear_ratio": gear_ratio,
            "radius_m": radius,
        },
        "motion": {
            "law": law,
            "distance_rad": angle,
            "distance_m": distance,
            "time_s": time,
            "acceleration_m_s2" if linear else "acceleration_rad_s2": acceleration,
            "rest_s": rest,
        },
    }
    if _merge(tables, changes) - {"motor"}:
        tables.pop("published", None)  # they are of the motion as it stands
    task = task_of(tables)
    trajectory = task.trajectory()
    verdict = check_motor(task.motor, task.drivetrain, trajectory, task.motion.rest_s)
    if plot is not None:
        from rig.ui.plots import picture_file  # matplotlib takes its time
        from rig.ui.plots.laws import draw_motor

        picture_file.save(draw_motor(task, trajectory, verdict), plot)
    if as_json:
        print_json(_document(task, verdict))
    else:
        _print(task, verdict)
    return 0 if verdict.feasible else REFUSED


def _table(tables: dict[str, Any], name: str) -> dict[str, Any]:
    table = tables.setdefault(name, {})
    return table if isinstance(table, dict) else {}


def _merge(tables: dict[str, Any], changes: dict[str, dict[str, Any]]) -> set[str]:
    """Options that were given win over the file; the sections they changed. ConfigError for a key that neither has."""
    given = {
        name: {key: value for key, value in rows.items() if value is not None}
        for name, rows in changes.items()
    }
    for name, rows in given.items():
        _table(tables, name).update(rows)
    for (name, key), option in NEEDED.items():
        if isinstance(tables[name], dict) and key not in tables[name]:
            raise ConfigError(
                f"[{name}] {key}: missing; add it to the file, give {option}, or look at --example 1"
            )
    return {name for name, rows in given.items() if rows}


def _reasons(task: MotorTask, v: Verdict) -> list[str]:
    m, need = task.motor, v.effort
    said = {
        "torque": f"peak torque {need.peak_torque_n_m.value:.6g} N m; must be <= {m.peak_torque_n_m:g}: take more time",
        "thermal": f"rms torque {v.cycle_torque_n_m:.6g} N m; must be <= {m.continuous_torque_n_m:g}: "
        f"rest {v.least_rest_s:.4g} s after each motion",
        "speed": f"peak speed {need.peak_speed_rad_s.value:.6g} rad/s; must be <= {m.max_speed_rad_s:g}: "
        "lower the gear ratio or take more time",
        "power": f"peak power {need.peak_power_w.value:.6g} W; must be <= {m.peak_power_w:g}: take more time",
    }
    return [said[name] for name, margin in v.margins.items() if margin < -LIMIT_EXCESS_REL]


def _document(task: MotorTask, v: Verdict) -> dict[str, object]:
    need, printed = v.effort, task.published
    return {
        "feasible": v.feasible,
        "verdict": "good" if v.feasible else "bad",
        "reasons": _reasons(task, v),
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


def _print(task: MotorTask, v: Verdict) -> None:
    m, need, printed = task.motor, v.effort, task.published
    way = (
        f"{task.motion.distance_m:g} m"
        if task.motion.distance_m is not None
        else f"{task.motion.distance_rad:g} rad"
    )
    rest = f", {task.motion.rest_s:g} s of rest" if task.motion.rest_s else ""
    view = Table(
        title=f"{task.motion.law}: {way} in {need.duration_s:g} s{rest}", title_justify="left"
    )
    for name in (
        "",
        "needed",
        "at",
        "allowed",
        "margin",
        *(["source prints"] if task.has_figures else []),
    ):
        view.add_column(name, justify="right" if name else "left", no_wrap=True)
    rows = (
        ("torque, peak", need.peak_torque_n_m, m.peak_torque_n_m, "torque", None),
        (
            "torque, rms",
            v.cycle_torque_n_m,
            m.continuous_torque_n_m,
            "thermal",
            printed.rms_torque_n_m,
        ),
        (
            "speed, peak",
            need.peak_speed_rad_s,
            m.max_speed_rad_s,
            "speed",
            printed.peak_speed_rad_s,
        ),
        ("power, peak", need.peak_power_w, m.peak_power_w, "power", None),
    )
    for title, value, bound, name, figure in rows:
        number, at = (
            (value, "cycle") if isinstance(value, float) else (value.value, f"{value.t_s:.4g} s")
        )
        unit, margin = UNITS[name], v.margins[name]
        room = (f"{bound:g} {unit}", f"{margin:+.2%}") if math.isfinite(bound) else ("any", "")
        style = "red" if margin < -LIMIT_EXCESS_REL else ""
        source = [_figure(figure, number)] if task.has_figures else []
        view.add_row(title, f"{number:.6g} {unit}", at, *room, *source, style=style)
    wide.print(view)
    d = task.drivetrain
    out.print(
        f"at the motor's shaft: inertia {d.inertia_kg_m2:.6g} kg m², friction {d.friction_n_m_s_rad:.6g} N m s/rad"
    )
    if printed.reason:
        out.print(f"≠ {printed.reason}", style="dim")
    for reason in _reasons(task, v):
        out.print(f"  - {reason}")
    tightest = f"tightest is {TITLES[v.tightest]}, {v.margins[v.tightest]:+.2%}"
    out.print(
        f"verdict: {'feasible' if v.feasible else 'not feasible'}; {tightest}",
        style="green" if v.feasible else "red",
    )


def _figure(printed: float | None, right: float) -> str:
    if printed is None:
        return ""
    return f"{printed:g}{' ≠' if abs(printed / right - 1.0) > LAST_DIGITS else ''}"
