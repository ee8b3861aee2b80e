"""`rig plan`: what a planner would do, and what it would leave behind."""

from __future__ import annotations

import csv
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from comms.clock import stopwatch_s
from planners import catalog
from planners.models.pendulum import PendulumModel
from planners.problem import Limits, Plan, Problem
from rig.cli.output import out, print_json
from rig.config import LimitsSection
from rig.errors import REFUSED

SAMPLE_S = 0.01


def plan(
    planner: Annotated[str, typer.Option(help=f"One of: {', '.join(catalog.PLANNERS)}.")] = "matrix_exponential",
    distance: Annotated[float, typer.Option(help="Distance in m.")] = 0.2,
    time: Annotated[float, typer.Option(help="Time of the move in s.")] = 1.5,
    length: Annotated[float, typer.Option(help="Believed cable length in m.")] = 1.0,
    damping: Annotated[float, typer.Option(help="Believed damping ratio.")] = 0.0,
    speed_limit: Annotated[float, typer.Option(help="Limit on speed in m/s.")] = LimitsSection().speed_m_s,
    acceleration_limit: Annotated[
        float, typer.Option(help="Limit on acceleration in m/s².")
    ] = LimitsSection().acceleration_m_s2,
    csv_file: Annotated[Path | None, typer.Option("--csv", help="Write t, x, v, a every 10 ms.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")] = False,
) -> int:
    """Plan a move along X and say what it asks for and what swing it leaves; exit 3 when it leaves the limits."""
    problem = Problem(
        distance_m=distance,
        time_s=time,
        model=PendulumModel(length_m=length, damping_ratio=damping),
        limits=Limits(speed_m_s=speed_limit, acceleration_m_s2=acceleration_limit),
    )
    made = catalog.plan(planner, problem, stopwatch_s)
    if csv_file is not None:
        _write_csv(made, csv_file)
    if as_json:
        print_json(_document(made))
    else:
        out.print(_table(made))
        for reason in made.reasons:
            out.print(f"over limits: {reason}", style="yellow")
    return REFUSED if made.reasons else 0


def _document(made: Plan) -> dict[str, object]:
    p = made.problem
    return {
        "planner": made.planner,
        "model": p.input,
        "robust": list(p.robust),
        "distance_m": p.distance_m,
        "time_s": p.time_s,
        **asdict(made.metrics),
        "compute_s": made.compute_s,
        "status": made.status.value,
        "reasons": list(made.reasons),
    }


def _table(made: Plan) -> Table:
    p, m = made.problem, made.metrics
    table = Table(
        title=f"{made.planner}: {p.distance_m:g} m in {p.time_s:g} s, cable {p.model.length_m:g} m", title_justify="left"
    )
    table.add_column("")
    table.add_column("", justify="right")
    rows = (
        ("peak swing", f"{m.peak_swing_rad * 1e3:.3f} mrad"),
        ("residual swing, linear model", f"{m.residual_swing_rad * 1e3:.6f} mrad"),
        ("residual swing, true pendulum", f"{m.residual_swing_nonlinear_rad * 1e3:.4f} mrad"),
        ("peak / rms speed", f"{m.peak_speed_m_s:.4f} / {m.rms_speed_m_s:.4f} m/s"),
        ("peak / rms acceleration", f"{m.peak_acceleration_m_s2:.4f} / {m.rms_acceleration_m_s2:.4f} m/s²"),
        ("travel", f"{m.travel_m:.4f} m"),
        ("acceleration continuous", "yes" if m.acceleration_continuous else "no"),
        ("computed in", f"{(made.compute_s or 0) * 1e3:.2f} ms"),
        ("status", made.status.value),
    )
    for row in rows:
        table.add_row(*row)
    return table


def _write_csv(made: Plan, path: Path) -> None:
    t = np.arange(0.0, made.motion.duration_s + SAMPLE_S / 2, SAMPLE_S)
    columns = np.column_stack([t, *(made.motion.x.at(t, order) for order in range(3))])
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t_s", "position_m", "speed_m_s", "acceleration_m_s2"])
        rows.writerows([f"{value:.9g}" for value in row] for row in columns)
