"""Tables of `rig size`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from rich.table import Table

from rig.drives.screw import digits
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.cycle import Cycle
from rig.drives.screw.digits import number
from rig.drives.screw.limits import absolute_least_lead
from rig.drives.screw.table import CyclePhaseRow
from rig.drives.screw.verdict import BROKEN, NOT_ASKED, UNDECIDED, Assessment
from rig.studies.sizing.judgement import Judgement
from rig.studies.sizing.notes import notes
from rig.studies.sizing.published import FigureComparison
from rig.ui.cli.output import COLOUR
from rig.ui.cli.page import Column, boxed_table, print_paragraph, print_table

MAX_MARGIN_SHOWN = 10.0  # a larger margin, of either sign, is shown as > +1000 % or < -1000 %
WITHOUT_BOUND = {NOT_ASKED: "no bound", UNDECIDED: "data missing"}
ROW_STYLE = {BROKEN: "red", UNDECIDED: "yellow"}
MOTION_COLUMNS = (
    "move.phase",
    "time\n[s]",
    "top\nspeed\n[m/s]",
    "acceleration\n[m/s²]",
    Column("force\n[N]", drop=1),
    "peak\ntorque\n[N m]",
    Column("peak\npower\n[W]", drop=2),
)
VERDICT_WORDS = {
    "good": "admissible",
    "doubtful": "admissible, data missing",
    "bad": "not admissible",
}


def print_tables(result: Judgement, every: bool, figures: bool) -> None:
    """Print cycle, checks, remarks, catalogue, printed figures and verdict.

    every: list the values of rejected entries. figures: list printed figures that agree, too.
    """
    axis = result.sizing.axis
    judged = result.judged
    need = axis.demand
    least = absolute_least_lead(
        axis.mounting, need.peak_speed_m_s, axis.utilisation.whirl, axis.balls_m_rpm()
    )
    print_paragraph(
        f"cycle of {axis.cycle.duration_s:g} s over {digits.mm(need.travel_m)}: "
        f"peak {number(need.peak_speed_m_s)} m/s, {number(need.peak_acceleration_m_s2)} m/s², "
        f"{number(need.peak_force_n)} N"
    )
    print_paragraph(
        f"least admissible lead: {digits.mm(least.lead_m)}, "
        f"at a diameter of {digits.mm(least.diameter_m)}"
    )
    print_table(_check_table(judged, _place(result)))
    print_paragraph(
        "margin: distance from the bound on its safe side, relative to the bound; "
        "negative: bound violated",
        "dim",
    )
    print_table(_motion_table(result.motion, axis.cycle))
    for note in notes(axis, judged, result.figures):
        print_paragraph(note.text, "dim" if note.dim else "")
    _print_catalogue(result, every)
    if result.printed:
        shown = [row for row in result.printed if figures or row.differs]
        _print_published(shown, result.printed)
    _print_verdict(result)


def _place(result: Judgement) -> str:
    """Describe the place of the assessed screw in the catalogue; empty for a choice."""
    if result.chosen:
        return ""
    if result.fitting:
        return f"best of {result.fitting} admissible"
    return f"nearest of {len(result.found)}, none admissible"


def _print_verdict(result: Judgement) -> None:
    place = "" if result.chosen else f", {_place(result)} ({result.criterion})"
    line = f"verdict: {result.judged.candidate.name}{place}: {VERDICT_WORDS[result.verdict]}"
    print_paragraph(line, f"{COLOUR[result.verdict]} bold", "  ")
    for reason in result.reasons:
        print_paragraph(f"  - {reason}", indent="    ")


def _check_table(judged: Assessment, place: str) -> Table:
    candidate = judged.candidate
    sizes = f"diameter {digits.mm(candidate.diameter_m)}, lead {digits.mm(candidate.lead_m)}"
    title = f"{candidate.name}, {place}: {sizes}" if place else f"{candidate.name}: {sizes}"
    view = boxed_table(title, ("check", "value", "bound", "margin"))
    for check in judged.checks:
        (value, bound), unit = digits.shown((check.value, check.bound), check.unit)
        value_cell = f"{value} {unit}"
        if not value:
            value_cell = "-" if check.state == NOT_ASKED else "data missing"
        bound_cell = WITHOUT_BOUND.get(check.state, "")
        if bound:
            bound_cell = f"{'≥' if check.at_least else '≤'} {bound} {unit}"
        margin = "" if check.margin is None else _margin(check.margin, 2)
        style = ROW_STYLE.get(check.state, "")
        view.add_row(check.name, value_cell, bound_cell, margin, style=style)
    return view


def _margin(margin: float, decimals: int) -> str:
    if abs(margin) <= MAX_MARGIN_SHOWN:
        return f"{margin:+.{decimals}%}"
    if margin > 0.0:
        return f"> {MAX_MARGIN_SHOWN:+.0%}"
    return f"< {-MAX_MARGIN_SHOWN:.0%}"


def _motion_table(rows: Sequence[CyclePhaseRow], cycle: Cycle) -> Table:
    """Create the table of the motion cycle by move and phase; equal moves once."""
    first = [cycle.moves.index(move) + 1 for move in cycle.counts]
    once = "" if len(first) == len(cycle.moves) else "; equal moves once"
    title = f"cycle by move and phase; phase 0: rest{once}"
    view = boxed_table(title, MOTION_COLUMNS, left=0)
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
    found = result.found
    rejected = [a for a in found if a.broken]
    print_paragraph(
        f"catalogue: {result.fitting} of {len(found)} admissible, best first (diameter x lead [mm])"
    )
    name_width = max(len(a.candidate.name) for a in found)
    for a in found if every else found[: result.fitting]:
        _print_entry(a, name_width)
    if rejected and not every:
        names = ", ".join(f"{a.candidate.name} ({_violated_checks(a)})" for a in rejected)
        print_paragraph(
            f"  {len(rejected)} not admissible (--all lists the values): {names}", indent="    "
        )
    _print_origins([a.candidate for a in found])


def _print_entry(a: Assessment, name_width: int) -> None:
    diameter_mm = number(1e3 * a.candidate.diameter_m)
    lead_mm = number(1e3 * a.candidate.lead_m)
    result = _violations(a) if a.broken else _least_margin(a)
    remarks = [check.note for check in a.checks if check.note and check.state != BROKEN]
    line = f"  {a.candidate.name:<{name_width}}  {diameter_mm} x {lead_mm}: "
    line += "; ".join([result, *remarks])
    print_paragraph(line, "" if a.broken else "green", indent="      ")


def _violated_checks(a: Assessment) -> str:
    """List the short names of the violated checks, each once."""
    names = (check.name.partition(",")[0].removesuffix(" d n") for check in a.broken)
    return ", ".join(dict.fromkeys(names))


def _violations(a: Assessment) -> str:
    words = []
    for check in a.broken:
        (value, bound), unit = digits.shown((check.value, check.bound), check.unit)
        sign = "<" if check.at_least else ">"
        margin = _margin(check.margin or 0.0, 0)
        words.append(f"{check.name} {value} {sign} {bound} {unit} ({margin})")
    return f"violates {'; '.join(words)}"


def _least_margin(a: Assessment) -> str:
    text = f"least margin: {a.tightest.name}, {_margin(a.tightest.margin or 0.0, 2)}"
    missing = ", ".join(check.name for check in a.undecided)
    return f"{text}; data missing: {missing}" if missing else text


def _print_origins(entries: Sequence[CatalogueEntry]) -> None:
    """Print the origin of the entries: the most frequent one last and without names."""
    groups = Counter(entry.origin for entry in entries).most_common()
    for origin, _ in reversed(groups[1:]):
        names = ", ".join(entry.name for entry in entries if entry.origin == origin)
        print_paragraph(f"  origin of {names}: {origin}", "dim", "    ")
    most_frequent, _ = groups[0]
    subject = "all others" if len(groups) > 1 else "all"
    print_paragraph(f"  origin of {subject}: {most_frequent}", "dim", "    ")


def _print_published(
    printed: Sequence[FigureComparison], compared: Sequence[FigureComparison]
) -> None:
    reasons = list(dict.fromkeys(row.reason for row in printed if row.reason))
    count = sum(row.differs for row in compared)
    title = f"{len(compared)} printed figures, {count} differ from the computed ones (≠)"
    view = boxed_table(title, ("figure", "printed", "computed", "", "note"))
    for row in printed:
        note = f"{reasons.index(row.reason) + 1}" if row.reason else ""
        mark = "≠" if row.differs else ""
        view.add_row(row.name, row.printed, f"{row.right:.6g}", mark, note)
    print_table(view)
    for k, reason in enumerate(reasons, start=1):
        print_paragraph(f"  {k}. {reason}", "dim", "     ")
