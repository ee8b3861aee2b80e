"""JSON document and verdict of `rig servo observer`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rig.studies.servo.observer import INFERRED_NOTES

if TYPE_CHECKING:
    from rig.studies.servo.observer import ObserverRow, ObserverTask, Rejection
    from rig.studies.servo.observer_damping import Interval, TimeConstantRanges

LIMIT_RATIO = 1e6  # a filter this much faster or slower than the joint is shown as its limit
EFFECTS = {  # of the rigid nominal: phrase of the verdict
    "excites": "excites the load",
    "unstable": "is unstable",
    "leaves": "leaves it as it is",
    "damps": "damps it",
}


def document(
    joint: str,
    task: ObserverTask,
    rows: Sequence[ObserverRow],
    bare: Rejection,
    turn: TimeConstantRanges,
) -> dict[str, Any]:
    """Create the JSON document of an observer study; an interval bound of null is infinite."""
    return {
        "exit_status": "ok",
        "joint": joint,
        "order": task.order,
        "nominal_inertia_kg_m2": float(task.rigid.denominator[0]),
        "without": _side_document(bare),
        "locked_rotor": task.locked_rotor_pair._asdict(),
        "excited_s": turn.excited,
        "unstable_s": turn.unstable,
        "best_s": turn.best_s,
        "best": turn.best._asdict(),
        "rows": [_row_document(task, row) for row in rows],
        "verdict": [*verdict_lines(task, rows, turn), *caution_lines(turn)],
        "inferred": INFERRED_NOTES.get(joint),
    }


def _row_document(task: ObserverTask, row: ObserverRow) -> dict[str, Any]:
    effect = task.effect(row.rigid.least_damped.damping)
    stable = row.stiff.damping >= 0.0
    return {
        "time_constant_s": row.time_constant_s,
        "rigid_nominal": _side_document(row.rigid) | {"effect": effect},
        "elastic_nominal": _side_document(row.elastic),
        "stiff_load": row.stiff._asdict() | {"low": row.stiff_low, "stable": stable},
        "printed_h_f": row.printed and row.printed._asdict(),
    }


def _side_document(side: Rejection) -> dict[str, Any]:
    return side._asdict() | {"least_damped": side.least_damped._asdict(), "stable": side.stable}


def verdict_lines(
    task: ObserverTask, rows: Sequence[ObserverRow], turn: TimeConstantRanges
) -> list[str]:
    """Describe the joint alone, the rigid nominal and the elastic nominal, one line each."""
    times: dict[str, list[str]] = {effect: [] for effect in EFFECTS}
    for row in rows:
        effect = task.effect(row.rigid.least_damped.damping)
        times[effect].append(time_constant_text(task, row.time_constant_s))
    phrases = [
        f"{phrase} at {_list_text(times[effect])}"
        for effect, phrase in EFFECTS.items()
        if times[effect]
    ]
    effects = "; ".join(phrases)
    worst = max(rows, key=lambda row: row.elastic.load_step_rings)
    worst_time = _list_text([time_constant_text(task, worst.time_constant_s)])
    return [
        f"without observer the pair swings at {task.joint_pair.frequency_rad_s:.2f} rad/s "
        f"with damping {task.joint_pair.damping:.3f}; while the motor stands, the load at "
        f"{task.locked_rotor_pair.frequency_rad_s:.2f} rad/s with "
        f"{task.locked_rotor_pair.damping:.3f}",
        f"rigid nominal: {effects}; best at {_milliseconds(turn.best_s)} ms, "
        f"where the least damping is {turn.best.damping:.3f}",
        "elastic nominal: keeps the joint's own pair whatever T_f, and rejects only what is not "
        f"the joint's; after a torque on the load that rings {worst.elastic.load_step_rings:.2f} "
        f"at {worst_time}",
    ]


def caution_lines(turn: TimeConstantRanges) -> list[str]:
    """List the time constants at which the rigid nominal excites the load or is unstable."""
    lines = []
    if turn.excited:
        lines.append(
            f"caution: the load is excited at {_intervals_text(turn.excited)}: its reaction is "
            "taken for a disturbance, and it rings; but the faster Q, the more torque is rejected"
        )
    if turn.unstable:
        lines.append(
            f"caution: unstable at {_intervals_text(turn.unstable)}: take a lower order, another "
            "time constant, or a lower nominal inertia"
        )
    return lines


def _intervals_text(intervals: Sequence[Interval]) -> str:
    return "T_f " + " and ".join(_interval_text(*interval) for interval in intervals)


def _interval_text(low_s: float, high_s: float) -> str:
    low = _milliseconds(low_s)
    if math.isinf(high_s):
        return f"> {low} ms" if low_s else "from 1e-4 / ω_z to 1e4 / ω_z"
    high = f"{_milliseconds(high_s)} ms"
    return f"{low} to {high}" if low_s else f"< {high}"


def _milliseconds(time_s: float) -> str:
    return f"{1e3 * time_s:.3g}" if time_s < 1.0 else f"{1e3 * time_s:.0f}"


def time_constant_text(task: ObserverTask, time_constant_s: float) -> str:
    """Format a time constant [ms], or the limit that it stands for."""
    share = time_constant_s * task.joint.antiresonance_rad_s
    if share < 1.0 / LIMIT_RATIO:
        return "→ 0"
    if share > LIMIT_RATIO:
        return "→ ∞"
    return f"{1e3 * time_constant_s:g}"


def _list_text(times: Sequence[str]) -> str:
    unit = "" if times[-1].startswith("→") else " ms"
    return f"T_f {', '.join(times)}{unit}"
