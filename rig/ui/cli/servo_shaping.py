"""`rig servo shaping`: what input shapers leave of a joint's swing when the joint is not quite the assumed one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from rig.studies.servo.shaping import UNPUBLISHED_NOTE
from rig.ui.cli.output import out, plain_table, print_json, wide

if TYPE_CHECKING:
    from planners.shapers import Shaper
    from planners.trajectories.pieces import FloatArray
    from rig.studies.servo.shaping import Robustness, ShapingTask

LEGEND = (
    "same instant: shaped over unshaped swing once all impulses are over; at the start: over the swing of one impulse at 0",
    "(Singer & Seering 1990). Left: the latter on the assumed mode; 5 % band: width in frequency, as a share of it, in which",
    "the latter stays below 5 %.",
)
PULSE_LEGEND = (
    "Two masses of 1 kg m² in all, 1 N m: largest distance of the load's speed from its final value once the torque is over,",
    "in % of the final value; exact, whatever the ratio of the masses. Frequency and damping are those of the joint's poles.",
)


def shaping(
    frequency: Annotated[
        float, typer.Option(help="Natural frequency the shapers are made for in rad/s.")
    ] = 1.0,
    damping: Annotated[float, typer.Option(help="Damping ratio the shapers are made for.")] = 0.05,
    frequency_error: Annotated[
        float, typer.Option(help="Of the true frequency, as a share, both ways.")
    ] = 0.1,
    damping_error: Annotated[
        float, typer.Option(help="Of the true damping, as a share, both ways.")
    ] = 0.2,
    shapers: Annotated[
        str,
        typer.Option(
            help="Names with commas: zv, zvd, zvdd, zvddd, mzv, ei, ei_two_hump, ei_three_hump, um_zv."
        ),
    ] = "zv,zvd,zvdd",
    pulse: Annotated[float, typer.Option(help="Length of the torque pulse in s.")] = 10.0,
    sample_time: Annotated[
        float | None,
        typer.Option(help="Of a drive in s: tells the impulses on its samples as well."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Draw impulse responses, and the pulse's speed and torque: .svg, .png or .pdf."
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
) -> int:
    """Compare input shapers on a joint that swings otherwise than assumed: impulses, residuals, a torque pulse."""
    from rig.studies.servo.shaping import ShapingTask, pulse_residuals, robustness

    if plot is not None:
        from rig.ui.plots import picture_file  # matplotlib takes its time

        picture_file.check(plot)
    task = ShapingTask(
        frequency_rad_s=frequency,
        damping=damping,
        frequency_error=frequency_error,
        damping_error=damping_error,
        shapers=tuple(word.strip() for word in shapers.split(",") if word.strip()),
        pulse_s=pulse,
        period_s=sample_time,
    )
    rows = robustness(task)
    pulses = {"unshaped": pulse_residuals(task)} | {
        row.name: pulse_residuals(task, row.shaper) for row in rows
    }
    if plot is not None:
        from rig.ui.plots.servo_shaping import draw_shaping

        picture_file.save(draw_shaping(task, rows), plot)
    if as_json:
        print_json(_document(task, rows, pulses))
    else:
        _print(task, rows, pulses)
    return 0


def _document(
    task: ShapingTask, rows: Sequence[Robustness], pulses: dict[str, FloatArray]
) -> dict[str, Any]:
    """Shares, not percent."""
    return {
        "exit_status": "ok",
        "frequency_rad_s": task.frequency_rad_s,
        "damping": task.damping,
        "true_over_assumed": [{"frequency": f, "damping": d} for f, d in task.factors],
        "shapers": [_row(row) for row in rows],
        "pulse": {
            "pulse_s": task.pulse_s,
            "residual_of_final_speed": {
                name: {"nominal": float(left[0]), "cases": left[1:].tolist()}
                for name, left in pulses.items()
            },
        },
        "sample_time_s": task.period_s,
        "inferred": " ".join(UNPUBLISHED_NOTE),
    }


def _row(row: Robustness) -> dict[str, Any]:
    return {
        "name": row.name,
        **_impulses(row.shaper),
        **row.facts._asdict(),
        "same_instant": row.same_instant.tolist(),
        "singer_seering": row.singer_seering.tolist(),
        "damping_only_same_instant": row.damping_only.tolist(),
        "sampled": _impulses(row.sampled) | row.sampled_facts._asdict()
        if row.sampled and row.sampled_facts
        else None,
    }


def _impulses(shaper: Shaper) -> dict[str, Any]:
    return {"amplitudes": shaper.amplitudes.tolist(), "times_s": shaper.times_s.tolist()}


def _print(task: ShapingTask, rows: Sequence[Robustness], pulses: dict[str, FloatArray]) -> None:
    wide.print(_impulse_table(task, rows))
    wide.print(_residual_table(task, rows))
    out.print("\n".join(LEGEND), style="dim")
    wide.print(_pulse_table(task, pulses))
    out.print("\n".join((*PULSE_LEGEND, *UNPUBLISHED_NOTE)), style="dim")


def _impulse_table(task: ShapingTask, rows: Sequence[Robustness]) -> Table:
    view = plain_table(
        f"Impulses for {task.frequency_rad_s:g} rad/s and damping {task.damping:g}",
        ("shaper", "", "amplitudes and times [s]", "length [s]", "left [%]", "5 % band"),
        left=3,
    )
    for row in rows:
        shown = [("", row.shaper, row.facts)]
        if row.sampled and row.sampled_facts:
            shown.append((f"on {task.period_s:g} s", row.sampled, row.sampled_facts))
        for where, shaper, facts in shown:
            first = (
                row.name,
                where,
                "  ".join(f"{a:.5f}" for a in shaper.amplitudes),
                f"{facts.duration_s:.6g}",
                f"{100.0 * facts.residual:.4f}",
                "∞" if math.isinf(facts.insensitivity) else f"{facts.insensitivity:.5f}",
            )
            view.add_row(*first)
            view.add_row("", "", "  ".join(f"{t:7.5g}" for t in shaper.times_s), end_section=True)
    return view


def _residual_table(task: ShapingTask, rows: Sequence[Robustness]) -> Table:
    alone = (f"damping alone ×{1.0 + task.damping_error:g}", f"×{1.0 - task.damping_error:g}")
    view = plain_table(
        "\nLeft of the swing [%] when frequency, damping are",
        ("shaper", "over", *_cases(task), *alone),
        left=2,
    )
    for row in rows:
        view.add_row(
            row.name, "same instant", *_percent(row.same_instant), *_percent(row.damping_only)
        )
        view.add_row("", "at the start", *_percent(row.singer_seering))
    return view


def _pulse_table(task: ShapingTask, pulses: dict[str, FloatArray]) -> Table:
    title = f"\nVibration of the load's speed [%] after {task.pulse_s:g} s of torque"
    view = plain_table(title, ("shaper", "as assumed", *_cases(task)), left=1)
    for name, left in pulses.items():
        view.add_row(name, *_percent(left, 4))
    return view


def _cases(task: ShapingTask) -> Iterable[str]:
    return (f"×{f:g}, ×{d:g}" for f, d in task.factors)


def _percent(shares: FloatArray, digits: int = 6) -> Iterable[str]:
    return (f"{100.0 * share:.{digits}f}" for share in shares)
