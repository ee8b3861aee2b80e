"""`rig size`: whether a ball screw fits an axis, with every margin, and which of a catalogue do."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from planners.errors import unknown_name
from rig.drives.screw import digits
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.cycle import Cycle
from rig.drives.screw.digits import number
from rig.drives.screw.limits import absolute_least_lead
from rig.drives.screw.table import CyclePhaseRow
from rig.drives.screw.verdict import BROKEN, NOT_ASKED, UNDECIDED, Assessment
from rig.errors import REFUSED, ConfigError
from rig.run.toml_file import read_toml
from rig.studies.sizing.axis_file import EXAMPLES, Sizing, example_tables, sizing_of
from rig.studies.sizing.judgement import Judgement, document, judge
from rig.studies.sizing.notes import notes
from rig.studies.sizing.published import FigureComparison
from rig.ui.cli.output import COLOUR, out, print_json, wide

FAR = 10.0  # a margin beyond, of either sign, is only told to be
WITHOUT_BOUND = {NOT_ASKED: "any", UNDECIDED: "not told"}


def size(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="TOML with the sections axis, screw and move, and more if wanted.",
            metavar="SPEC.toml",
        ),
    ] = None,
    example: Annotated[
        str | None,
        typer.Option(
            help=f"A worked axis of source 004 instead of a file: {' or '.join(EXAMPLES)}."
        ),
    ] = None,
    entry: Annotated[
        str | None,
        typer.Option(
            help="Judge this entry of the catalogue instead of the spec's choice.", metavar="NAME"
        ),
    ] = None,
    published: Annotated[
        bool,
        typer.Option(
            "--published",
            help="Show all figures that a source prints, not only those that are wrong.",
        ),
    ] = False,
    every: Annotated[
        bool, typer.Option("--all", help="Tell what each refused entry breaks, and by how much.")
    ] = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Draw the region of diameters and leads with the catalogue: .svg, .png or .pdf."
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
) -> int:
    """Size a ball-screw axis: speed, buckling, life, lead, stiffness and motor, with margins; exit 3 when the choice fails.

    Give a SPEC.toml or --example; without a choice in it the best of the catalogue is judged, the one with the greatest least
    margin, and exit 3 says that nothing fits.
    """
    sizing = _read(file, example)
    if entry is not None:
        if entry not in sizing.catalogue:
            raise unknown_name("--entry", entry, sizing.catalogue)
        other = sizing.catalogue[entry]
        sizing = sizing._replace(
            choice=other, published=sizing.published if other is sizing.choice else {}
        )  # of the choice
    result = judge(sizing)
    if plot is not None:
        from rig.ui.plots import picture_file  # matplotlib takes its time
        from rig.ui.plots.screw_chart import draw_region

        picture_file.save(draw_region(sizing.axis, result.found, result.judged), plot)
    if as_json:
        print_json(document(result))
    else:
        _print(result, every, published)
    return 0 if result.admissible else REFUSED


def _read(file: Path | None, example: str | None) -> Sizing:
    if file is not None and example is not None:
        raise ConfigError(
            f"--example {example} with file '{file}'; must be one of the two: leave one out"
        )
    if file is None and example is None:
        raise ConfigError(f"SPEC.toml: missing; give a file, or look at --example {EXAMPLES[0]}")
    return sizing_of(
        read_toml(file, "sizing") if file is not None else example_tables(example or "")
    )


def _print(result: Judgement, every: bool, figures: bool) -> None:
    axis, judged, need = result.sizing.axis, result.judged, result.sizing.axis.demand
    least = absolute_least_lead(
        axis.mounting, need.peak_speed_m_s, axis.utilisation.whirl, axis.balls_m_rpm()
    )
    _say(
        f"cycle of {axis.cycle.duration_s:g} s over {digits.mm(need.travel_m)}: at most {number(need.peak_speed_m_s)} m/s, "
        f"{number(need.peak_acceleration_m_s2)} m/s², {number(need.peak_force_n)} N"
    )
    _say(
        f"least lead of all screws: {digits.mm(least.lead_m)}, at a diameter of {digits.mm(least.diameter_m)}"
    )
    wide.print(_checks(judged, _place(result)))
    _say(
        "margin: how far the value is on the safe side of its bound, over the bound; below 0 it is broken",
        "dim",
    )
    wide.print(_motion(result.motion, axis.cycle))
    for note in notes(axis, judged, result.figures):
        _say(note.text, "dim" if note.dim else "")
    _print_catalogue(result, every)
    if result.printed:
        _print_published([row for row in result.printed if figures or row.differs], result.printed)
    _print_verdict(result)


def _say(text: str, style: str = "", hang: str = "") -> None:
    """A paragraph as wide as the terminal, its further lines indented as `hang`."""
    whole = text.replace("N m", "N\N{NO-BREAK SPACE}m")
    lines = textwrap.wrap(
        whole, out.width, subsequent_indent=hang, break_long_words=False, break_on_hyphens=False
    )
    out.print("\n".join(lines).replace("\N{NO-BREAK SPACE}", " "), style=style)


def _place(result: Judgement) -> str:
    """How the judged screw was found; empty for a choice."""
    if result.chosen:
        return ""
    return (
        f"best of the {result.fitting} that fit"
        if result.fitting
        else f"nearest of {len(result.found)}, of which none fits"
    )


def _print_verdict(result: Judgement) -> None:
    place = "" if result.chosen else f", {_place(result)} ({result.criterion})"
    words = {
        "good": "fits",
        "doubtful": "fits as far as the catalogue tells",
        "bad": "does not fit",
    }
    line = f"verdict: {result.judged.candidate.name}{place}: {words[result.verdict]}"
    _say(line, f"{COLOUR[result.verdict]} bold", "  ")
    for reason in result.reasons:
        _say(f"  - {reason}", hang="    ")


def _checks(judged: Assessment, place: str) -> Table:
    candidate = judged.candidate
    sizes = f"diameter {digits.mm(candidate.diameter_m)}, lead {digits.mm(candidate.lead_m)}"
    title = f"{candidate.name}, {place}: {sizes}" if place else f"{candidate.name}: {sizes}"
    view = Table(title=title, title_justify="left")
    for name in ("", "value", "bound", "margin"):
        view.add_column(name, justify="right" if name else "left", no_wrap=True)
    for check in judged.checks:
        untold = "-" if check.state == NOT_ASKED else "not told"
        (value, bound), unit = digits.shown((check.value, check.bound), check.unit)
        value = f"{value} {unit}" if value else untold
        bound = (
            f"{'≥' if check.at_least else '≤'} {bound} {unit}"
            if bound
            else WITHOUT_BOUND[check.state]
        )
        margin = "" if check.margin is None else _share(check.margin, 2)
        view.add_row(
            check.name,
            value,
            bound,
            margin,
            style={BROKEN: "red", UNDECIDED: "yellow"}.get(check.state, ""),
        )
    return view


def _share(margin: float, decimals: int) -> str:
    if abs(margin) > FAR:
        return f"> {FAR:+.0%}" if margin > 0.0 else f"< {-FAR:.0%}"
    return f"{margin:+.{decimals}%}"


def _motion(rows: Sequence[CyclePhaseRow], cycle: Cycle) -> Table:
    """The motion-law table."""
    first = [cycle.moves.index(move) + 1 for move in cycle.counts]
    once = "" if len(first) == len(cycle.moves) else "; equal moves once"
    view = Table(
        title=f"the cycle, phase by phase of each move; .0 is its rest{once}", title_justify="left"
    )
    for name in (
        "phase",
        "time\ns",
        "top speed\nm/s",
        "acceleration\nm/s²",
        "force\nN",
        "peak torque\nN m",
        "power\nW",
    ):
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
            view.add_row(f"{row.move}.{row.phase}", *(number(cell) for cell in cells))
    return view


def _print_catalogue(result: Judgement, every: bool) -> None:
    found, broken = result.found, [a for a in result.found if a.broken]
    _say(f"catalogue: {result.fitting} of {len(found)} fit, best first (diameter x lead in mm)")
    pad = max(len(a.candidate.name) for a in found)
    for a in found if every else found[: result.fitting]:
        head = f"  {a.candidate.name:<{pad}}  {number(1e3 * a.candidate.diameter_m)} x {number(1e3 * a.candidate.lead_m)}: "
        told = "".join(
            f"; {check.note}" for check in a.checks if check.note and check.state != BROKEN
        )
        _say(
            f"{head}{_breaks(a) if a.broken else _leaves(a)}{told}",
            "" if a.broken else "green",
            hang="      ",
        )
    if broken and not every:
        names = ", ".join(f"{a.candidate.name} ({_briefly(a)})" for a in broken)
        _say(f"  {len(broken)} do not fit, --all tells by how much: {names}", hang="    ")
    _print_origins([a.candidate for a in found])


def _briefly(a: Assessment) -> str:
    """What it breaks, in a word or two each."""
    return ", ".join(
        dict.fromkeys(check.name.partition(",")[0].removesuffix(" d n") for check in a.broken)
    )


def _breaks(a: Assessment) -> str:
    words = []
    for check in a.broken:
        (value, bound), unit = digits.shown((check.value, check.bound), check.unit)
        words.append(
            f"{check.name} {value} {'<' if check.at_least else '>'} {bound} {unit} ({_share(check.margin or 0.0, 0)})"
        )
    return f"breaks {'; '.join(words)}"


def _leaves(a: Assessment) -> str:
    open_ones = ", ".join(check.name for check in a.undecided)
    return f"tightest is {a.tightest.name}, {_share(a.tightest.margin or 0.0, 2)}" + (
        f"; not told: {open_ones}" if open_ones else ""
    )


def _print_origins(entries: Sequence[CatalogueEntry]) -> None:
    """Of the few by name, then of all others."""
    groups = Counter(entry.origin for entry in entries).most_common()
    for k, (origin, _) in reversed(list(enumerate(groups))):
        names = ", ".join(entry.name for entry in entries if entry.origin == origin)
        _say(
            f"  origin of {names if k else 'all others' if len(groups) > 1 else 'all'}: {origin}",
            "dim",
            "    ",
        )


def _print_published(
    printed: Sequence[FigureComparison], compared: Sequence[FigureComparison]
) -> None:
    reasons = list(dict.fromkeys(row.reason for row in printed if row.reason))
    title = f"{len(compared)} printed figures; {sum(row.differs for row in compared)} are not the right ones (≠)"
    view = Table(title=title, title_justify="left")
    for name in ("figure", "printed", "right", "", "why"):
        view.add_column(name, justify="left" if name == "figure" else "right", no_wrap=True)
    for row in printed:
        why = f"{reasons.index(row.reason) + 1}" if row.reason else ""
        view.add_row(row.name, row.printed, f"{row.right:.6g}", "≠" if row.differs else "", why)
    wide.print(view)
    for k, reason in enumerate(reasons, start=1):
        _say(f"  {k}. {reason}", "dim", "     ")
