"""`rig servo observer`: a torque disturbance observer on an elastic joint, over the time constant of its filter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from rig.errors import ConfigError
from rig.studies.servo.observer import INFERRED_NOTES
from rig.ui.cli.output import COLOUR, plain_table, print_json, say, wide

if TYPE_CHECKING:
    from rig.drives.servo.loops import PolePair
    from rig.studies.servo.observer import ObserverRow, ObserverTask, Rejection
    from rig.studies.servo.observer_damping import Interval, TimeConstantRanges

CORNER = "T_f\n[ms]"
LIMIT = 1e6  # a filter this much faster or slower than the joint is told as the limit
PAIR_LEGEND = (
    "rigid, elastic nominal: the least damped of the poles that a torque on the motor moves, Q's included; stiff load: the "
    "same with Jm and Jlr in one. Effect of the rigid nominal: it excites what it leaves less damped than joint and Q each are "
    "alone, and damps what it leaves more damped than the joint is; 0.1 % counts as none."
)
PRINTED_LEGEND = (
    "H_f as printed: the pair of the denominator that source 001 prints, with Jm for Jlr in its last term; right only towards "
    "T_f = 0."
)
TORQUE_LEGEND = (
    "low: speed of the load over a torque on the motor at ω_z / 100, as a share of that without observer; largest: over all "
    "frequencies. Peak: of the load's speed after a step of 1 N m on motor or load; rings: its variation beyond up and down, "
    "over up and down, within 12 periods of ω_z. Speeds are at the motor's side of the gear."
)


def observer(
    joint: Annotated[
        str,
        typer.Option(
            help="Source 001's harmonic drive, listed or fitted constants; or \\[model] of a comparison FILE.toml."
        ),
    ] = "listed",
    time_constants: Annotated[
        str | None,
        typer.Option(
            help="T_f of Q = 1 / (1 + s T_f) in s, with commas, each 1e-12 to 1e12; from one limit to the other unless given."
        ),
    ] = None,
    nominal_inertia: Annotated[
        float | None,
        typer.Option(
            help="Of the rigid nominal model in kg m², 1e-12 to 1e12; the motor alone unless given."
        ),
    ] = None,
    order: Annotated[
        int,
        typer.Option(
            help="Of Q, 1 to 8: 1 is the lecture's; above it Butterworth's, with its corner at 1 / T_f."
        ),
    ] = 1,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw damping over T_f and the load's speed: .svg, .png or .pdf."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
) -> int:
    """Show what a torque disturbance observer does to an elastic joint: damping, rejection, responses, over T_f."""
    from rig.studies.servo.joints import named_joint  # python-control takes its time
    from rig.studies.servo.observer import (
        TIME_CONSTANTS_S,
        ObserverTask,
        observer_rows,
        without_observer,
    )
    from rig.studies.servo.observer_damping import time_constant_ranges

    if plot is not None:
        from rig.ui.plots import picture_file

        picture_file.check(plot)
    times = TIME_CONSTANTS_S if time_constants is None else _numbers(time_constants)
    _check(nominal_inertia, order)
    task = ObserverTask(
        joint=named_joint(joint),
        time_constants_s=times,
        nominal_inertia_kg_m2=nominal_inertia,
        order=order,
    )
    rows, bare, turn = observer_rows(task), without_observer(task), time_constant_ranges(task)
    if plot is not None:
        from rig.ui.plots.servo_observer import draw_observer

        picture_file.save(draw_observer(task), plot)
    if as_json:
        print_json(_document(joint, task, rows, bare, turn))
    else:
        _print(joint, task, rows, bare, turn)
    return 0


def _numbers(text: str) -> tuple[float, ...]:
    from rig.drives.servo.errors import check_range

    try:
        values = tuple(float(word) for word in text.split(",") if word.strip())
    except ValueError:
        values = ()
    if not values:
        raise ConfigError(
            f"--time-constants {text!r}; must be numbers with commas, in s: e.g. 5e-4,2e-3"
        )
    for value in values:
        check_range("--time-constants", value, 1e-12, 1e12, "give seconds, e.g. 5e-4,2e-3")
    return values


def _check(nominal_inertia: float | None, order: int) -> None:
    from rig.drives.servo.disturbance_design import MAX_FILTER_ORDER
    from rig.drives.servo.errors import check_range

    if nominal_inertia is not None:
        check_range(
            "--nominal-inertia", nominal_inertia, 1e-12, 1e12, "give kg m², as felt at the motor"
        )
    check_range("--order", order, 1, MAX_FILTER_ORDER, "1 or 2 is usual")


def _document(
    joint: str,
    task: ObserverTask,
    rows: Sequence[ObserverRow],
    bare: Rejection,
    turn: TimeConstantRanges,
) -> dict[str, Any]:
    return {
        "exit_status": "ok",
        "joint": joint,
        "order": task.order,
        "nominal_inertia_kg_m2": float(task.rigid.denominator[0]),
        "without": _told(bare),
        "locked_rotor": task.locked_rotor_pair._asdict(),
        "excited_s": turn.excited,  # an end that is null is infinite
        "unstable_s": turn.unstable,
        "best_s": turn.best_s,
        "best": turn.best._asdict(),
        "rows": [
            {
                "time_constant_s": row.time_constant_s,
                "rigid_nominal": _told(row.rigid)
                | {"effect": task.effect(row.rigid.least_damped.damping)},
                "elastic_nominal": _told(row.elastic),
                "stiff_load": row.stiff._asdict()
                | {"low": row.stiff_low, "stable": row.stiff.damping >= 0.0},
                "printed_h_f": row.printed and row.printed._asdict(),
            }
            for row in rows
        ],
        "verdict": [*_verdict(task, rows, turn), *_cautions(turn)],
        "inferred": INFERRED_NOTES.get(joint),
    }


def _told(side: Rejection) -> dict[str, Any]:
    return side._asdict() | {"least_damped": side.least_damped._asdict(), "stable": side.stable}


def _print(
    joint: str,
    task: ObserverTask,
    rows: Sequence[ObserverRow],
    bare: Rejection,
    turn: TimeConstantRanges,
) -> None:
    wide.print(_pair_table(joint, task, rows, bare))
    say(f"{PAIR_LEGEND} {PRINTED_LEGEND}" if task.order == 1 else PAIR_LEGEND, "dim")
    wide.print(_torque_table(task, rows, bare))
    say(TORQUE_LEGEND, "dim")
    for line in _verdict(task, rows, turn):
        say(line)
    for line in _cautions(turn):
        say(line, COLOUR["bad" if "unstable" in line else "doubtful"])
    if joint in INFERRED_NOTES:
        say(INFERRED_NOTES[joint], "dim")


def _pair_table(
    joint: str, task: ObserverTask, rows: Sequence[ObserverRow], bare: Rejection
) -> Table:
    j, first = task.joint, task.order == 1
    title = f"Joint {joint}: Jm {j.motor_inertia_kg_m2:.6g}, Jlr {j.reflected_inertia_kg_m2:.6g} kg m²; "
    title += f"rigid nominal of {task.rigid.denominator[0]:.6g} kg m²; Q of order {task.order}"
    poles = [
        f"{name}\n[rad/s], damping"
        for name in ("rigid nominal", "elastic nominal", "stiff load, rigid nominal")
    ]
    view = plain_table(
        title,
        (CORNER, poles[0], "effect", *poles[1:], *["H_f as printed\n[rad/s], damping"] * first),
    )
    view.add_row("none", _mode(bare.least_damped), "", _mode(bare.least_damped), "", *[""] * first)
    for row in rows:
        effect = task.effect(row.rigid.least_damped.damping)
        view.add_row(
            _corner(task, row.time_constant_s),
            _mode(row.rigid.least_damped),
            Text(effect, style=COLOUR["bad"] if effect == "unstable" else ""),
            _mode(row.elastic.least_damped),
            _mode(row.stiff),
            *[_mode(row.printed)] * first,
        )
    return view


def _torque_table(task: ObserverTask, rows: Sequence[ObserverRow], bare: Rejection) -> Table:
    steps = [
        f"{place} step:\n{what}"
        for place in ("motor", "load")
        for what in ("peak [rad/s]", "rings")
    ]
    headers = (
        CORNER,
        "nominal",
        "low,\nshare",
        "largest\n[rad/s per N m]",
        *steps,
        "stiff load:\nlow, share",
    )
    view = plain_table("\nWhat a torque does to the load", headers)
    view.add_row("none", "", *_figures(bare), "1")
    for row in rows:
        view.add_row(
            _corner(task, row.time_constant_s),
            "rigid",
            *_figures(row.rigid),
            _figure(row.stiff_low),
        )
        view.add_row("", "elastic", *_figures(row.elastic), "")
    return view


def _figures(side: Rejection) -> Sequence[str | Text]:
    if not side.stable:
        return [Text("unstable", style=COLOUR["bad"]), *["-"] * 5]
    motor = (_figure(side.motor_step_peak_rad_s), f"{side.motor_step_rings:.2f}")
    load = (_figure(side.load_step_peak_rad_s), f"{side.load_step_rings:.2f}")
    return _figure(side.low), _figure(side.peak_rad_s_n_m), *motor, *load


def _figure(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.4g}"


def _verdict(
    task: ObserverTask, rows: Sequence[ObserverRow], turn: TimeConstantRanges
) -> list[str]:
    found = [
        (task.effect(row.rigid.least_damped.damping), _corner(task, row.time_constant_s))
        for row in rows
    ]
    times = {effect: [t for said, t in found if said == effect] for effect in EFFECTS}
    told = "; ".join(
        f"{word} at {_at(times[effect])}" for effect, word in EFFECTS.items() if times[effect]
    )
    worst = max(rows, key=lambda row: row.elastic.load_step_rings)
    return [
        f"without observer the pair swings at {task.joint_pair.frequency_rad_s:.2f} rad/s with damping {task.joint_pair.damping:.3f}; "
        f"while the motor stands, the load at {task.locked_rotor_pair.frequency_rad_s:.2f} rad/s with {task.locked_rotor_pair.damping:.3f}",
        f"rigid nominal: {told}; best at {_milliseconds(turn.best_s)} ms, where the least damping is {turn.best.damping:.3f}",
        "elastic nominal: keeps the joint's own pair whatever T_f, and rejects only what is not the joint's; after a torque on "
        f"the load that rings {worst.elastic.load_step_rings:.2f} at {_at([_corner(task, worst.time_constant_s)])}",
    ]


def _cautions(turn: TimeConstantRanges) -> list[str]:
    """Of the rigid nominal: all time constants to be careful with."""
    lines = []
    if turn.excited:
        lines.append(
            f"caution: the load is excited at {_spans(turn.excited)}: its reaction is taken for a disturbance, and it rings; "
            "but the faster Q, the more torque is rejected"
        )
    if turn.unstable:
        lines.append(
            f"caution: unstable at {_spans(turn.unstable)}: take a lower order, another time constant, or a lower nominal "
            "inertia"
        )
    return lines


EFFECTS = {
    "excites": "excites the load",
    "unstable": "is unstable",
    "leaves": "leaves it as it is",
    "damps": "damps it",
}


def _spans(intervals: Sequence[Interval]) -> str:
    return "T_f " + " and ".join(_span(*interval) for interval in intervals)


def _span(low_s: float, high_s: float) -> str:
    low, high = _milliseconds(low_s), f"{_milliseconds(high_s)} ms"
    if math.isinf(high_s):
        return f"> {low} ms" if low_s else "from 1e-4 / ω_z to 1e4 / ω_z"
    return f"{low} to {high}" if low_s else f"< {high}"


def _milliseconds(time_s: float) -> str:
    return f"{1e3 * time_s:.3g}" if time_s < 1.0 else f"{1e3 * time_s:.0f}"


def _corner(task: ObserverTask, time_constant_s: float) -> str:
    """In ms, or as the limit that it amounts to."""
    share = time_constant_s * task.joint.antiresonance_rad_s
    if share < 1.0 / LIMIT:
        return "→ 0"
    return "→ ∞" if share > LIMIT else f"{1e3 * time_constant_s:g}"


def _at(corners: Sequence[str]) -> str:
    return f"T_f {', '.join(corners)}" + ("" if corners[-1].startswith("→") else " ms")


def _mode(pair: PolePair | None) -> str:
    return "none swings" if pair is None else f"{pair.frequency_rad_s:.6g}  {pair.damping:.4f}"
