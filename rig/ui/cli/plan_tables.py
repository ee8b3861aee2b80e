"""Table, JSON document and CSV file of `rig plan`."""

from __future__ import annotations

import csv
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.table import Table

from planners.models.chain import ChainModel
from planners.models.model import cart_for_input
from planners.problem import Plan
from rig.ui.cli.page import Column, boxed_table

TABLE_SAMPLE_S = 0.01


def document(result: Plan) -> dict[str, object]:
    """Create the JSON document of a plan."""
    p = result.problem
    return {
        "planner": result.planner,
        "model": p.input,
        "robust": list(p.robust),
        "distance_m": p.distance_m,
        "time_s": p.time_s,
        **asdict(result.metrics),
        "compute_s": result.compute_s,
        "status": result.status.value,
        "reasons": list(result.reasons),
    }


def plan_table(result: Plan) -> Table:
    """Create the table of a plan: natural frequencies, swing, peak and rms values."""
    p = result.problem
    m = result.metrics
    cart = cart_for_input(p.input)
    frequencies_hz = p.model.modes(cart).natural_frequencies_hz
    if isinstance(p.model, ChainModel):
        load = f"{p.model.links_count} links"
    else:
        load = f"cable {p.model.parameters['length']:g} m"
    words = [
        f"{result.planner}: {p.distance_m:g} m in {p.time_s:g} s",
        load,
        f"{p.input} input",
    ]
    if p.robust:
        words.append(f"robust to {', '.join(p.robust)}")
    if p.nonlinear:
        words.append("nonlinear")
    table = boxed_table(", ".join(words), ("quantity", Column("value", folds=True)))
    rows = (
        (f"natural frequencies, platform {cart}", ", ".join(f"{f:.4f} Hz" for f in frequencies_hz)),
        ("peak swing, nonlinear load", f"{m.peak_swing_rad * 1e3:.3f} mrad"),
        ("residual swing, small swings", f"{m.residual_swing_rad * 1e3:.3g} mrad"),
        ("residual swing, nonlinear load", f"{m.residual_swing_nonlinear_rad * 1e3:.3g} mrad"),
        ("peak / rms speed", f"{m.peak_speed_m_s:.4f} / {m.rms_speed_m_s:.4f} m/s"),
        (
            "peak / rms acceleration",
            f"{m.peak_acceleration_m_s2:.4f} / {m.rms_acceleration_m_s2:.4f} m/s²",
        ),
        ("travel", f"{m.travel_m:.4f} m"),
        ("acceleration continuous", "yes" if m.acceleration_continuous else "no"),
        ("computing time", f"{(result.compute_s or 0) * 1e3:.2f} ms"),
        ("status", result.status.value),
    )
    for row in rows:
        table.add_row(*row)
    return table


def write_csv(result: Plan, path: Path) -> None:
    """Write time, position, speed and acceleration every TABLE_SAMPLE_S."""
    end_s = result.motion.duration_s
    t = np.append(np.arange(0.0, end_s - TABLE_SAMPLE_S * 1e-6, TABLE_SAMPLE_S), end_s)
    columns = np.column_stack([t, *(result.motion.x.at(t, order) for order in range(3))])
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t_s", "position_m", "speed_m_s", "acceleration_m_s2"])
        rows.writerows([f"{value:.9g}" for value in row] for row in columns)
