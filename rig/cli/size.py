"""`rig size`: whether a ball screw fits an axis, with every margin, and which of a catalogue do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from planners.drives.screw.cycle import Cycle
from planners.drives.screw.limits import absolute_least_lead
from planners.drives.screw.table import Row
from planners.drives.screw.verdict import BROKEN, NOT_ASKED, UNDECIDED, Assessment
from planners.errors import unknown_name
from rig.cli.output import COLOUR, out, print_json, wide
from rig.config import read_toml
from rig.errors import REFUSED, ConfigError
from rig.sizing import EXAMPLES, Sizing, example_tables, sizing_of
from rig.sizing_document import Judgement, document, judge
from rig.sizing_notes import notes
from rig.sizing_published import Comparison

LEAST_MARGIN = -10.0  # below, only that it is
WITHOUT_BOUND = {NOT_ASKED: "any", UNDECIDED: "not told"}


def size(
    file: Annotated[
        Path | None,
        typer.Argument(help="TOML with the sections axis, screw and move, and more if wanted.", metavar="SPEC.toml"),
    ] = None,
    example: Annotated[
        str | None, typer.Option(help=f"A worked axis of source 004 instead of a file: {' or '.join(EXAMPLES)}.")
    ] = None,
    entry: Annotated[
        str | None, typer.Option(help="Judge this entry of the catalogue instead of the spec's choice.", metavar="NAME")
    ] = None,
    published: Annotated[
        bool, typer.Option("--published", help="Show all figures that a source prints, not only those that are wrong.")
    ] = False,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the region of diameters and leads with the catalogue: .svg, .png or .pdf.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")] = False,
) -> int:
    """Size a ball-screw axis: speed, buckling, life, lead, stiffness and motor, with margins; exit 3 when the choice fails.

    Give a SPEC.toml or --example; without a choice in it the catalogue is searched, and exit 3 says that nothing fits.
    """
    sizing = _read(file, example)
    if entry is not None:
        if entry not in sizing.catalogue:
            raise unknown_name("--entry", entry, sizing.catalogue)
        other = sizing.catalogue[entry]
        sizing = sizing._replace(choice=other, published=sizing.published if other is sizing.choice else {})  # of the choice
    result = judge(sizing)
    if plot is not None:
        from rig import picture_file  # matplotlib takes its time
        from rig.sizing_figure import draw_region

        picture_file.save(draw_region(sizing.axis, result.found, result.chosen), plot)
    if as_json:
        print_json(document(result))
    else:
        _print(result, every=published)
    return 0 if result.admissible else REFUSED


def _read(file: Path | None, example: str | None) -> Sizing:
    if file is not None and example is not None:
        raise ConfigError(f"--example {example} with file '{file}'; must be one of the two: leave one out")
    if file is None and example is None:
        raise ConfigError(f"SPEC.toml: missing; give a file, or look at --example {EXAMPLES[0]}")
    return sizing_of(read_toml(file, "sizing") if file is not None else example_tables(example or ""))


def _print(result: Judgement, every: bool) -> None:
    axis, judged, need = result.sizing.axis, result.judged, result.sizing.axis.demand
    least = absolute_least_lead(axis.mounting, need.peak_speed_m_s, axis.shares.whirl, axis.balls_m_rpm())
    out.print(
        f"cycle of {axis.cycle.duration_s:g} s over {need.travel_m:g} m: at most {need.peak_speed_m_s:.6g} m/s, "
        f"{need.peak_acceleration_m_s2:.6g} m/s², {need.peak_force_n:.6g} N"
    )
    out.print(f"least lead of all screws: {least.lead_m:.5g} m, at a diameter of {least.diameter_m:.5g} m")
    if judged:
        wide.print(_checks(judged, "" if result.chosen else "best that fits: "))
        wide.print(_motion(result.motion, axis.cycle))
        for note in notes(axis, judged, result.figures):
            out.print(note.text, style="dim" if note.dim else "")
    _print_catalogue(result.found)
    if result.printed:
        _print_published([row for row in result.printed if every or row.differs], result.printed)
    _print_verdict(result)


def _print_verdict(result: Judgement) -> None:
    name = f"{result.chosen.candidate.name}: " if result.chosen else ""
    words = {"good": "fits", "doubtful": "fits as far as the catalogue tells", "bad": "does not fit"}
    out.print(f"verdict: {name}{words[result.verdict]}", style=f"{COLOUR[result.verdict]} bold")
    for reason in result.reasons:
        out.print(f"  - {reason}")


def _checks(judged: Assessment, head: str) -> Table:
    candidate = judged.candidate
    title = f"{head}{candidate.name}: diameter {candidate.diameter_m:g} m, lead {candidate.lead_m:g} m"
    view = Table(title=title, title_justify="left")
    for name in ("", "value", "bound", "margin"):
        view.add_column(name, justify="right" if name else "left", no_wrap=True)
    for check in judged.checks:
        untold = "-" if check.state == NOT_ASKED else "not told"
        value = untold if check.value is None else f"{check.value:.6g} {check.unit}"
        sign = "≥" if check.at_least else "≤"
        bound = f"{sign} {check.bound:.6g} {check.unit}" if check.bound is not None else WITHOUT_BOUND[check.state]
        margin = "" if check.margin is None else _share(check.margin, digits=2)
        view.add_row(check.name, value, bound, margin, style={BROKEN: "red", UNDECIDED: "yellow"}.get(check.state, ""))
    return view


def _share(margin: float, digits: int) -> str:
    return f"{margin:+.{digits}%}" if margin >= LEAST_MARGIN else f"< {LEAST_MARGIN:.0%}"


def _motion(rows: Sequence[Row], cycle: Cycle) -> Table:
    """The motion-law table."""
    first = [cycle.moves.index(move) + 1 for move in cycle.counts]
    once = "" if len(first) == len(cycle.moves) else "; equal moves once"
    view = Table(title=f"the cycle, phase by phase of each move; .0 is its rest{once}", title_justify="left")
    for name in ("phase", "time\ns", "top speed\nm/s", "acceleration\nm/s²", "force\nN", "peak torque\nN m", "power\nW"):
        view.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        if row.move in first:
            cells = (
                row.duration_s,
                row.peak_speed_m_s,
                row.acceleration_m_s2,
                row.force_n,
                row.peak_torque_n_m,
                row.peak_power_w,
            )
            view.add_row(f"{row.move}.{row.phase}", *(f"{cell:.5g}" for cell in cells))
    return view


def _print_catalogue(found: Sequence[Assessment]) -> None:
    does = sum(a.admissible for a in found)
    out.print(f"catalogue: {does} of {len(found)} fit (diameter x lead in mm)")
    pad = max(len(a.candidate.name) for a in found)
    for a in found:
        head = f"  {a.candidate.name:<{pad}}  {1e3 * a.candidate.diameter_m:g} x {1e3 * a.candidate.lead_m:g}: "
        broken = "; ".join(
            f"{c.name} {c.value:.5g} {'<' if c.at_least else '>'} {c.bound:.5g} {c.unit} ({_share(c.margin or 0.0, 0)})"
            for c in a.broken
        )
        open_ones = ", ".join(c.name for c in a.undecided)
        margin = a.tightest.margin or 0.0
        fine = f"tightest is {a.tightest.name}, {_share(margin, 2)}" + (f"; not told: {open_ones}" if open_ones else "")
        told = "".join(f"; {check.note}" for check in a.checks if check.note and check.state != BROKEN)
        out.print(head + (f"breaks {broken}" if broken else fine) + told, style="" if broken else "green")
    for origin in dict.fromkeys(a.candidate.origin for a in found):
        names = ", ".join(a.candidate.name for a in found if a.candidate.origin == origin)
        out.print(f"  origin of {names}: {origin}", style="dim")


def _print_published(printed: Sequence[Comparison], compared: Sequence[Comparison]) -> None:
    reasons = list(dict.fromkeys(row.reason for row in printed if row.reason))
    title = f"{len(compared)} printed figures; {sum(row.differs for row in compared)} are not the right ones (≠)"
    view = Table(title=title, title_justify="left")
    for name in ("figure", "printed", "right", "", "why"):
        view.add_column(name, justify="left" if name == "figure" else "right", no_wrap=True)
    for row in printed:
        why = f"{reasons.index(row.reason) + 1}" if row.reason else ""
        view.add_row(row.name, row.printed, f"{row.right:.6g}", "≠" if row.differs else "", why)
    wide.print(view)
    for number, reason in enumerate(reasons, start=1):
        out.print(f"  {number}. {reason}", style="dim")
