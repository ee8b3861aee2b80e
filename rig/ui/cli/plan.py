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
from planners.laws import LAWS
from planners.models.chain import ChainModel
from planners.models.model import INPUTS, LAG_S, cart_for_input
from planners.problem import Limits, Plan, Problem
from rig.errors import REFUSED, ConfigError
from rig.run.config import LimitsSection, ModelSection
from rig.run.load_model import build_model
from rig.ui.cli.output import out, print_json
from rig.ui.plots import picture_file

TABLE_SAMPLE_S = 0.01


def plan(
    planner: Annotated[
        str, typer.Option(help=f"One of: {', '.join(catalog.PLANNERS)}.")
    ] = "matrix_exponential",
    distance: Annotated[float, typer.Option(help="Distance in m.")] = 0.2,
    time: Annotated[float, typer.Option(help="Time of the move in s.")] = 1.5,
    length: Annotated[
        float | None, typer.Option(help="Believed cable length in m; 1 without --links.")
    ] = None,
    damping: Annotated[
        float, typer.Option(help="Believed damping ratio of every mode, a fraction of critical.")
    ] = 0.0,
    model: Annotated[
        str, typer.Option(help=f"What moves the platform: {', '.join(INPUTS)}.")
    ] = "acceleration",
    robust: Annotated[
        list[str] | None,
        typer.Option(
            help="Parameter whose error to forgive, e.g. length, length_1, stiffness_1; repeat, or commas."
        ),
    ] = None,
    links: Annotated[
        str | None,
        typer.Option(
            help="A chain instead of a cable: length:mass:kind in m and kg, e.g. 0.5:3.375:bar,0.5:3.375:bar."
        ),
    ] = None,
    stiffness: Annotated[
        str | None,
        typer.Option(help="Of each joint between links in N m/rad, with commas; 0 unless given."),
    ] = None,
    joint_damping: Annotated[
        str | None,
        typer.Option(help="Of each joint between links in N m s/rad, with commas; 0 unless given."),
    ] = None,
    tip_mass: Annotated[float, typer.Option(help="At the end of the chain in kg.")] = 0.0,
    mass: Annotated[
        float | None,
        typer.Option(
            help="Of the load on a cable in kg, 0.7 unless given; matters with --model force."
        ),
    ] = None,
    cart_mass: Annotated[
        float, typer.Option(help="Of the platform in kg; matters with --model force.")
    ] = ModelSection().cart_mass_kg,
    law: Annotated[
        str, typer.Option(help=f"Motion law that a shaper shapes: {', '.join(LAWS)}.")
    ] = "harmonic",
    nonlinear: Annotated[
        bool, typer.Option("--nonlinear", help="Plan for the true pendulum, not for small swings.")
    ] = False,
    start: Annotated[
        list[str] | None,
        typer.Option(help="State that is not at rest at the start, e.g. angle_rad=0.05; repeat."),
    ] = None,
    goal: Annotated[list[str] | None, typer.Option(help="The same for the end.")] = None,
    weight: Annotated[
        list[str] | None,
        typer.Option(
            help="Weight of a squared state, the input's being 1: e.g. angle_rad=50; repeat."
        ),
    ] = None,
    speed_limit: Annotated[
        float, typer.Option(help="Limit on speed in m/s.")
    ] = LimitsSection().speed_m_s,
    acceleration_limit: Annotated[
        float, typer.Option(help="Limit on acceleration in m/s².")
    ] = LimitsSection().acceleration_m_s2,
    lag: Annotated[float, typer.Option(help="Time constant of --model jerk in s.")] = LAG_S,
    csv_file: Annotated[
        Path | None, typer.Option("--csv", help="Write t, x, v, a every 10 ms.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the move and the swing it makes: .svg, .png or .pdf.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
) -> int:
    """Plan a move along X and say what it asks for and what swing it leaves; exit 3 when it leaves the limits."""
    for option, text in (
        ("--links", links),
        ("--stiffness", stiffness),
        ("--joint-damping", joint_damping),
    ):
        if text is not None and not text.strip():
            raise ConfigError(f"{option} is empty; must name something: leave the option out")
    if links is not None and length is not None:
        raise ConfigError(
            f"--length {length:g} with --links {links}; must be one of the two: leave one out"
        )
    if links is not None and mass is not None:
        raise ConfigError(
            f"--mass {mass:g} with --links {links}; must be one of the two: each link names its own mass"
        )
    forgiven = [name.strip() for text in robust or () for name in text.split(",")]
    if not all(forgiven) or len(set(forgiven)) < len(forgiven):
        raise ConfigError(
            f"--robust {', '.join(robust or [])!r}; must name each parameter once: e.g. --robust length"
        )
    if plot is not None:
        picture_file.check(plot)
    if csv_file is not None:
        picture_file.check_folder("--csv", csv_file)
    believed = ModelSection(
        length_m=length,
        links=links.split(",") if links else [],
        stiffness_n_m_rad=_numbers("--stiffness", stiffness),
        joint_damping_n_m_s_rad=_numbers("--joint-damping", joint_damping),
        tip_mass_kg=tip_mass,
        damping_ratio=damping,
        mass_kg=ModelSection().mass_kg if mass is None else mass,
        cart_mass_kg=cart_mass,
    )
    problem = Problem(
        distance_m=distance,
        time_s=time,
        model=build_model(believed),
        input=model,
        lag_s=lag,
        robust=tuple(forgiven),
        law=law,
        nonlinear=nonlinear,
        start_state=_states("--start", start or []),
        goal_state=_states("--goal", goal or []),
        state_weights=_states("--weight", weight or []),
        limits=Limits(speed_m_s=speed_limit, acceleration_m_s2=acceleration_limit),
    )
    made = catalog.plan(planner, problem, stopwatch_s)
    if csv_file is not None:
        _write_csv(made, csv_file)
    if plot is not None:
        from rig.ui.plots.plan import draw_plan  # matplotlib takes its time

        picture_file.save(draw_plan(made), plot)
    if as_json:
        print_json(_document(made))
    else:
        out.print(_table(made))
        for reason in made.reasons:
            out.print(f"over limits: {reason}", style="yellow")
    return REFUSED if made.reasons else 0


def _numbers(option: str, text: str | None) -> list[float]:
    try:
        return [float(word) for word in (text or "").split(",") if word.strip()]
    except ValueError:
        raise ConfigError(
            f"{option} {text!r}; must be numbers with commas, one for each joint: e.g. {option} 10,10"
        ) from None


def _states(option: str, texts: list[str]) -> dict[str, float]:
    states: dict[str, float] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name.strip() in states:
            raise ConfigError(f"{option} {name.strip()} twice; must be once: leave one out")
        try:
            states[name.strip()] = float(value)
        except ValueError:
            raise ConfigError(
                f"{option} {text!r}; must be state=value: e.g. {option} angle_rad=0.05"
            ) from None
    return states


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
    n, cart = p.model.links_count, cart_for_input(p.input)
    load = (
        f"{n} links"
        if isinstance(p.model, ChainModel)
        else f"cable {p.model.parameters['length']:g} m"
    )
    robust = f", robust to {', '.join(p.robust)}" if p.robust else ""
    robust += ", nonlinear" if p.nonlinear else ""
    table = Table(
        title=f"{made.planner}: {p.distance_m:g} m in {p.time_s:g} s, {load}, {p.input} input{robust}",
        title_justify="left",
    )
    table.add_column("")
    table.add_column("", justify="right")
    rows = (
        (
            f"modes, platform {cart}",
            ", ".join(f"{hz:.4f} Hz" for hz in p.model.modes(cart).natural_frequencies_hz),
        ),
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
        ("computed in", f"{(made.compute_s or 0) * 1e3:.2f} ms"),
        ("status", made.status.value),
    )
    for row in rows:
        table.add_row(*row)
    return table


def _write_csv(made: Plan, path: Path) -> None:
    end_s = made.motion.duration_s
    t = np.append(np.arange(0.0, end_s - TABLE_SAMPLE_S * 1e-6, TABLE_SAMPLE_S), end_s)
    columns = np.column_stack([t, *(made.motion.x.at(t, order) for order in range(3))])
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t_s", "position_m", "speed_m_s", "acceleration_m_s2"])
        rows.writerows([f"{value:.9g}" for value in row] for row in columns)
