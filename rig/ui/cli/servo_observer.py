"""`rig servo observer`: analysis of a torque disturbance observer on an elastic joint."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.errors import ConfigError
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import print_written
from rig.ui.cli.servo_observer_document import document
from rig.ui.cli.servo_observer_tables import print_tables


def observer(
    joint: Annotated[
        str,
        typer.Option(
            help="Joint: listed or fitted (constants of the harmonic drive of source 001), or the "
            "\\[model] of a comparison FILE.toml.",
        ),
    ] = "listed",
    time_constants: Annotated[
        str | None,
        typer.Option(
            help="Time constants T_f of Q = 1 / (1 + s T_f) \\[s], separated by commas, each 1e-12 "
            "to 1e12; between both limits by default.",
        ),
    ] = None,
    nominal_inertia: Annotated[
        float | None,
        typer.Option(
            help="Inertia of the rigid nominal model \\[kg m²], 1e-12 to 1e12; "
            "that of the motor by default.",
        ),
    ] = None,
    order: Annotated[
        int,
        typer.Option(
            help="Order of Q, 1 to 8; from 2 on a Butterworth filter with its corner at 1 / T_f."
        ),
    ] = 1,
    plot: Annotated[
        Path | None,
        typer.Option(help="Figure file of damping ratio and responses: .svg, .png or .pdf."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Analyse damping, rejection and responses of a torque disturbance observer over T_f."""
    from rig.studies.servo.joints import named_joint  # python-control is slow to import
    from rig.studies.servo.observer import (
        TIME_CONSTANTS_S,
        ObserverTask,
        observer_rows,
        without_observer,
    )
    from rig.studies.servo.observer_damping import time_constant_ranges

    if plot is not None:
        from rig.ui.plots import picture_file

        picture_file.check(plot)
    times_s = TIME_CONSTANTS_S if time_constants is None else _time_constants_s(time_constants)
    _check(nominal_inertia, order)
    task = ObserverTask(
        joint=named_joint(joint),
        time_constants_s=times_s,
        nominal_inertia_kg_m2=nominal_inertia,
        order=order,
    )
    rows = observer_rows(task)
    bare = without_observer(task)
    turn = time_constant_ranges(task)
    if plot is not None:
        from rig.ui.plots.servo_observer import draw_observer

        picture_file.save(draw_observer(task), plot)
    if as_json:
        print_json(document(joint, task, rows, bare, turn))
    else:
        print_tables(joint, task, rows, bare, turn)
        print_written(plot)
    return 0


def _time_constants_s(text: str) -> tuple[float, ...]:
    """Parse a comma list of time constants [s]; raises ConfigError, ServoError."""
    from rig.drives.servo.errors import check_range

    try:
        values = tuple(float(word) for word in text.split(",") if word.strip())
    except ValueError:
        values = ()
    if not values:
        raise ConfigError(
            f"--time-constants {text!r}; must be numbers separated by commas, in s: e.g. 5e-4,2e-3"
        )
    for value in values:
        check_range("--time-constants", value, 1e-12, 1e12, "give seconds, e.g. 5e-4,2e-3")
    return values


def _check(nominal_inertia: float | None, order: int) -> None:
    """Check inertia and order; raises ServoError."""
    from rig.drives.servo.errors import check_range
    from rig.drives.servo.nominal import MAX_FILTER_ORDER

    if nominal_inertia is not None:
        check_range(
            "--nominal-inertia", nominal_inertia, 1e-12, 1e12, "give kg m² at the motor shaft"
        )
    check_range("--order", order, 1, MAX_FILTER_ORDER, "1 or 2 is usual")
