"""Tables of `rig servo observer`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from rig.studies.servo.observer import INFERRED_NOTES
from rig.ui.cli.output import COLOUR
from rig.ui.cli.page import Column, plain_table, print_paragraph, print_table
from rig.ui.cli.servo_observer_document import caution_lines, time_constant_text, verdict_lines

if TYPE_CHECKING:
    from rig.drives.servo.loops import PolePair
    from rig.studies.servo.observer import ObserverRow, ObserverTask, Rejection
    from rig.studies.servo.observer_damping import TimeConstantRanges

TIME_CONSTANT = "T_f\n[ms]"
PAIR_UNIT = "\n[rad/s], ratio"
PAIR_LEGEND = (
    "ratio: damping ratio. Rigid, elastic nominal: least damped of the poles that a torque on the "
    "motor excites, those of Q included; stiff load: the same with Jm and Jlr in one rigid body. "
    "Effect of the rigid nominal on the least damping ratio: excites when it is below those of "
    "joint and Q, damps when it is above that of the joint, leaves when the change is <= 0.1 %."
)
PRINTED_LEGEND = (
    "H_f as printed: pole pair of the denominator printed in source 001, which has Jm for Jlr in "
    "its last term; exact only in the limit T_f = 0."
)
TORQUE_LEGEND = (
    "Gain ratio: load speed per torque on the motor at ω_z / 100, over that without observer; "
    "peak gain: largest over all frequencies. Peak: of the load speed after a step of 1 N m on "
    "motor or load; oscillation index: total variation / (|peak| + |peak - final value|) - 1, "
    "within 12 periods of ω_z. Speeds at the motor side of the gear."
)


def print_tables(
    joint: str,
    task: ObserverTask,
    rows: Sequence[ObserverRow],
    bare: Rejection,
    turn: TimeConstantRanges,
) -> None:
    """Print pole pairs, disturbance rejection, verdict and cautions."""
    print_table(_pair_table(joint, task, rows, bare))
    legend = f"{PAIR_LEGEND} {PRINTED_LEGEND}" if task.order == 1 else PAIR_LEGEND
    print_paragraph(legend, "dim")
    print_table(_torque_table(task, rows, bare))
    print_paragraph(TORQUE_LEGEND, "dim")
    for line in verdict_lines(task, rows, turn):
        print_paragraph(line)
    for line in caution_lines(turn):
        print_paragraph(line, COLOUR["bad" if "unstable" in line else "doubtful"])
    if joint in INFERRED_NOTES:
        print_paragraph(INFERRED_NOTES[joint], "dim")


def _pair_table(
    joint: str, task: ObserverTask, rows: Sequence[ObserverRow], bare: Rejection
) -> Table:
    j = task.joint
    title = (
        f"Joint {joint}: Jm {j.motor_inertia_kg_m2:.6g}, "
        f"Jlr {j.reflected_inertia_kg_m2:.6g} kg m²; "
        f"rigid nominal of {task.rigid.denominator[0]:.6g} kg m²; Q of order {task.order}"
    )
    headers: list[str | Column] = [
        TIME_CONSTANT,
        f"rigid nominal{PAIR_UNIT}",
        "effect",
        f"elastic nominal{PAIR_UNIT}",
        Column(f"stiff load, rigid nominal{PAIR_UNIT}", drop=2),
    ]
    is_first_order = task.order == 1
    if is_first_order:
        headers.append(Column(f"H_f as printed{PAIR_UNIT}", drop=1))
    view = plain_table(title, headers)
    bare_pair = _pair(bare.least_damped)
    cells: list[str | Text] = ["none", bare_pair, "", bare_pair, ""]
    view.add_row(*cells)
    for row in rows:
        effect = task.effect(row.rigid.least_damped.damping)
        cells = [
            time_constant_text(task, row.time_constant_s),
            _pair(row.rigid.least_damped),
            Text(effect, style=COLOUR["bad"] if effect == "unstable" else ""),
            _pair(row.elastic.least_damped),
            _pair(row.stiff),
        ]
        if is_first_order:
            cells.append(_pair(row.printed))
        view.add_row(*cells)
    return view


def _torque_table(task: ObserverTask, rows: Sequence[ObserverRow], bare: Rejection) -> Table:
    headers = (
        TIME_CONSTANT,
        "nominal",
        "gain\nratio",
        "peak gain\n[rad/s per N m]",
        Column("motor step:\npeak [rad/s]", drop=4),
        Column("motor step:\noscillation index", drop=3),
        Column("load step:\npeak [rad/s]", drop=2),
        "load step:\noscillation index",
        Column("stiff load:\ngain ratio", drop=1),
    )
    view = plain_table("\nResponse of the load to a torque", headers)
    view.add_row("none", "", *_rejection_cells(bare), "1")
    for row in rows:
        view.add_row(
            time_constant_text(task, row.time_constant_s),
            "rigid",
            *_rejection_cells(row.rigid),
            _number(row.stiff_low),
        )
        view.add_row("", "elastic", *_rejection_cells(row.elastic), "")
    return view


def _rejection_cells(side: Rejection) -> list[str | Text]:
    if not side.stable:
        return [Text("unstable", style=COLOUR["bad"]), "-", "-", "-", "-", "-"]
    return [
        _number(side.low),
        _number(side.peak_rad_s_n_m),
        _number(side.motor_step_peak_rad_s),
        f"{side.motor_step_rings:.2f}",
        _number(side.load_step_peak_rad_s),
        f"{side.load_step_rings:.2f}",
    ]


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.4g}"


def _pair(pair: PolePair | None) -> str:
    return "no pair" if pair is None else f"{pair.frequency_rad_s:.6g}  {pair.damping:.4f}"
