"""`rig servo shaping`: comparison of input shapers on a joint with parameter errors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from rig.studies.servo.shaping import UNPUBLISHED_NOTE
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import Column, plain_table, print_paragraph, print_table, print_written

if TYPE_CHECKING:
    from planners.shapers import Shaper
    from planners.trajectories.pieces import FloatArray
    from rig.studies.servo.shaping import Robustness, ShapingTask

LEGEND = (
    "same instant: shaped over unshaped vibration after the last impulse; at the start: over the "
    "vibration of one impulse at 0 (Singer & Seering 1990). Residual: the latter on the assumed "
    "mode; insensitivity: range of relative frequency error in which the latter stays below 5 %."
)
PULSE_LEGEND = (
    "Two masses of 1 kg m² in total, 1 N m: largest deviation of the load speed from its final "
    "value after the torque, in % of the final value; independent of the ratio of the masses. "
    "Frequency and damping ratio are those of the poles of the joint."
)


def shaping(
    frequency: Annotated[
        float, typer.Option(help="Natural frequency of the assumed mode \\[rad/s].")
    ] = 1.0,
    damping: Annotated[
        float, typer.Option(help="Damping ratio of the assumed mode, 0 to 0.99.")
    ] = 0.05,
    frequency_error: Annotated[
        float, typer.Option(help="Relative error of the natural frequency, 0 to 0.9, both signs.")
    ] = 0.1,
    damping_error: Annotated[
        float, typer.Option(help="Relative error of the damping ratio, 0 to 1, both signs.")
    ] = 0.2,
    shapers: Annotated[
        str,
        typer.Option(
            help="Shapers separated by commas: zv, zvd, zvdd, zvddd, mzv, ei, ei_two_hump, "
            "ei_three_hump, um_zv.",
        ),
    ] = "zv,zvd,zvdd",
    pulse: Annotated[float, typer.Option(help="Duration of the torque pulse \\[s].")] = 10.0,
    sample_time: Annotated[
        float | None,
        typer.Option(help="Sample time of a drive \\[s]; adds the impulses at its samples."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Figure file of impulse and pulse responses: .svg, .png or .pdf."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Compare impulses, residual vibration and pulse responses of input shapers."""
    from rig.studies.servo.shaping import ShapingTask, pulse_residuals, robustness

    if plot is not None:
        from rig.ui.plots import picture_file  # matplotlib is slow to import

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
    pulses = {"unshaped": pulse_residuals(task)}
    for row in rows:
        pulses[row.name] = pulse_residuals(task, row.shaper)
    if plot is not None:
        from rig.ui.plots.servo_shaping import draw_shaping

        picture_file.save(draw_shaping(task, rows), plot)
    if as_json:
        print_json(_document(task, rows, pulses))
    else:
        _print(task, rows, pulses)
        print_written(plot)
    return 0


def _document(
    task: ShapingTask, rows: Sequence[Robustness], pulses: dict[str, FloatArray]
) -> dict[str, Any]:
    """Create the JSON document of a shaper study; residuals relative to 1, not in percent."""
    residuals = {
        name: {"nominal": float(left[0]), "cases": left[1:].tolist()}
        for name, left in pulses.items()
    }
    return {
        "exit_status": "ok",
        "frequency_rad_s": task.frequency_rad_s,
        "damping": task.damping,
        "true_over_assumed": [{"frequency": f, "damping": d} for f, d in task.factors],
        "shapers": [_shaper_document(row) for row in rows],
        "pulse": {"pulse_s": task.pulse_s, "residual_of_final_speed": residuals},
        "sample_time_s": task.period_s,
        "inferred": " ".join(UNPUBLISHED_NOTE),
    }


def _shaper_document(row: Robustness) -> dict[str, Any]:
    sampled = None
    if row.sampled and row.sampled_facts:
        sampled = _impulses(row.sampled) | row.sampled_facts._asdict()
    return {
        "name": row.name,
        **_impulses(row.shaper),
        **row.facts._asdict(),
        "same_instant": row.same_instant.tolist(),
        "singer_seering": row.singer_seering.tolist(),
        "damping_only_same_instant": row.damping_only.tolist(),
        "sampled": sampled,
    }


def _impulses(shaper: Shaper) -> dict[str, Any]:
    return {"amplitudes": shaper.amplitudes.tolist(), "times_s": shaper.times_s.tolist()}


def _print(task: ShapingTask, rows: Sequence[Robustness], pulses: dict[str, FloatArray]) -> None:
    print_table(_impulse_table(task, rows))
    print_table(_residual_table(task, rows))
    print_paragraph(LEGEND, "dim")
    print_table(_pulse_table(task, pulses))
    for text in (PULSE_LEGEND, *UNPUBLISHED_NOTE):
        print_paragraph(text, "dim")


def _impulse_table(task: ShapingTask, rows: Sequence[Robustness]) -> Table:
    view = plain_table(
        f"Impulses for {task.frequency_rad_s:g} rad/s and damping ratio {task.damping:g}",
        (
            "shaper",
            "sample\ntime",
            Column("amplitudes and times [s]", folds=True),
            "duration\n[s]",
            "residual\n[%]",
            "insensitivity",
        ),
        left=3,
    )
    for row in rows:
        shown = [("", row.shaper, row.facts)]
        if row.sampled and row.sampled_facts:
            shown.append((f"{task.period_s:g} s", row.sampled, row.sampled_facts))
        for sample_time, shaper, facts in shown:
            amplitudes = "  ".join(f"{a:.5f}" for a in shaper.amplitudes)
            times = "  ".join(f"{t:7.5g}" for t in shaper.times_s)
            is_unbounded = math.isinf(facts.insensitivity)
            view.add_row(
                row.name,
                sample_time,
                amplitudes,
                f"{facts.duration_s:.6g}",
                f"{100.0 * facts.residual:.4f}",
                "∞" if is_unbounded else f"{facts.insensitivity:.5f}",
            )
            view.add_row("", "", times, end_section=True)
    return view


def _residual_table(task: ShapingTask, rows: Sequence[Robustness]) -> Table:
    damping_only = (
        Column(f"damping\nonly ×{1.0 + task.damping_error:g}", drop=2),
        Column(f"damping\nonly ×{1.0 - task.damping_error:g}", drop=1),
    )
    title = "\nResidual vibration [%] with true over assumed frequency, damping ratio"
    headers: list[str | Column] = ["shaper", "relative to", *_case_labels(task), *damping_only]
    view = plain_table(title, headers, left=2)
    for row in rows:
        view.add_row(
            row.name, "same instant", *_percent(row.same_instant), *_percent(row.damping_only)
        )
        view.add_row("", "at the start", *_percent(row.singer_seering))
    return view


def _pulse_table(task: ShapingTask, pulses: dict[str, FloatArray]) -> Table:
    title = f"\nResidual vibration of the load speed [%] after {task.pulse_s:g} s of torque"
    view = plain_table(title, ("shaper", "assumed mode", *_case_labels(task)))
    for name, left in pulses.items():
        view.add_row(name, *_percent(left, 4))
    return view


def _case_labels(task: ShapingTask) -> Iterable[str]:
    return (f"×{f:g}, ×{d:g}" for f, d in task.factors)


def _percent(shares: FloatArray, digits: int = 6) -> Iterable[str]:
    return (f"{100.0 * share:.{digits}f}" for share in shares)
