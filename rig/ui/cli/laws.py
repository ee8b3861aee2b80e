"""`rig laws`: the catalogue of motion laws, what each can do under limits, and their picture."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from planners.errors import unknown_name
from planners.laws import LAWS
from planners.laws.catalogue import Coefficients, catalogue
from planners.laws.rect_cascade import LIMITS
from planners.models.pendulum import PendulumModel
from planners.spectra.swing_free import swing_free_cycles
from rig.errors import ConfigError
from rig.run.config import LimitsSection, ModelSection
from rig.studies.laws_under_limits import DERIVATIVE_NAMES, LawMove, law_move, period_s
from rig.studies.published_laws import FIGURES, PUBLISHED, wrong_figures
from rig.ui.cli.output import PLAIN, out, print_json, wide, working

HEADERS = ("Cv", "Ca", "Cv rms", "Ca rms")
CYCLES = 6.0  # load periods up to which the catalogue tells swing-free durations
SHOWN = 3  # of them
MOVES_COLUMNS = (
    ("law", ""),
    ("class", ""),
    ("least time", "[s]"),
    ("meets", ""),
    ("speed", "[m/s]"),
    ("acceleration", "[m/s²]"),
    ("jerk", "[m/s³]"),
    ("swing left", "[mrad]"),
    ("nonlinear", "[mrad]"),
    ("no swing in", "[s]"),
)
LEGEND = (
    "Cv = max |speed| T/h, Ca = max |acceleration| T²/h, rms over the move of h in the time T. Cn: derivative n has no step.",
    "A load of period Tn without damping is left at rest when T/Tn is one of the last column (T: the duration of the move).",
    "elliptic: axis ratio 1.2. trapezoidal, double_s, fifteen_segments: ramps of T/3, half of them jerk, half of that snap.",
)
MOVES_LEGEND = (
    "swing left: amplitude of the free swing after the least time; nonlinear: on the true pendulum.",
    "no swing in: the next longer duration (small swings, the law's times stretched alike) that leaves none.",
    "*: its segments chosen for these limits: the least time of all laws of its kind. The others keep their shape.",
)

app = typer.Typer(invoke_without_command=True)
Json = Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")]


@app.callback(invoke_without_command=True)
def laws(
    context: typer.Context,
    published: Annotated[
        bool, typer.Option("--published", help="Beside the figures that source 000 prints.")
    ] = False,
    as_json: Json = False,
) -> int:
    """Motion laws: continuity, peaks and root mean squares, durations that leave no swing.

    Cv = max |speed| T/h, Ca = max |acceleration| T²/h over a move of h in the time T; rms over the move; all exact.
    """
    if context.invoked_subcommand:
        if published or as_json:
            raise ConfigError(
                f"--published or --json before '{context.invoked_subcommand}'; must stand after it: move it"
            )
        return 0
    rows = catalogue()
    if as_json:
        print_json([_row(row, published) for row in rows])
    elif published:
        _print_published(rows)
    else:
        _print_catalogue(rows)
    return 0


@app.command()
def compare(
    distance: Annotated[float, typer.Option(help="Distance in m, not 0.")] = 0.2,
    vmax: Annotated[float, typer.Option(help="Limit on speed in m/s.")] = LimitsSection().speed_m_s,
    amax: Annotated[
        float, typer.Option(help="Limit on acceleration in m/s².")
    ] = LimitsSection().acceleration_m_s2,
    jmax: Annotated[
        float | None, typer.Option(help="Limit on jerk in m/s³; none unless given.")
    ] = None,
    smax: Annotated[
        float | None, typer.Option(help="Limit on snap in m/s⁴; none unless given.")
    ] = None,
    load_length: Annotated[
        float, typer.Option(help="Cable of the load in m.")
    ] = ModelSection().cable_m,
    as_json: Json = False,
) -> int:
    """The least time of every law under limits, the peaks it reaches, and the swing it leaves on a cable."""
    limits = (vmax, amax, math.inf if jmax is None else jmax, math.inf if smax is None else smax)
    _check(distance, limits)
    load = PendulumModel(length_m=load_length)
    with working("fitting every law to the limits"):
        moves = [law_move(name, distance, limits, load) for name in LAWS]
    moves.sort(key=lambda move: move.time_s)
    if as_json:
        document: dict[str, object] = {
            "distance_m": distance,
            **dict(zip(LIMITS, limits, strict=True)),
        }
        document |= {"load_length_m": load_length, "load_period_s": period_s(load)}
        print_json(document | {"laws": [move._asdict() for move in moves]})
    else:
        kept = [move for move in moves if not move.reason]
        wide.print(
            _moves_table(
                kept,
                f"{distance:g} m, cable {load_length:g} m with a period of {period_s(load):.4f} s",
            )
        )
        for reason in dict.fromkeys(move.reason for move in moves if move.reason):
            out.print(
                f"not kept by {', '.join(move.name for move in moves if move.reason == reason)}: {reason}",
                style="yellow",
            )
        out.print("\n".join(MOVES_LEGEND), style="dim")
    return 0


@app.command()
def plot(
    names: Annotated[
        list[str] | None, typer.Argument(help="Laws to draw over each other; all in rows without.")
    ] = None,
    path: Annotated[
        Path, typer.Option("--plot", help="The file to draw into: .svg, .png or .pdf.")
    ] = Path("laws.svg"),
    as_json: Json = False,
) -> int:
    """Position, speed, acceleration, jerk and acceleration spectrum of laws, as a picture."""
    chosen = list(dict.fromkeys(names or LAWS))
    for name in chosen:
        if name not in LAWS:
            raise unknown_name("law", name, LAWS)
    from rig.ui.plots import picture_file  # matplotlib takes its time
    from rig.ui.plots.laws import draw_laws

    picture_file.check(path)
    with working("drawing the laws"):
        picture_file.save(draw_laws(chosen), path)
    if as_json:
        print_json({"file": str(path), "laws": chosen})
    else:
        out.print(f"{len(chosen)} laws drawn into {path}")
    return 0


def _check(distance: float, limits: tuple[float, ...]) -> None:
    if not 0.0 < abs(distance) < math.inf:
        raise ConfigError(f"--distance {distance}; must be finite and not 0: give the way in m")
    for option, value in zip(("--vmax", "--amax", "--jmax", "--smax"), limits, strict=True):
        if not value > 0.0:
            raise ConfigError(
                f"{option} {value}; must be > 0: give the size of the limit, or leave it out"
            )
    if not any(map(math.isfinite, limits)):
        raise ConfigError(
            "--vmax inf --amax inf; one limit at least must be finite: the least time would be 0 s"
        )


def _row(row: Coefficients, published: bool) -> dict[str, Any]:
    plain: dict[str, Any] = {
        "name": row.name,
        **{key: getattr(row, key) for key in FIGURES},
        "continuity": row.continuity,
    }
    if published:
        source = PUBLISHED.get(row.name)
        plain["published"] = dict(zip(FIGURES, source.figures, strict=True)) if source else None
        plain["wrong"] = wrong_figures(row)
        plain["reason"] = source.reason if source else ""
    return plain


def _print_catalogue(rows: list[Coefficients]) -> None:
    with working("finding the durations that leave no swing"):
        free = [swing_free_cycles(LAWS[row.name](1.0), CYCLES)[:SHOWN] for row in rows]
    view = Table(title="Motion laws from rest to rest", **PLAIN)
    for header in ("law", "class", *HEADERS, "no swing at T/Tn"):
        view.add_column(
            header, justify="left" if header in ("law", "class") else "right", no_wrap=True
        )
    for row, zeros in zip(rows, free, strict=True):
        figures = (f"{getattr(row, key):.6f}" for key in FIGURES)
        view.add_row(
            row.name, row.continuity, *figures, "  ".join(f"{zero:.4f}" for zero in zeros.tolist())
        )
    wide.print(view)
    out.print("\n".join(LEGEND), style="dim")


def _print_published(rows: list[Coefficients]) -> None:
    view = Table(title="Coefficients as source 000 prints them, and right", **PLAIN)
    for header in ("law", "", *HEADERS, ""):
        view.add_column(header, justify="right" if header in HEADERS else "left", no_wrap=True)
    for row in rows:
        source, wrong = PUBLISHED.get(row.name), wrong_figures(row)
        if source is None:
            continue
        printed = (
            Text(f"{figure:.4f}{'≠' if key in wrong else ' '}", "yellow" if key in wrong else "")
            for key, figure in zip(FIGURES, source.figures, strict=True)
        )
        view.add_row(row.name, "printed", *printed, source.reason)
        view.add_row(
            "", "right", *(f"{getattr(row, key):.6f} " for key in FIGURES), "", end_section=True
        )
    wide.print(view)
    absent = ", ".join(name for name in LAWS if name not in PUBLISHED)
    out.print(f"≠: more than rounding off. Not in its table: {absent}.", style="dim")


def _moves_table(moves: list[LawMove], title: str) -> Table:
    view = Table(title=title, **PLAIN)
    for header, unit in MOVES_COLUMNS:
        left = header in ("law", "class", "meets")
        view.add_column(f"{header}\n{unit}", justify="left" if left else "right", no_wrap=True)
    for m in moves:
        view.add_row(
            m.name,
            m.continuity,
            f"{m.time_s:.6f}{' ' if m.shape == 'fixed' else '*'}",
            ", ".join(DERIVATIVE_NAMES[LIMITS.index(key)] for key in m.meets),
            f"{m.peak_speed_m_s:.4f}",
            f"{m.peak_acceleration_m_s2:.4f}",
            "∞" if math.isinf(m.peak_jerk_m_s3) else f"{m.peak_jerk_m_s3:.3f}",
            f"{m.residual_swing_rad * 1e3:.3f}",
            f"{m.residual_swing_nonlinear_rad * 1e3:.3f}",
            "-" if math.isnan(m.swing_free_time_s) else f"{m.swing_free_time_s:.4f}",
        )
    return view
