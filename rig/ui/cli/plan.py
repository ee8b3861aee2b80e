"""`rig plan`: plan of a move, with predicted residual swing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from comms.clock import stopwatch_s
from planners import catalog
from planners.laws import LAWS
from planners.models.model import INPUTS, LAG_S
from planners.problem import Limits, Plan, Problem
from rig.errors import REFUSED, ConfigError
from rig.run.config import LimitsSection, ModelSection
from rig.run.load_model import build_model
from rig.run.units import CABLE, MOVE, SWING, key_unit, suspect
from rig.ui.cli import completion, plan_tables
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import print_paragraph, print_table, print_written
from rig.ui.plots import picture_file

WARM_S = 0.5  # a plan that takes less is timed again


def plan(
    planner: Annotated[
        str,
        typer.Option(
            help=f"Planner: {', '.join(catalog.PLANNERS)}.", autocompletion=completion.planners
        ),
    ] = "matrix_exponential",
    distance: Annotated[float, typer.Option(help="Distance \\[m].")] = 0.2,
    time: Annotated[float, typer.Option(help="Duration of the move \\[s], > 0.")] = 1.5,
    length: Annotated[
        float | None, typer.Option(help="Cable length of the model \\[m]; 1 without --links.")
    ] = None,
    damping: Annotated[
        float, typer.Option(help="Damping ratio of every mode of the model, 0 to 1.")
    ] = 0.0,
    model: Annotated[
        str, typer.Option(help=f"Input of the model: {', '.join(INPUTS)}.")
    ] = "acceleration",
    robust: Annotated[
        list[str] | None,
        typer.Option(
            help="Parameters with zero sensitivity of the end state, e.g. length, length_1, "
            "stiffness_1; separated by commas, or repeated.",
        ),
    ] = None,
    links: Annotated[
        str | None,
        typer.Option(
            help="Chain of links instead of a cable, length:mass:kind in m and kg, "
            "e.g. 0.5:3.375:bar,0.5:3.375:bar.",
        ),
    ] = None,
    stiffness: Annotated[
        str | None,
        typer.Option(
            help="Stiffness of each joint between links [N m/rad], separated by commas; "
            "0 by default.",
        ),
    ] = None,
    joint_damping: Annotated[
        str | None,
        typer.Option(
            help="Damping of each joint between links [N m s/rad], separated by commas; "
            "0 by default."
        ),
    ] = None,
    tip_mass: Annotated[
        float, typer.Option(help="Point mass at the end of the chain \\[kg].")
    ] = 0.0,
    mass: Annotated[
        float | None,
        typer.Option(
            help="Mass of the load on a cable \\[kg], used by --model force; 0.7 by default."
        ),
    ] = None,
    cart_mass: Annotated[
        float, typer.Option(help="Mass of the platform \\[kg], used by --model force.")
    ] = ModelSection().cart_mass_kg,
    law: Annotated[
        str,
        typer.Option(
            help=f"Motion law of a shaper or of planner law: {', '.join(LAWS)}.",
            autocompletion=completion.laws,
        ),
    ] = "harmonic",
    nonlinear: Annotated[
        bool,
        typer.Option(
            "--nonlinear", help="Plan for the nonlinear pendulum instead of small swings."
        ),
    ] = False,
    start: Annotated[
        list[str] | None,
        typer.Option(
            help="State at the start, e.g. angle_rad=0.05; repeatable; at rest by default."
        ),
    ] = None,
    goal: Annotated[
        list[str] | None,
        typer.Option(help="State at the end, like --start; at rest by default."),
    ] = None,
    weight: Annotated[
        list[str] | None,
        typer.Option(
            help="Weight of a squared state relative to the squared input, e.g. angle_rad=50; "
            "repeatable; 0 by default.",
        ),
    ] = None,
    speed_limit: Annotated[
        float, typer.Option(help="Speed limit \\[m/s].")
    ] = LimitsSection().speed_m_s,
    acceleration_limit: Annotated[
        float, typer.Option(help="Acceleration limit \\[m/s²].")
    ] = LimitsSection().acceleration_m_s2,
    lag: Annotated[
        float | None,
        typer.Option(help=f"Time constant of --model jerk \\[s]; {LAG_S:.4g} by default."),
    ] = None,
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", help="CSV file: time, position, speed, acceleration every 10 ms."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Figure file of move and swing: .svg, .png or .pdf.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Plan a move along X and predict its peak demand and residual swing.

    Exit code 3 when the plan exceeds a limit.
    """
    _check_not_empty("--links", links)
    _check_not_empty("--stiffness", stiffness)
    _check_not_empty("--joint-damping", joint_damping)
    if links is not None:
        _check_chain_alone(links, length, mass)
    robust_names = _robust_names(robust or [])
    start_state = _states("--start", start or [])
    goal_state = _states("--goal", goal or [])
    _suspect_units(distance, length, {"--start": start_state, "--goal": goal_state})
    if plot is not None:
        picture_file.check(plot)
    if csv_file is not None:
        picture_file.check_folder("--csv", csv_file)
    section = ModelSection(
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
        model=build_model(section),
        input=model,
        lag_s=LAG_S if lag is None else lag,
        robust=robust_names,
        law=law,
        nonlinear=nonlinear,
        start_state=start_state,
        goal_state=goal_state,
        state_weights=_states("--weight", weight or []),
        limits=Limits(speed_m_s=speed_limit, acceleration_m_s2=acceleration_limit),
    )
    result = catalog.plan(planner, problem, stopwatch_s)
    if (result.compute_s or 0.0) < WARM_S:  # the first plan imports what it needs: time a second
        result = catalog.plan(planner, problem, stopwatch_s)
    if csv_file is not None:
        plan_tables.write_csv(result, csv_file)
    if plot is not None:
        from rig.ui.plots.plan import draw_plan  # matplotlib is slow to import

        picture_file.save(draw_plan(result), plot)
    if as_json:
        print_json(plan_tables.document(result))
    else:
        _print_plan(result)
        for reason in result.reasons:
            print_paragraph(f"over limits: {reason}", "yellow", "  ")
        print_written(csv_file, plot)
    return REFUSED if result.reasons else 0


