"""`rig size`: whether a ball screw fits an axis, with every margin, and which of a catalogue do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from planners.drives.screw_axis import Axis
from planners.drives.screw_checks import allowed_speed, assess, slower
from planners.drives.screw_cycle import Cycle
from planners.drives.screw_demand import table
from planners.drives.screw_limits import absolute_least_lead
from planners.drives.screw_verdict import BROKEN, NOT_ASKED, UNDECIDED, Assessment, Check
from planners.errors import unknown_name
from rig.cli.output import COLOUR, out, print_json, wide
from rig.errors import REFUSED, ConfigError
from rig.sizing import EXAMPLES, Sizing, example_tables, file_tables, sizing_of
from rig.sizing_published import Comparison, axis_figures, compare, screw_figures

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
    found = [assess(sizing.axis, candidate) for candidate in sizing.catalogue.values()]
    chosen = next((a for a in found if a.candidate is sizing.choice), None)
    figures = axis_figures(sizing.axis) | (screw_figures(sizing.axis, chosen) if chosen else {})
    printed = compare(sizing.published, figures)
    if plot is not None:
        from rig import picture_file  # matplotlib takes its time
        from rig.sizing_figure import draw_region

        picture_file.save(draw_region(sizing.axis, found, sizing.choice), plot)
    if as_json:
        print_json(_document(sizing.axis, found, chosen, figures, printed))
    else:
        _print(sizing, found, chosen, figures)
        if printed:
            _print_published(printed if published else [row for row in printed if row.differs], printed)
        _print_verdict(found, chosen)
    return 0 if (chosen.admissible if chosen else any(a.admissible for a in found)) else REFUSED


def _read(file: Path | None, example: str | None) -> Sizing:
    if file is not None and example is not None:
        raise ConfigError(f"--example {example} with file '{file}'; must be one of the two: leave one out")
    if file is None and example is None:
        raise ConfigError(f"SPEC.toml: missing; give a file, or look at --example {EXAMPLES[0]}")
    return sizing_of(file_tables(file) if file is not None else example_tables(example or ""))


def _verdict(found: Sequence[Assessment], chosen: Assessment | None) -> tuple[str, list[str]]:
    if chosen is None:
        does = [a for a in found if a.admissible]
        why = [] if does else ["no entry of the catalogue fits; must be at least one: add entries, or ask for less"]
        return ("bad", why) if not does else ("doubtful" if all(a.undecided for a in does) else "good", why)
    reasons = [check.reason for check in (*chosen.broken, *chosen.undecided)]
    return "bad" if chosen.broken else "doubtful" if reasons else "good", reasons


def _document(
    axis: Axis, found: Sequence[Assessment], chosen: Assessment | None, figures: dict[str, float], printed: list[Comparison]
) -> dict[str, object]:
    verdict, reasons = _verdict(found, chosen)
    allowed = allowed_speed(axis, chosen) if chosen else None
    return {
        "verdict": verdict,
        "reasons": reasons,
        "choice": chosen.candidate.name if chosen else None,
        "admissible": chosen.admissible if chosen else None,
        "checks": [_check(check) for check in chosen.checks] if chosen else [],
        "allowed_speed_m_s": allowed.speed_m_s if allowed else None,
        "allowed_by": allowed.check if allowed else None,
        "moves": _moves(axis.cycle, allowed.speed_m_s if allowed else None),
        "figures": figures,
        "catalogue": [_entry(a) for a in found],
        "published": [{**row._asdict(), "differs": row.differs} for row in printed],
    }


def _check(check: Check) -> dict[str, object]:
    return {
        "name": check.name,
        "value": check.value,
        "bound": check.bound,
        "at_least": check.at_least,
        "unit": check.unit,
        "margin": check.margin,
        "state": check.state,
        "reason": check.reason,
    }


def _moves(cycle: Cycle, allowed: float | None) -> list[dict[str, object]]:
    return [
        {
            "stroke_m": move.stroke_m,
            "law": move.law,
            "time_s": move.time_s,
            "rest_s": move.rest_s,
            "peak_speed_m_s": move.peak_speed_m_s,
            "allowed_time_s": None if allowed is None else move.time_at(allowed),
        }
        for move in cycle.moves
    ]


def _entry(a: Assessment) -> dict[str, object]:
    return {
        "name": a.candidate.name,
        "diameter_m": a.candidate.diameter_m,
        "lead_m": a.candidate.lead_m,
        "origin": a.candidate.origin,
        "admissible": a.admissible,
        "tightest": a.tightest.name,
        "margin": a.tightest.margin,
        "broken": [_check(check) for check in a.broken],
        "undecided": [check.name for check in a.undecided],
    }


def _print(sizing: Sizing, found: Sequence[Assessment], chosen: Assessment | None, figures: dict[str, float]) -> None:
    axis, need = sizing.axis, sizing.axis.demand
    least = absolute_least_lead(axis.mounting, need.peak_speed_m_s, axis.shares.whirl, axis.balls_m_rpm)
    out.print(
        f"cycle of {axis.cycle.duration_s:g} s over {need.travel_m:g} m: at most {need.peak_speed_m_s:.6g} m/s, "
        f"{need.peak_acceleration_m_s2:.6g} m/s², {need.peak_force_n:.6g} N"
    )
    out.print(f"least lead of all screws: {least.lead_m:.5g} m, at a diameter of {least.diameter_m:.5g} m")
    if chosen:
        wide.print(_checks(chosen))
        wide.print(_motion(axis, chosen))
        _print_notes(axis, chosen, figures)
    _print_catalogue(found)


def _print_verdict(found: Sequence[Assessment], chosen: Assessment | None) -> None:
    verdict, reasons = _verdict(found, chosen)
    name = f"{chosen.candidate.name}: " if chosen else ""
    words = {"good": "fits", "doubtful": "fits as far as the catalogue tells", "bad": "does not fit"}
    out.print(f"verdict: {name}{words[verdict]}", style=f"{COLOUR[verdict]} bold")
    for reason in reasons:
        out.print(f"  - {reason}")


def _checks(chosen: Assessment) -> Table:
    candidate = chosen.candidate
    title = f"{candidate.name}: diameter {candidate.diameter_m:g} m, lead {candidate.lead_m:g} m"
    view = Table(title=title, title_justify="left")
    for name in ("", "value", "bound", "margin"):
        view.add_column(name, justify="right" if name else "left", no_wrap=True)
    for check in chosen.checks:
        untold = "-" if check.state == NOT_ASKED else "not told"
        value = untold if check.value is None else f"{check.value:.6g} {check.unit}"
        sign = "≥" if check.at_least else "≤"
        bound = f"{sign} {check.bound:.6g} {check.unit}" if check.bound is not None else WITHOUT_BOUND[check.state]
        margin = "" if check.margin is None else f"{check.margin:+.2%}"
        view.add_row(check.name, value, bound, margin, style={BROKEN: "red", UNDECIDED: "yellow"}.get(check.state, ""))
    return view


def _motion(axis: Axis, chosen: Assessment) -> Table:
    """The motion-law table."""
    view = Table(title="the cycle, phase by phase of each move; .0 is its rest", title_justify="left")
    for name in ("phase", "time\ns", "top speed\nm/s", "acceleration\nm/s²", "force\nN", "torque\nN m", "power\nW"):
        view.add_column(name, justify="right", no_wrap=True)
    for row in table(axis.cycle, axis.load, axis.transmission, chosen.screw):
        cells = (row.duration_s, row.peak_speed_m_s, row.acceleration_m_s2, row.force_n, row.torque_n_m, row.peak_power_w)
        view.add_row(f"{row.move}.{row.phase}", *(f"{cell:.5g}" for cell in cells))
    return view


def _print_notes(axis: Axis, chosen: Assessment, figures: dict[str, float]) -> None:
    f = {name: f"{value:.5g}" for name, value in figures.items()}
    out.print(f"least lead at this diameter: {f['lead_min_whirl_m']} m by whirling, {f['lead_min_balls_m']} m by the balls")
    out.print(
        f"antiresonance {f['antiresonance_rad_s']} rad/s, resonance {f['resonance_rad_s']} rad/s: a bandwidth of "
        f"{f['bandwidth_low_rad_s']} to {f['bandwidth_high_rad_s']} rad/s"
    )
    if "preload_low_n" in f:
        out.print(f"preload: {f['preload_low_n']} to {f['preload_high_n']} N, 5 to 10 % of the dynamic load")
    speed, by = allowed_speed(axis, chosen)
    late = slower(axis.cycle, speed)
    out.print(f"allowed speed: {speed:.6g} m/s by {by}{f'; {late}' if late else ''}")


def _print_catalogue(found: Sequence[Assessment]) -> None:
    does = sum(a.admissible for a in found)
    out.print(f"catalogue: {does} of {len(found)} fit (diameter x lead in mm)")
    pad = max(len(a.candidate.name) for a in found)
    for a in found:
        head = f"  {a.candidate.name:<{pad}}  {1e3 * a.candidate.diameter_m:g} x {1e3 * a.candidate.lead_m:g}: "
        broken = "; ".join(
            f"{c.name} {c.value:.5g} {'<' if c.at_least else '>'} {c.bound:.5g} {c.unit} ({c.margin:+.0%})" for c in a.broken
        )
        open_ones = ", ".join(c.name for c in a.undecided)
        margin = a.tightest.margin or 0.0
        fine = f"tightest is {a.tightest.name}, {margin:+.2%}" + (f"; not told: {open_ones}" if open_ones else "")
        out.print(head + (f"breaks {broken}" if broken else fine), style="" if broken else "green")
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
