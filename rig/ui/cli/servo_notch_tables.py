"""Tables and JSON document of `rig servo notch`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from rich.table import Table

from rig.studies.servo.joints import FITTED_NOTE
from rig.studies.servo.notch import UNPUBLISHED_NOTE
from rig.ui.cli.page import Column, plain_table, print_paragraph, print_table

if TYPE_CHECKING:
    from rig.drives.servo.loops import PolePair
    from rig.studies.servo.notch import NotchRow, SampledNotch
    from rig.studies.servo.notch_loops import NotchTask

PAIR_UNIT = "\n[rad/s], ratio"
POLE_LEGEND = (
    "ratio: damping ratio. Cancelled: poles that the notch hides from the setpoint; disturbances "
    "excite them. Phase margins and gain crossovers: of the speed loop opened at the torque, and "
    "of the position loop opened at the error of the motor angle."
)
RESPONSE_LEGEND = (
    "Motor step, load step: total variation of the load speed after a step of 1 N m on motor or "
    "load, at the motor side of the gear. After a setpoint step of 1 rad: peak speed of the load; "
    "oscillation index: total variation / (2 x peak) - 1, in %; overshoot: of the load angle, in "
    "% of the step; settling time: until that angle stays within 2 % of the step."
)


def document(
    joint: str,
    task: NotchTask,
    rows: Sequence[NotchRow],
    detuned: Sequence[NotchRow],
    digital: Sequence[SampledNotch],
    period_s: float,
) -> dict[str, Any]:
    """Create the JSON document of a notch study."""
    return {
        "exit_status": "ok",
        "joint": joint,
        "antiresonance_rad_s": task.joint.antiresonance_rad_s,
        "motor_inertia_kg_m2": task.joint.motor_inertia_kg_m2,
        "reflected_inertia_kg_m2": task.joint.reflected_inertia_kg_m2,
        "gains": {
            "speed_gain_n_m_s_rad": task.gains.speed_gain_n_m_s_rad,
            "reset_time_s": task.gains.reset_time_s,
            "position_gain_1_s": task.gains.position_gain_1_s,
        },
        "placements": [_row_document(row) for row in rows],
        "detuned": [_row_document(row) for row in detuned],
        "sample_time_s": period_s,
        "sampled": [row._asdict() | {"shift": row.shift} for row in digital],
        "inferred": _source_note(joint),
    }


def _row_document(row: NotchRow) -> dict[str, Any]:
    facts = row._asdict()
    for key in ("speed_modes", "position_modes", "hidden"):
        facts[key] = [pair._asdict() for pair in getattr(row, key)]
    n = row.notch
    if n is not None:
        facts["notch"] = {
            "frequency_rad_s": n.frequency_rad_s,
            "numerator_damping": n.numerator_damping,
            "denominator_damping": n.denominator_damping,
            "depth": n.depth,
            "depth_db": n.depth_db,
        }
    return facts


def _source_note(joint: str) -> str:
    return f"{UNPUBLISHED_NOTE} {FITTED_NOTE}" if joint == "fitted" else UNPUBLISHED_NOTE


def print_tables(
    joint: str,
    task: NotchTask,
    rows: Sequence[NotchRow],
    detuned: Sequence[NotchRow],
    digital: Sequence[SampledNotch],
    period_s: float,
) -> None:
    """Print poles, margins, responses, the digital notch and a verdict on each placement."""
    print_table(_pole_table(joint, task, rows))
    print_paragraph(POLE_LEGEND, "dim")
    print_table(_response_table("\nResponses of the load", rows))
    if detuned:
        print_table(_response_table("\nResponses of the load with a detuned notch", detuned))
    print_paragraph(RESPONSE_LEGEND, "dim")
    print_table(_digital_table(digital, period_s))
    for line in _verdict_lines(rows):
        print_paragraph(line)
    print_paragraph(_source_note(joint), "dim")


def _pole_table(joint: str, task: NotchTask, rows: Sequence[NotchRow]) -> Table:
    j = task.joint
    title = (
        f"Joint {joint}: ω_z {j.antiresonance_rad_s:.6g} rad/s, "
        f"Jm {j.motor_inertia_kg_m2:.6g}, Jlr {j.reflected_inertia_kg_m2:.6g} kg m²; "
        f"Kpv {task.gains.speed_gain_n_m_s_rad:.6g} N m s/rad, "
        f"Tiv {task.gains.reset_time_s:.6g} s, Kpp {task.gains.position_gain_1_s:.6g} 1/s"
    )
    headers = (
        "notch",
        f"notch{PAIR_UNIT}",
        f"speed loop{PAIR_UNIT}",
        f"position loop{PAIR_UNIT}",
        f"cancelled{PAIR_UNIT}",
        Column("speed loop\nmargin [°]", drop=3),
        Column("speed loop\ncrossover\n[rad/s]", drop=2),
        Column("position loop\nmargin [°]", drop=4),
        Column("position loop\ncrossover\n[rad/s]", drop=1),
    )
    view = plain_table(title, headers)
    for row in rows:
        notch = ""
        if row.notch is not None:
            notch = _pair(row.notch.frequency_rad_s, row.notch.numerator_damping)
        view.add_row(
            row.name,
            notch,
            _pair_lines(row.speed_modes),
            _pair_lines(row.position_modes),
            _pair_lines(row.hidden),
            f"{row.phase_margin_deg:.2f}",
            f"{row.crossover_rad_s:.2f}",
            f"{row.position_margin_deg:.2f}",
            f"{row.position_crossover_rad_s:.2f}",
            end_section=True,
        )
    return view


def _response_table(title: str, rows: Sequence[NotchRow]) -> Table:
    headers = (
        "notch",
        "frequency\nfactor",
        f"least damped{PAIR_UNIT}",
        Column("speed loop\nmargin [°]", drop=2),
        Column("position loop\nmargin [°]", drop=1),
        Column("motor step\n[rad/s]", drop=4),
        "load step\n[rad/s]",
        Column("peak\n[rad/s]", drop=3),
        "oscillation\nindex [%]",
        "overshoot\n[%]",
        "settling\ntime [s]",
    )
    view = plain_table(title, headers)
    for row in rows:
        view.add_row(
            row.name,
            "" if row.notch is None else f"{row.factor:.4g}",
            _pair(*row.least_damped),
            f"{row.phase_margin_deg:.2f}",
            f"{row.position_margin_deg:.2f}",
            f"{row.motor_step_variation:.5g}",
            f"{row.load_step_variation:.5g}",
            f"{row.position_step_peak_rad_s:.5g}",
            f"{100.0 * row.oscillation:.2f}",
            f"{100.0 * row.overshoot:.2f}",
            f"{row.settling_s:.4f}",
        )
    return view


def _digital_table(rows: Sequence[SampledNotch], period_s: float) -> Table:
    title = f"\nNotch sampled every {1e3 * period_s:g} ms (bilinear): gain at the notch frequency"
    headers = (
        "notch",
        "frequency\n[rad/s]",
        Column("without prewarping\n[rad/s]", drop=1),
        "frequency shift\n[%]",
        "gain, continuous\n[%]",
        Column("gain, prewarped\n[%]", drop=2),
        "gain, without\nprewarping [%]",
    )
    view = plain_table(title, headers)
    for row in rows:
        view.add_row(
            row.name,
            f"{row.frequency_rad_s:.6g}",
            f"{row.unwarped_rad_s:.6g}",
            f"{100.0 * row.shift:.4f}",
            f"{100.0 * row.depth:.4f}",
            f"{100.0 * row.prewarped:.4f}",
            f"{100.0 * row.unwarped:.4f}",
        )
    return view


def _verdict_lines(rows: Sequence[NotchRow]) -> list[str]:
    """Compare each placement with the loop without notch."""
    bare, *placed = rows
    before = bare.least_damped.damping
    lines = []
    for row in placed:
        after = row.least_damped.damping
        change = "better" if after > before else "worse"
        variation = row.load_step_variation / bare.load_step_variation
        line = (
            f"{row.name}: {change} damped, damping ratio {after:.3f} instead of {before:.3f}; "
            f"a torque on the load moves it {variation:.2f} times as much"
        )
        for pair in row.hidden:
            line += (
                f" and excites the cancelled pair at {pair.frequency_rad_s:.4g} rad/s, "
                f"damping ratio {pair.damping:.3f}"
            )
        lines.append(line)
    return lines


def _pair_lines(pairs: Iterable[PolePair]) -> str:
    return "\n".join(_pair(*pair) for pair in pairs)


def _pair(frequency_rad_s: float, damping: float) -> str:
    return f"{frequency_rad_s:.2f}  {damping:.3f}"