def _print_plan(result: Plan) -> None:
    p = result.problem
    if p.distance_m == 0.0 and not p.start_state and not p.goal_state:
        print_paragraph("--distance 0: nothing is to be done, the platform stands still")
    else:
        print_table(plan_tables.plan_table(result))


def _check_not_empty(option: str, text: str | None) -> None:
    if text is not None and not text.strip():
        raise ConfigError(f"{option} ''; must not be empty: omit the option")


def _suspect_units(
    distance: float, length: float | None, states: dict[str, dict[str, float]]
) -> None:
    """Warn of centimetres and degrees; raises ConfigError where no laboratory has the value."""
    suspect("--distance", distance, MOVE)
    if length is not None:
        suspect("--length", length, CABLE)
    for option, values in states.items():
        for name, value in values.items():
            if key_unit(name) == "rad":
                suspect(f"{option} {name} =", value, SWING)


def _check_chain_alone(links: str, length: float | None, mass: float | None) -> None:
    """Check that no option of a cable is given with --links; raises ConfigError."""
    if length is not None:
        raise ConfigError(
            f"--length {length:g} with --links {links}; must be one of the two: omit one"
        )
    if mass is not None:
        raise ConfigError(
            f"--mass {mass:g} with --links {links}; must be one of the two: "
            "each link has its own mass, omit --mass"
        )


def _robust_names(texts: list[str]) -> tuple[str, ...]:
    """Split comma lists of parameters; raises ConfigError for an empty or repeated name."""
    names = [name.strip() for text in texts for name in text.split(",")]
    if not all(names) or len(set(names)) < len(names):
        raise ConfigError(
            f"--robust {', '.join(texts)!r}; must name each parameter once: e.g. --robust length"
        )
    return tuple(names)


def _numbers(option: str, text: str | None) -> list[float]:
    """Parse a comma list of numbers; raises ConfigError."""
    try:
        return [float(word) for word in (text or "").split(",") if word.strip()]
    except ValueError:
        raise ConfigError(
            f"{option} {text!r}; must be numbers separated by commas, one for each joint: "
            f"e.g. {option} 10,10"
        ) from None


def _states(option: str, texts: list[str]) -> dict[str, float]:
    """Parse state=value, each state once; raises ConfigError."""
    states: dict[str, float] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name.strip() in states:
            raise ConfigError(f"{option} {name.strip()} twice; must be once: omit one")
        try:
            states[name.strip()] = float(value)
        except ValueError:
            raise ConfigError(
                f"{option} {text!r}; must be state=value: e.g. {option} angle_rad=0.05"
            ) from None
    return states
