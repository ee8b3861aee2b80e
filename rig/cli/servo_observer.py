"""`rig servo observer`: a torque disturbance observer on an elastic joint, over the time constant of its filter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from rig.cli.output import check_folder, out, print_json, wide
from rig.errors import ConfigError

if TYPE_CHECKING:
    from rig.servo.loops import Mode
    from rig.servo_studies.observer import ObserverRow, ObserverTask, Rejection, Turns

PLAIN: Any = {"title_justify": "left", "box": None, "padding": (0, 2, 0, 0)}
CORNER = "T_f [s]"
PAIR_LEGEND = (
    "frequency [rad/s] and damping; of the pair that a torque on the motor moves, and of the stiff load's least damped pole.",
    "H_f printed: by the denominator as source 001 prints it, with Jm for Jlr in its last term; right only towards T_f = 0.",
)
TORQUE_LEGEND = (
    "low: speed of the load over a torque on the motor at ω_z / 100, as a share of that without observer; largest: over all",
    "frequencies [rad/s per N m]. Peak: of the load's speed after a step of 1 N m [rad/s]; rings: its variation beyond up and",
    "down, over up and down, within 12 periods of ω_z. Speeds are at the motor's side of the gear.",
)
FITTED = "Fitted: the constants that have all five printed modes of source 001's rig; they are inferred, not published."
LISTED = "Source 001 lists the joint's constants; the time constants are ours, as the numbers of its simulation are lost."


def observer(
    joint: Annotated[str, typer.Option(help="Source 001's harmonic drive: listed or fitted constants.")] = "listed",
    time_constants: Annotated[
        str | None, typer.Option(help="T_f of Q = 1 / (1 + s T_f) in s, with commas; 1e-9 to 1e9 unless given.")
    ] = None,
    nominal_inertia: Annotated[
        float | None, typer.Option(help="Of the rigid nominal model in kg m²; the motor alone unless given.")
    ] = None,
    order: Annotated[
        int, typer.Option(help="Of Q: 1 is the lecture's; above it Butterworth's, with its corner at 1 / T_f.")
    ] = 1,
    plot: Annotated[Path | None, typer.Option(help="Draw damping over T_f and the load's speed: .svg, .png or .pdf.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")] = False,
) -> int:
    """Show what a torque disturbance observer does to an elastic joint: damping, rejection, responses, over T_f."""
    from rig.servo_studies.joints import rig_joint  # python-control takes its time
    from rig.servo_studies.observer import TIME_CONSTANTS_S, ObserverTask, study, turns, without

    if plot is not None:
        from rig import picture_file

        picture_file.check(plot)
        check_folder("--plot", plot)
    times = TIME_CONSTANTS_S if time_constants is None else _numbers(time_constants)
    task = ObserverTask(joint=rig_joint(joint), time_constants_s=times, nominal_inertia_kg_m2=nominal_inertia, order=order)
    rows, bare, turn = study(task), without(task), turns(task)
    if plot is not None:
        from rig.servo_studies.observer_figure import draw_observer

        picture_file.save(draw_observer(task), plot)
    inferred = FITTED if joint == "fitted" else LISTED
    if as_json:
        print_json(_document(joint, task, rows, bare, turn) | {"inferred": inferred})
    else:
        _print(joint, task, rows, bare, turn)
        out.print(inferred, style="dim")
    return 0


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in text.split(",") if word.strip())
    except ValueError:
        raise ConfigError(f"--time-constants {text!r}; must be numbers with commas, in s: e.g. 5e-4,2e-3") from None


def _document(joint: str, task: ObserverTask, rows: Sequence[ObserverRow], bare: Rejection, turn: Turns) -> dict[str, Any]:
    return {
        "exit_status": "ok",
        "joint": joint,
        "order": task.order,
        "nominal_inertia_kg_m2": float(task.rigid.denominator[0]),
        "without": _told(bare),
        "locked_rotor": task.locked._asdict(),
        "break_even_s": turn.break_even_s,
        "best_s": turn.best_s,
        "best": _pair(turn.best),
        "rows": [
            {
                "time_constant_s": row.time_constant_s,
                "rigid_nominal": _told(row.rigid) | {"effect": _effect(row, task)},
                "elastic_nominal": _told(row.elastic),
                "stiff_load": row.stiff._asdict() | {"low": row.stiff_low},
                "printed_h_f": _pair(row.printed),
            }
            for row in rows
        ],
        "verdict": _verdict(task, rows, turn),
    }


def _told(side: Rejection) -> dict[str, Any]:
    return side._asdict() | {"pair": _pair(side.pair)}


def _pair(pair: Mode | None) -> dict[str, float] | None:
    return None if pair is None else pair._asdict()


def _effect(row: ObserverRow, task: ObserverTask) -> str:
    """What the rigid nominal does to the pair, at a millionth of the damping: excites, damps or leaves it."""
    found = 1.0 if row.rigid.pair is None else row.rigid.pair.damping
    if abs(found - task.bare.damping) < 1e-6 * task.bare.damping:
        return "leaves"
    return "damps" if found > task.bare.damping else "excites"


def _print(joint: str, task: ObserverTask, rows: Sequence[ObserverRow], bare: Rejection, turn: Turns) -> None:
    wide.print(_pair_table(joint, task, rows, bare))
    out.print("\n".join(PAIR_LEGEND), style="dim")
    wide.print(_torque_table(rows, bare))
    out.print("\n".join(TORQUE_LEGEND), style="dim")
    for line in _verdict(task, rows, turn):
        out.print(line)


def _pair_table(joint: str, task: ObserverTask, rows: Sequence[ObserverRow], bare: Rejection) -> Table:
    j = task.joint
    title = f"Joint {joint}: Jm {j.motor_inertia_kg_m2:.6g}, Jlr {j.reflected_inertia_kg_m2:.6g} kg m²; "
    title += f"rigid nominal of {task.rigid.denominator[0]:.6g} kg m²; Q of order {task.order}"
    headers = (CORNER, "rigid nominal", "the load", "elastic nominal", "stiff load, rigid nominal", "H_f printed")
    view = _table(title, headers)
    view.add_row("none", _mode(bare.pair), "", _mode(bare.pair), "", "")
    for row in rows:
        cells = (
            _mode(row.rigid.pair),
            _effect(row, task),
            _mode(row.elastic.pair),
            _mode(row.stiff),
            _mode(row.printed) if task.order == 1 else "-",
        )
        view.add_row(f"{row.time_constant_s:g}", *cells)
    return view


def _torque_table(rows: Sequence[ObserverRow], bare: Rejection) -> Table:
    headers = (CORNER, "nominal", "low", "largest", "motor step: peak", "rings", "load step: peak", "rings", "stiff load: low")
    view = _table("\nWhat a torque does to the load", headers)
    view.add_row("none", "", *_figures(bare), "1")
    for row in rows:
        view.add_row(f"{row.time_constant_s:g}", "rigid", *_figures(row.rigid), f"{row.stiff_low:.4g}")
        view.add_row("", "elastic", *_figures(row.elastic), "")
    return view


def _figures(side: Rejection) -> tuple[str, ...]:
    motor = (f"{side.motor_step_peak_rad_s:.4g}", f"{side.motor_step_rings:.2f}")
    load = (f"{side.load_step_peak_rad_s:.4g}", f"{side.load_step_rings:.2f}")
    return f"{side.low:.4g}", f"{side.peak_rad_s_n_m:.4g}", *motor, *load


def _verdict(task: ObserverTask, rows: Sequence[ObserverRow], turn: Turns) -> list[str]:
    effects = {effect: [f"{1e3 * row.time_constant_s:g}" for row in rows if _effect(row, task) == effect] for effect in EFFECTS}
    told = [f"{word} at T_f = {', '.join(effects[effect])} ms" for effect, word in EFFECTS.items() if effects[effect]]
    best = "nothing swings" if turn.best is None else f"damping {turn.best.damping:.3f}"
    lines = [
        f"without observer the pair swings at {task.bare.frequency_rad_s:.2f} rad/s with damping {task.bare.damping:.3f}; "
        f"while the motor stands, the load at {task.locked.frequency_rad_s:.2f} rad/s with {task.locked.damping:.3f}",
        f"rigid nominal: {'; '.join(told)}; most at {1e3 * turn.best_s:.3g} ms: {best}",
    ]
    if turn.break_even_s is not None:
        lines.append(
            f"caution: faster than T_f = {1e3 * turn.break_even_s:.3g} ms it takes the load's reaction for a disturbance, and "
            "the load rings; but the faster, the more torque it rejects"
        )
    worst = max(rows, key=lambda row: row.elastic.load_step_rings)
    lines.append(
        "elastic nominal: keeps the joint's own pair whatever T_f, and rejects only what is not the joint's; after a torque on "
        f"the load that rings {worst.elastic.load_step_rings:.2f} at T_f = {1e3 * worst.time_constant_s:g} ms"
    )
    return lines


EFFECTS = {"excites": "excites the load", "leaves": "leaves it as it is", "damps": "damps it"}


def _mode(pair: Mode | None) -> str:
    return "none swings" if pair is None else f"{pair.frequency_rad_s:.6g}  {pair.damping:.4f}"


def _table(title: str, headers: Sequence[str]) -> Table:
    view = Table(title=title, **PLAIN)
    for k, header in enumerate(headers):
        view.add_column(header, justify="right" if k else "left", no_wrap=True)
    return view
