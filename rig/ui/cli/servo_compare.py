"""`rig servo compare`: drive controllers on the simulated elastic joint, move by move and truth by truth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer
from rich.progress import Progress
from rich.table import Table

from rig.errors import BAD_DATA, ConfigError
from rig.studies.servo.compare import UNPUBLISHED_NOTE
from rig.ui.cli.output import PLAIN, err, out, print_json, wide

if TYPE_CHECKING:
    from rig.drives.servo.loops import LoopAnalysis
    from rig.studies.servo.compare import ControllerRun
    from rig.studies.servo.controllers import Drive
    from rig.studies.servo.spec import ServoSpec

SHOWN = "pid,pid_ff,lqg"
SHARE = "of the first"  # controller, by its name
COLUMNS = (
    ("truth", ""),
    ("move", ""),
    ("controller", ""),
    ("residual", "[%]"),
    (SHARE, ""),
    ("by sensor", "[%]"),
    ("settled", "[ms]"),
    ("rms error", "[%]"),
    ("overshoot", "[°]"),
    ("final error", "[°]"),
    ("peak", "[N m]"),
    ("rms", "[N m]"),
    ("at rest", "[N m]"),
)
LEGEND = (
    "residual: largest speed of the load after the end of the move, true and by its accelerometer; rms error: of the speed",
    "against the reference; all in % of the move's top speed. Settled: from the end of the reference until the speed stays",
    "below 1 %. Overshoot, final error: of the load, the latter at the end of the watch. Peak, rms, at rest: torque of the",
    "motor, rms of the move and of the end of the watch. A shaper, or the filter of lqg_ff, puts off the end of the move.",
)
DESIGN_LEGEND = (
    "Zeros: of the motor's angle, least damped: there the load swings while the motor stands, and no gain moves it. Gain",
    "margins: to what share the gain may fall, and grow. Sensitivity: largest |1 / (1 + L)|. Eigenvectors: condition of their",
    "matrix, 1 is best.",
)
OURS = ("model.", "move.", "bench.")  # keys of the file that make it another rig than the source's
DESIGNS: tuple[tuple[str, str], ...] = (
    ("controller", ""),
    ("slowest pole", "[rad/s]"),
    ("fastest", "[rad/s]"),
    ("least damped", "[rad/s], ratio"),
    ("zeros", "[rad/s], ratio"),
    ("gain margins", ""),
    ("phase margin", "[°]"),
    ("crossover", "[rad/s]"),
    ("sensitivity", "peak"),
    ("eigenvectors", "condition"),
)


def compare(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="TOML of a comparison; source 001's three experiments unless given.",
            metavar="SPEC.toml",
        ),
    ] = None,
    controllers: Annotated[
        str,
        typer.Option(
            help="Names with commas, or all: pid, pid_ff, pid_notch, pid_observer, pid_shaped, assigned, lqg, lqg_ff."
        ),
    ] = SHOWN,
    truth: Annotated[
        str,
        typer.Option(
            help="What the joint really is: names of the file's truths with commas, or all."
        ),
    ] = "all",
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="Any key of the file, e.g. drive.period_s=0.0005; may be repeated."
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Of the sensors' noise, instead of the file's.", min=0)
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw speed and torque of the first truth's moves: .svg, .png or .pdf."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
) -> int:
    """Compare controllers of an elastic joint on the simulated bench: vibration that is left, error, torque."""
    from rig.studies.servo.compare import analyse_drives, build_drives  # scipy takes its time
    from rig.studies.servo.controllers import CONTROLLERS
    from rig.studies.servo.spec import read_spec

    if plot is not None:
        from rig.ui.plots import picture_file

        picture_file.check(plot)
    spec = read_spec(file, changes or ())
    if seed is not None:
        spec = msgspec.structs.replace(spec, seed=seed)
    names = list(CONTROLLERS) if controllers == "all" else _words("--controllers", controllers)
    truths = list(spec.truth) if truth == "all" else _words("--truth", truth)
    drives = build_drives(spec, names)
    facts = analyse_drives(spec, drives)
    rows = _rows(spec, truths, drives, quiet=as_json)
    if plot is not None:
        from rig.ui.plots.servo_compare import draw_comparison

        picture_file.save(
            draw_comparison([row for row in rows if row.plant_variant == truths[0]]), plot
        )
    verdict, reasons = _verdict(facts, rows)
    lost = (
        UNPUBLISHED_NOTE
        if file is None and not any(change.startswith(OURS) for change in changes or ())
        else ()
    )
    if as_json:
        print_json(
            _document(spec, facts, rows)
            | {"verdict": verdict, "reasons": reasons, "source_001": " ".join(lost)}
        )
    else:
        _print_designs(spec, facts, drives)
        _print(rows, names)
        for line in lost:
            out.print(line, style="dim")
        _print_verdict(rows, names, facts, reasons)
    return BAD_DATA if verdict == "bad" else 0


def _words(option: str, text: str) -> list[str]:
    words = list(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    if not words:
        raise ConfigError(
            f"{option} {text!r}; must name one or more, with commas, or all: see --help"
        )
    return words


def _rows(
    spec: ServoSpec, truths: Sequence[str], drives: Mapping[str, Drive], *, quiet: bool
) -> list[ControllerRun]:
    from rig.studies.servo.compare import compare as runs

    total, coming, rows = len(truths) * len(spec.move) * len(drives), runs(spec, truths, drives), []
    with Progress(console=err, transient=True, disable=quiet or not err.is_terminal) as progress:
        bar = progress.add_task("moves", total=total)
        if not quiet and not err.is_terminal:
            err.print(f"{total} moves on the simulated joint")
        for row in coming:
            rows.append(row)
            progress.update(
                bar, advance=1, description=f"{row.plant_variant}, {row.title}, {row.controller}"
            )
    return rows


def _share(row: ControllerRun, rows: Sequence[ControllerRun]) -> float | None:
    """The residual against that of the first controller on the same move, if both arrived."""
    first = next(r for r in rows if (r.plant_variant, r.move) == (row.plant_variant, row.move))
    comparable = (
        first is not row
        and first.outcome.residual
        and first.outcome.arrived
        and row.outcome.arrived
    )
    return row.outcome.residual / first.outcome.residual if comparable else None


def _document(
    spec: ServoSpec, facts: Mapping[str, LoopAnalysis], rows: Sequence[ControllerRun]
) -> dict[str, Any]:
    return {
        "exit_status": "ok" if any(row.outcome.arrived for row in rows) else "bad_data",
        "period_s": spec.drive.period_s,
        "seed": spec.seed,
        "moves": [msgspec.structs.asdict(move) for move in spec.move],
        "model": msgspec.structs.asdict(spec.model),
        "truths": {
            name: spec.plant_variant_tables(name)
            for name in dict.fromkeys(row.plant_variant for row in rows)
        },
        "designs": {name: _design(found) for name, found in facts.items()},
        "rows": [
            {
                "truth": row.plant_variant,
                "move": row.move,
                "title": row.title,
                "controller": row.controller,
            }
            | {"late_s": row.delay_s, **row.outcome._asdict()}
            | {
                "residual_of_the_first": _share(row, rows),
                "integration_error_rad": row.recording.integration_error_rad,
            }
            | _current(spec, row)
            for row in rows
        ],
    }


def _design(found: LoopAnalysis) -> dict[str, Any]:
    return {
        "poles_1_s": [[pole.real, pole.imag] for pole in found.poles_1_s.tolist()],
        "zeros_1_s": [[zero.real, zero.imag] for zero in found.zeros_1_s.tolist()],
        "stable": found.stable,
        "gain_margin": found.margins.upper_gain_margin if found.stable else None,
        "least_gain": found.margins.lower_gain_margin if found.stable else None,
        "phase_margin_deg": found.margins.phase_margin_deg if found.stable else None,
        "crossover_rad_s": found.margins.crossover_rad_s if found.stable else None,
        "peak_sensitivity": found.margins.peak_sensitivity if found.stable else None,
        "eigenvector_condition": found.eigenvector_condition,
    }


def _current(spec: ServoSpec, row: ControllerRun) -> dict[str, float | None]:
    k = spec.drive.torque_constant_n_m_a
    return {"peak_current_a": row.outcome.peak_torque_n_m / k if k else None}


def _print_designs(
    spec: ServoSpec, facts: Mapping[str, LoopAnalysis], drives: Mapping[str, Drive]
) -> None:
    import numpy as np

    from rig.drives.servo.loops import oscillatory_pairs

    title = f"loops on the joint believed in, sampled every {1e3 * spec.drive.period_s:g} ms; broken at the motor's torque"
    table = Table(title=title, **PLAIN)
    for name, unit in DESIGNS:
        table.add_column(
            f"{name}\n{unit}",
            justify="right" if unit or name == "gain margins" else "left",
            no_wrap=True,
        )
    for name, found in facts.items():
        pair = min(oscillatory_pairs(found.poles_1_s), key=lambda mode: mode.damping, default=None)
        slow = found.zeros_1_s[
            np.abs(found.zeros_1_s.imag) < 0.99 * math.pi / spec.drive.period_s
        ]  # not of the sampling
        zero = min(oscillatory_pairs(slow), key=lambda mode: mode.damping, default=None)
        cells = (
            f"{found.pole_pairs[0].frequency_rad_s:.2f}",
            f"{found.pole_pairs[-1].frequency_rad_s:.1f}",
            *(
                "-" if mode is None else f"{mode.frequency_rad_s:.1f}, {mode.damping:.3f}"
                for mode in (pair, zero)
            ),
            *_margins(found),
            f"{found.eigenvector_condition:.3g}",
        )
        table.add_row(name, *cells)
    wide.print(table)
    out.print("\n".join(DESIGN_LEGEND), style="dim")
    for name, drive in drives.items():
        if drive.note:
            out.print(f"{name}: {drive.note}", style="dim")
    out.print()


def _margins(found: LoopAnalysis) -> tuple[str, ...]:
    m = found.margins
    if not found.stable:
        return ("unstable", "-", "-", "-")
    return (
        f"{m.lower_gain_margin:.3g} to {m.upper_gain_margin:.3g}",
        f"{m.phase_margin_deg:.1f}",
        f"{m.crossover_rad_s:.1f}",
        f"{m.peak_sensitivity:.2f}",
    )


def _print(rows: Sequence[ControllerRun], names: Sequence[str]) -> None:
    table = Table(title="controllers of the elastic joint", **PLAIN)
    for name, unit in COLUMNS:
        told, figure = (f"of {names[0]}", True) if name == SHARE else (name, bool(unit))
        table.add_column(f"{told}\n{unit}", justify="right" if figure else "left", no_wrap=True)
    last = None
    for row in rows:
        here = (row.plant_variant, row.move)
        if last is not None and here != last:
            table.add_section()
        share, o = _share(row, rows), row.outcome
        cells = (
            row.plant_variant if last is None or last[0] != row.plant_variant else "",
            row.title if here != last else "",
            row.controller,
            f"{100 * o.residual:.2f}",
            "" if share is None else f"{share:.2f}",
            f"{100 * o.residual_measured:.2f}",
            f"{1e3 * o.settled_s:.0f}" if math.isfinite(o.settled_s) else "never",
            f"{100 * o.speed_error:.2f}",
            f"{o.overshoot_deg:.3f}",
            f"{o.final_error_deg:.3f}".replace("-0.000", "0.000"),
            f"{o.peak_torque_n_m:.3f}",
            f"{o.rms_torque_n_m:.3f}",
            f"{o.rest_torque_n_m:.3f}",
        )
        table.add_row(*cells)
        last = here
    wide.print(table)
    out.print("\n".join(LEGEND), style="dim")


def _verdict(
    facts: Mapping[str, LoopAnalysis], rows: Sequence[ControllerRun]
) -> tuple[str, list[str]]:
    """bad: nothing arrived; doubtful: something did not, or is unstable where it should be stable."""
    reasons = [
        f"{name} is unstable on the joint believed in"
        for name, found in facts.items()
        if not found.stable
    ]
    for row in rows:
        o = row.outcome
        if not o.arrived:
            why = f", its torque at the limit for {o.at_limit_s:.3g} s" if o.at_limit_s else ""
            where = f"truth {row.plant_variant}, {row.title}"
            reasons.append(
                f"{row.controller} did not arrive: {where}, {o.final_error_deg:.3g}° off{why}"
            )
    if not any(row.outcome.arrived for row in rows):
        return "bad", reasons
    return "doubtful" if reasons else "good", reasons


def _print_verdict(
    rows: Sequence[ControllerRun],
    names: Sequence[str],
    facts: Mapping[str, LoopAnalysis],
    reasons: Sequence[str],
) -> None:
    for name in names[1:]:
        if facts[name].stable and facts[names[0]].stable:
            out.print(_ranking(name, names[0], rows))
    for reason in reasons:
        out.print(reason, style="red")


def _ranking(name: str, first: str, rows: Sequence[ControllerRun]) -> str:
    shares = [
        share for row in rows if row.controller == name and (share := _share(row, rows)) is not None
    ]
    if not shares:
        return f"{name}: nothing to compare with {first}"
    less = sum(share < 1.0 for share in shares)
    return f"{name} leaves less than {first} in {less} of {len(shares)} moves: {min(shares):.2f} to {max(shares):.2f} of it"
