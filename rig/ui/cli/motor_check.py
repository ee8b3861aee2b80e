"""`rig motor-check`: check of a motor that repeats a motion, with margins."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from planners.laws import LAWS
from rig.drives.motor import check_motor
from rig.errors import REFUSED, ConfigError
from rig.run.toml_file import read_toml
from rig.run.units import TURN, suspect
from rig.studies.sizing.motor_task import EXAMPLES, example_tables, task_of
from rig.ui.cli import completion, motor_check_tables
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import print_written

REQUIRED_KEYS = {  # table and key: option that gives it
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
            help="TOML file with the sections motor, drivetrain and motion; options override it.",
            metavar="TASK.toml",
        ),
    ] = None,
    example: Annotated[
        str | None,
        typer.Option(
            help=f"Worked example of source 000 instead of a file: {' or '.join(EXAMPLES)}."
        ),
    ] = None,
    continuous_torque: Annotated[
        float | None, typer.Option(help="Continuous (rms) torque of the motor [N m].")
    ] = None,
    peak_torque: Annotated[
        float | None, typer.Option(help="Peak torque of the motor [N m].")
    ] = None,
    max_speed: Annotated[
        float | None, typer.Option(help="Maximum speed of the motor \\[rad/s].")
    ] = None,
    peak_power: Annotated[
        float | None, typer.Option(help="Peak power of the motor [W]; unlimited by default.")
    ] = None,
    motor_inertia: Annotated[
        float | None, typer.Option(help="Inertia of the rotor \\[kg m²].")
    ] = None,
    load_inertia: Annotated[
        float | None,
        typer.Option(help="Inertia of the load about the output shaft \\[kg m²]; 0 by default."),
    ] = None,
    motor_friction: Annotated[
        float | None,
        typer.Option(help="Viscous friction at the rotor [N m s/rad]; 0 by default."),
    ] = None,
    load_friction: Annotated[
        float | None,
        typer.Option(help="Viscous friction at the output shaft [N m s/rad]; 0 by default."),
    ] = None,
    gear_ratio: Annotated[
        float | None,
        typer.Option(help="Gear ratio, motor speed over output speed; 1 by default."),
    ] = None,
    radius: Annotated[
        float | None,
        typer.Option(help="Pinion radius for --distance \\[m]; lead / 2π for a screw."),
    ] = None,
    law: Annotated[
        str | None,
        typer.Option(
            help=f"Motion law: {', '.join(LAWS)}; cycloidal by default.",
            autocompletion=completion.laws,
        ),
    ] = None,
    angle: Annotated[
        float | None, typer.Option(help="Angle of the output shaft \\[rad], or --distance.")
    ] = None,
    distance: Annotated[
        float | None, typer.Option(help="Distance \\[m] with --radius, or --angle.")
    ] = None,
    time: Annotated[float | None, typer.Option(help="Duration of the motion \\[s].")] = None,
    acceleration: Annotated[
        float | None,
        typer.Option(
            help="Acceleration of --law trapezoidal \\[rad/s², or m/s² with --distance]; "
            "ramps of T/3 by default.",
        ),
    ] = None,
    rest: Annotated[
        float | None, typer.Option(help="Rest after each motion \\[s]; 0 by default.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Figure file of the torque-speed plane: .svg, .png or .pdf."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Check peak torque, rms torque, speed and power of a motor that repeats a motion.

    Exit code 3 when a limit is exceeded.
    """
    if file is not None and example is not None:
        raise ConfigError(
            f"--example {example} with file '{file}'; must be one of the two: omit one"
        )
    if angle is not None:
        suspect("--angle", angle, TURN)
    tables: dict[str, Any] = {}
    if file is not None:
        tables = read_toml(file, "motor task")
    elif example is not None:
        tables = example_tables(example)
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
        tables.pop("published", None)  # printed figures hold for the unchanged motion only
    task = task_of(tables)
    trajectory = task.trajectory()
    verdict = check_motor(task.motor, task.drivetrain, trajectory, task.motion.rest_s)
    if plot is not None:
        from rig.ui.plots import picture_file  # matplotlib is slow to import
        from rig.ui.plots.laws import draw_motor

        picture_file.save(draw_motor(task, trajectory, verdict), plot)
    if as_json:
        print_json(motor_check_tables.document(task, verdict))
    else:
        motor_check_tables.print_tables(task, verdict)
        print_written(plot)
    return 0 if verdict.feasible else REFUSED


def _table(tables: dict[str, Any], name: str) -> dict[str, Any]:
    """Get a section of the file, created if missing; empty if the key is not a section."""
    table = tables.setdefault(name, {})
    return table if isinstance(table, dict) else {}


def _merge(tables: dict[str, Any], changes: dict[str, dict[str, Any]]) -> set[str]:
    """Override keys of the file by options; gives the names of the changed sections.

    Raises ConfigError for a required key that neither has.
    """
    changed = set()
    for name, options in changes.items():
        given = {key: value for key, value in options.items() if value is not None}
        _table(tables, name).update(given)
        if given:
            changed.add(name)
    for (name, key), option in REQUIRED_KEYS.items():
        if isinstance(tables[name], dict) and key not in tables[name]:
            raise ConfigError(
                f"[{name}] {key}: missing; must be given: add it to the file, "
                f"give {option}, or try --example 1"
            )
    return changed
