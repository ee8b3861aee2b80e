"""Tables and JSON document of `rig servo compare`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import msgspec
from rich.table import Table

from rig.ui.cli.page import Column, out, plain_table, print_paragraph, print_table

if TYPE_CHECKING:
    from rig.drives.servo.loops import LoopAnalysis
    from rig.run.joint.controllers import Drive
    from rig.studies.servo.compare import ControllerRun
    from rig.studies.servo.spec import ServoSpec

TEXT_COLUMNS = ("plant\nvariant\n", "move\n", "controller\n")
NUMBER_COLUMNS = (
    Column("residual,\nmeasured\n[%]", drop=1),
    "settling\ntime\n[ms]",
    "rms speed\nerror\n[%]",
    Column("overshoot\n[°]", drop=5),
    Column("final\nerror\n[°]", drop=4),
    Column("peak\ntorque\n[N m]", drop=6),
    Column("rms\ntorque\n[N m]", drop=3),
    Column("torque\nat rest\n[N m]", drop=2),
)
LEGEND = (
    "residual: peak speed of the load after the end of the move; measured: by its accelerometer; "
    "rms speed error: against the reference; all in % of the top speed of the move. "
    "Settling time: from the end of the reference until the speed stays below 1 %. "
    "Overshoot, final error: of the load angle, the latter at the end of the recording. "
    "Peak, rms, at rest: motor torque, rms during the move and at the end of the recording. "
    "A shaper, or the filter of lqg_ff, delays the end of the move."
)
DESIGN_COLUMNS = (
    "controller\n",
    "slowest\npole\n[rad/s]",
    Column("fastest\npole\n[rad/s]", drop=2),
    "least damped\npole pair\n[rad/s], ratio",
    Column("least damped\nzero pair\n[rad/s], ratio", drop=3),
    "gain margins\nlower to upper\n",
    "phase\nmargin\n[°]",
    Column("gain\ncrossover\n[rad/s]", drop=4),
    "peak\nsensitivity\n",
    Column("eigenvector\ncondition\nnumber", drop=1),
)
DESIGN_LEGEND = (
    "ratio: damping ratio. Zeros: of the motor angle; at them the load vibrates while the motor "
    "stands still, and no gain moves them. Gain margins: factors by which the gain may decrease "
    "and increase. Peak sensitivity: largest |1 / (1 + L)|. "
    "Eigenvector condition number: 1 is best."
)
NYQUIST_SHARE = 0.99  # zeros above this share of the Nyquist frequency come from the sampling


def document(
    spec: ServoSpec, facts: Mapping[str, LoopAnalysis], rows: Sequence[ControllerRun]
) -> dict[str, Any]:
    """Create the JSON document of a comparison, without its verdict."""
    variants = dict.fromkeys(row.plant_variant for row in rows)
    return {
        "exit_status": "ok" if any(row.outcome.arrived for row in rows) else "bad_data",
        "period_s": spec.drive.period_s,
        "seed": spec.seed,
        "moves": [msgspec.structs.asdict(move) for move in spec.move],
        "model": msgspec.structs.asdict(spec.model),
        "truths": {name: spec.plant_variant_tables(name) for name in variants},
        "designs": {name: _design_document(found) for name, found in facts.items()},
        "rows": [_row_document(spec, row, rows) for row in rows],
    }


def _row_document(
    spec: ServoSpec, row: ControllerRun, rows: Sequence[ControllerRun]
) -> dict[str, Any]:
    from rig.analysis.joint_move import cruise_ripple_rad_s

    k = spec.drive.torque_constant_n_m_a
    return {
        "truth": row.plant_variant,
        "move": row.move,
        "title": row.title,
        "controller": row.controller,
        "late_s": row.delay_s,
        **row.outcome._asdict(),
        "speed_ripple_rad_s": cruise_ripple_rad_s(row.recording),
        "residual_of_the_first": residual_ratio(row, rows),
        "integration_error_rad": row.recording.integration_error_rad,
        "peak_current_a": row.outcome.peak_torque_n_m / k if k else None,
    }


def _design_document(found: LoopAnalysis) -> dict[str, Any]:
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


def residual_ratio(row: ControllerRun, rows: Sequence[ControllerRun]) -> float | None:
    """Compute the residual over that of the first controller; None unless both settled."""
    first = next(r for r in rows if (r.plant_variant, r.move) == (row.plant_variant, row.move))
    if first is row or not first.outcome.residual:
        return None
    if not (first.outcome.arrived and row.outcome.arrived):
        return None
    return row.outcome.residual / first.outcome.residual


def print_designs(
    spec: ServoSpec, facts: Mapping[str, LoopAnalysis], drives: Mapping[str, Drive]
) -> None:
    """Print poles, zeros and margins of all loops."""
    period_ms = 1e3 * spec.drive.period_s
    title = f"loops on the joint model, sampled every {period_ms:g} ms, opened at the motor torque"
    table = plain_table(title, DESIGN_COLUMNS)
    for name, found in facts.items():
        table.add_row(name, *_design_cells(spec, found))
    print_table(table)
    print_paragraph(DESIGN_LEGEND, "dim")
    for name, drive in drives.items():
        if drive.note:
            print_paragraph(f"{name}: {drive.note}", "dim", "  ")
    out.print()


def _design_cells(spec: ServoSpec, found: LoopAnalysis) -> list[str]:
    import numpy as np

    from rig.drives.servo.loops import oscillatory_pairs

    limit_rad_s = NYQUIST_SHARE * math.pi / spec.drive.period_s
    zeros_1_s = found.zeros_1_s[np.abs(found.zeros_1_s.imag) < limit_rad_s]
    pole_pair = min(oscillatory_pairs(found.poles_1_s), key=lambda mode: mode.damping, default=None)
    zero_pair = min(oscillatory_pairs(zeros_1_s), key=lambda mode: mode.damping, default=None)
    cells = [
        f"{found.pole_pairs[0].frequency_rad_s:.2f}",
        f"{found.pole_pairs[-1].frequency_rad_s:.1f}",
    ]
    for pair in (pole_pair, zero_pair):
        if pair is None:
            cells.append("-")
        else:
            cells.append(f"{pair.frequency_rad_s:.1f}, {pair.damping:.3f}")
    return [*cells, *_margin_cells(found), f"{found.eigenvector_condition:.3g}"]


def _margin_cells(found: LoopAnalysis) -> tuple[str, ...]:
    m = found.margins
    if not found.stable:
        return ("unstable", "-", "-", "-")
    return (
        f"{m.lower_gain_margin:.3g} to {m.upper_gain_margin:.3g}",
        f"{m.phase_margin_deg:.1f}",
        f"{m.crossover_rad_s:.1f}",
        f"{m.peak_sensitivity:.2f}",
    )


def print_runs(rows: Sequence[ControllerRun], names: Sequence[str]) -> None:
    """Print the metrics of every run."""
    headers = (*TEXT_COLUMNS, "residual\n[%]", f"ratio\nto {names[0]}\n", *NUMBER_COLUMNS)
    table = plain_table("controllers of the elastic joint", headers, left=len(TEXT_COLUMNS))
    previous: ControllerRun | None = None
    for row in rows:
        _add_run(table, row, previous, residual_ratio(row, rows))
        previous = row
    print_table(table)
    print_paragraph(LEGEND, "dim")


def _add_run(
    table: Table, row: ControllerRun, previous: ControllerRun | None, ratio: float | None
) -> None:
    """Add a row; plant variant and move stand in their first row only."""
    is_new_variant = previous is None or previous.plant_variant != row.plant_variant
    is_new_move = is_new_variant or previous is None or previous.move != row.move
    if previous is not None and is_new_move:
        table.add_section()
    o = row.outcome
    settling = f"{1e3 * o.settled_s:.0f}" if math.isfinite(o.settled_s) else "not settled"
    table.add_row(
        row.plant_variant if is_new_variant else "",
        row.title if is_new_move else "",
        row.controller,
        f"{100 * o.residual:.2f}",
        "" if ratio is None else f"{ratio:.2f}",
        f"{100 * o.residual_measured:.2f}",
        settling,
        f"{100 * o.speed_error:.2f}",
        f"{o.overshoot_deg:.3f}",
        f"{o.final_error_deg:.3f}".replace("-0.000", "0.000"),
        f"{o.peak_torque_n_m:.3f}",
        f"{o.rms_torque_n_m:.3f}",
        f"{o.rest_torque_n_m:.3f}",
    )


def print_conclusions(
    rows: Sequence[ControllerRun],
    names: Sequence[str],
    facts: Mapping[str, LoopAnalysis],
    notes: Sequence[str],
    reasons: Sequence[str],
) -> None:
    """Print the notes, the ranking, and the reasons of a verdict that is not good."""
    if notes:
        print_paragraph(" ".join(notes), "dim")
    print_ranking(rows, names, facts)
    for reason in reasons:
        print_paragraph(reason, "red", "  ")


def print_ranking(
    rows: Sequence[ControllerRun], names: Sequence[str], facts: Mapping[str, LoopAnalysis]
) -> None:
    """Print in how many moves each controller leaves less residual vibration than the first."""
    first = names[0]
    for name in names[1:]:
        if facts[name].stable and facts[first].stable:
            print_paragraph(_ranking(name, first, rows), indent="  ")


def _ranking(name: str, first: str, rows: Sequence[ControllerRun]) -> str:
    own_rows = [row for row in rows if row.controller == name]
    candidates = [residual_ratio(row, rows) for row in own_rows]
    ratios = [ratio for ratio in candidates if ratio is not None]
    if not ratios:
        return f"{name}: no move comparable with {first}"
    less = sum(ratio < 1.0 for ratio in ratios)
    return (
        f"residual of {name} below that of {first} in {less} of {len(ratios)} moves: "
        f"ratio {min(ratios):.2f} to {max(ratios):.2f}"
    )
