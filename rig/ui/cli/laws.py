"""`rig laws`: list, comparison under limits, and figures of motion laws."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.text import Text

from planners.errors import unknown_name
from planners.laws import LAWS
from planners.laws.catalogue import Coefficients, catalogue
from planners.laws.rect_cascade import LIMITS
from planners.models.pendulum import PendulumModel
from planners.spectra.swing_free import swing_free_cycles
from rig.errors import ConfigError
from rig.run.config import LimitsSection, ModelSection
from rig.run.units import CABLE, suspect
from rig.studies.laws_under_limits import DERIVATIVE_NAMES, LawMove, law_move, period_s
from rig.studies.published_laws import FIGURES, PUBLISHED, wrong_figures
from rig.ui.cli import completion
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json, working
from rig.ui.cli.page import (
    Column,
    PageTable,
    plain_table,
    print_paragraph,
    print_table,
    print_written,
)

HEADERS = ("Cv", "Ca", "Cv rms", "Ca rms")
CATALOGUE_COLUMNS = (
    "law",
    Column("class", drop=3),
    "Cv",
    "Ca",
    Column("Cv rms", drop=2),
    Column("Ca rms", drop=1),
    "zero residual at T/Tn",
)
PUBLISHED_COLUMNS = ("law", "", *HEADERS, "note")
CYCLES = 6.0  # longest zero-residual-vibration duration searched [load periods]
SHOWN_DURATIONS = 3  # zero-residual-vibration durations listed for a law
MOVES_COLUMNS = (
    "law\n",
    Column("class\n", drop=2),
    Column("active\nlimits\n", drop=4),
    "minimum\ntime\n[s]",
    "peak\nspeed\n[m/s]",
    "peak\nacceleration\n[m/s²]",
    Column("peak\njerk\n[m/s³]", drop=3),
    "residual\namplitude\n[mrad]",
    Column("nonlinear\nresidual\n[mrad]", drop=1),
    "zero-residual\nduration\n[s]",
)
LEGEND = (
    "Cv = max |speed| T/h, Ca = max |acceleration| T²/h over a move of h in the time T; "
    "rms over the move.",
    "class Cn: derivatives up to n are continuous. zero residual: an undamped load of period Tn "
    "is at rest after a move of T = (T/Tn) Tn.",
    "elliptic: axis ratio 1.2. trapezoidal, double_s, fifteen_segments: ramps of T/3, "
    "jerk phases of half a ramp, snap phases of half of that.",
)
MOVES_LEGEND = (
    "residual amplitude: amplitude of the residual swing after the minimum time, small swings; "
    "nonlinear residual: on the nonlinear pendulum.",
    "zero-residual duration: shortest duration >= the minimum time without residual swing "
    "(small swings, the law scaled in time).",
    "*: segments adapted to these limits, hence time-optimal within its family. "
    "The other laws keep their shape.",
)

app = typer.Typer(invoke_without_command=True)


@app.callback(invoke_without_command=True)
def laws(
    context: typer.Context,
    published: Annotated[
        bool, typer.Option("--published", help="Compare with the figures printed in source 000.")
    ] = False,
    as_json: AsJson = False,
) -> int:
    """List motion laws: continuity, peak and rms coefficients, zero-residual durations.

    Cv = max |speed| T/h and Ca = max |acceleration| T²/h over a move of h in the time T;
    rms over the move. All figures are exact.
    """
    if context.invoked_subcommand:
        if published or as_json:
            raise ConfigError(
                f"--published or --json before '{context.invoked_subcommand}'; "
                "must stand after it: move the option"
            )
        return 0
    rows = catalogue()
    if as_json:
        print_json([_document(row, published) for row in rows])
    elif published:
        _print_published(rows)
    else:
        _print_catalogue(rows)
    return 0


@app.command()
def compare(
    distance: Annotated[float, typer.Option(help="Distance \\[m], not 0.")] = 0.2,
    vmax: Annotated[
        float, typer.Option(help="Speed limit \\[m/s], > 0.")
    ] = LimitsSection().speed_m_s,
    amax: Annotated[
        float, typer.Option(help="Acceleration limit \\[m/s²], > 0.")
    ] = LimitsSection().acceleration_m_s2,
    jmax: Annotated[
        float | None, typer.Option(help="Jerk limit \\[m/s³], > 0; unlimited by default.")
    ] = None,
    smax: Annotated[
        float | None, typer.Option(help="Snap limit \\[m/s⁴], > 0; unlimited by default.")
    ] = None,
    load_length: Annotated[
        float, typer.Option(help="Cable length of the load \\[m].")
    ] = ModelSection().cable_m,
    as_json: AsJson = False,
) -> int:
    """Compare the minimum time, peaks and residual swing of every law under limits."""
    limits = (vmax, amax, math.inf if jmax is None else jmax, math.inf if smax is None else smax)
    _check(distance, limits)
    suspect("--load-length", load_length, CABLE)
    load = PendulumModel(length_m=load_length)
    with working("fitting every law to the limits"):
        moves = [law_move(name, distance, limits, load) for name in LAWS]
    moves.sort(key=lambda move: move.time_s)
    if as_json:
        print_json(
            {
                "distance_m": distance,
                **dict(zip(LIMITS, limits, strict=True)),
                "load_length_m": load_length,
                "load_period_s": period_s(load),
                "laws": [move._asdict() for move in moves],
            }
        )
    else:
        title = f"{distance:g} m, cable {load_length:g} m, load period {period_s(load):.4f} s"
        _print_moves(moves, title)
    return 0


def _print_moves(moves: list[LawMove], title: str) -> None:
    print_table(_moves_table([move for move in moves if not move.reason], title))
    excluded: dict[str, list[str]] = {}
    for move in moves:
        if move.reason:
            excluded.setdefault(move.reason, []).append(move.name)
    for reason, names in excluded.items():
        line = f"not within the limits: {', '.join(names)}: {reason}"
        print_paragraph(line, "yellow", "  ")
    for line in MOVES_LEGEND:
        print_paragraph(line, "dim")


@app.command()
def plot(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Laws to draw; all by default.", autocompletion=completion.laws),
    ] = None,
    path: Annotated[Path, typer.Option("--plot", help="Figure file: .svg, .png or .pdf.")] = Path(
        "laws.svg"
    ),
    as_json: AsJson = False,
) -> int:
    """Draw position, speed, acceleration, jerk and acceleration spectrum of laws."""
    chosen = list(dict.fromkeys(names or LAWS))
    for name in chosen:
        if name not in LAWS:
            raise unknown_name("law", name, LAWS)
    from rig.ui.plots import picture_file  # matplotlib is slow to import
    from rig.ui.plots.laws import draw_laws

    picture_file.check(path)
    with working("drawing the laws"):
        picture_file.save(draw_laws(chosen), path)
    if as_json:
        print_json({"file": str(path), "laws": chosen})
    else:
        print_written(path)
    return 0


def _check(distance: float, limits: tuple[float, ...]) -> None:
    """Check the options of a comparison; raises ConfigError."""
    if not 0.0 < abs(distance) < math.inf:
        raise ConfigError(f"--distance {distance}; must be finite and not 0: give m")
    for option, value in zip(("--vmax", "--amax", "--jmax", "--smax"), limits, strict=True):
        if not value > 0.0:
            raise ConfigError(
                f"{option} {value}; must be > 0: give the magnitude of the limit, "
                "or omit the option"
            )
    if not any(map(math.isfinite, limits)):
        raise ConfigError(
            "--vmax inf --amax inf; one limit at least must be finite: "
            "the minimum time would be 0 s without any, give one"
        )


def _document(row: Coefficients, published: bool) -> dict[str, Any]:
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
    with working("computing the zero-residual-vibration durations"):
        free = [swing_free_cycles(LAWS[row.name](1.0), CYCLES) for row in rows]
    view = plain_table("Motion laws from rest to rest", CATALOGUE_COLUMNS, left=2)
    for row, zeros in zip(rows, free, strict=True):
        figures = (f"{getattr(row, key):.6f}" for key in FIGURES)
        durations = "  ".join(f"{zero:.4f}" for zero in zeros[:SHOWN_DURATIONS].tolist())
        view.add_row(row.name, row.continuity, *figures, durations)
    print_table(view)
    for line in LEGEND:
        print_paragraph(line, "dim")


def _print_published(rows: list[Coefficients]) -> None:
    title = "Coefficients: printed in source 000, and computed"
    view = plain_table(title, PUBLISHED_COLUMNS, left=2)
    notes: dict[str, int] = {}  # reason of a difference: its number below the table
    for row in rows:
        source = PUBLISHED.get(row.name)
        if source is None:
            continue
        wrong = wrong_figures(row)
        printed = []
        for key, figure in zip(FIGURES, source.figures, strict=True):
            mark, style = ("≠", "yellow") if key in wrong else (" ", "")
            printed.append(Text(f"{figure:.4f}{mark}", style))
        computed = (f"{getattr(row, key):.6f} " for key in FIGURES)
        note = ""
        if source.reason:
            note = str(notes.setdefault(source.reason, len(notes) + 1))
        view.add_row(row.name, "printed", *printed, note)
        view.add_row("", "computed", *computed, "", end_section=True)
    print_table(view)
    for reason, number in notes.items():
        print_paragraph(f"  {number}. {reason}", "dim", "     ")
    absent = ", ".join(name for name in LAWS if name not in PUBLISHED)
    print_paragraph(f"≠: differs by more than rounding. Not in source 000: {absent}.", "dim")


def _moves_table(moves: list[LawMove], title: str) -> PageTable:
    view = plain_table(title, MOVES_COLUMNS, left=3)
    for m in moves:
        view.add_row(
            m.name,
            m.continuity,
            ", ".join(DERIVATIVE_NAMES[LIMITS.index(key)] for key in m.meets),
            f"{m.time_s:.6f}{' ' if m.shape == 'fixed' else '*'}",
            f"{m.peak_speed_m_s:.4f}",
            f"{m.peak_acceleration_m_s2:.4f}",
            "∞" if math.isinf(m.peak_jerk_m_s3) else f"{m.peak_jerk_m_s3:.3f}",
            f"{m.residual_swing_rad * 1e3:.3f}",
            f"{m.residual_swing_nonlinear_rad * 1e3:.3f}",
            "-" if math.isnan(m.swing_free_time_s) else f"{m.swing_free_time_s:.4f}",
        )
    return view
