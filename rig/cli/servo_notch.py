"""`rig servo notch`: a notch filter against a joint's resonance, inside the speed loop and upstream of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from rig.cli.output import check_folder, out, print_json, wide
from rig.errors import ConfigError

if TYPE_CHECKING:
    from rig.servo.two_mass import TwoMass
    from rig.servo_studies.notch import NotchRow, NotchTask, Sampled

PLAIN: Any = {"title_justify": "left", "box": None, "padding": (0, 2, 0, 0)}
EXAMPLE = {"antiresonance": 200.0, "inertia_ratio": 1.0, "damping": 0.1}  # source 001, its simulations
UNITS = ("frequency [rad/s] and damping of the poles; hidden: cancelled by the notch, only disturbances move them",)
LEGEND = (
    "torque steps: total variation of the load's speed after 1 N m on motor or load [rad/s], at the motor's side of the gear;",
    "peak: of the load's speed after a setpoint step of 1 rad [rad/s]; rings: variation beyond up and down, over up and down.",
)
LOST = (
    "Source 001 gives joint, gains and where the notch lies; the numbers of its figures are lost. Inferred, not published:",
    "that gains are in shares of ω_z and of the rigid inertia Jm + Jlr; the damping of the notch's poles.",
)
FITTED = "Fitted: the constants that have all five printed modes of source 001's rig; they are inferred, not published."


def notch(
    joint: Annotated[
        str, typer.Option(help="normalised (source 001's example), or its harmonic drive: listed or fitted constants.")
    ] = "normalised",
    antiresonance: Annotated[float | None, typer.Option(help="Of the normalised joint, ω_z in rad/s; 200.")] = None,
    inertia_ratio: Annotated[float | None, typer.Option(help="Of the normalised joint, load over motor; 1.")] = None,
    damping: Annotated[float | None, typer.Option(help="Of the normalised joint, ζ_z at the antiresonance; 0.1.")] = None,
    speed_loop: Annotated[float, typer.Option(help="Speed gain over ω_z (Jm + Jlr).")] = 1.0,
    position_loop: Annotated[float, typer.Option(help="Position gain over ω_z.")] = 0.1,
    reset_time: Annotated[float, typer.Option(help="Of the speed loop's integrator, times ω_z.")] = 10.0,
    notch_damping: Annotated[float, typer.Option(help="Of the notch's poles, ζ_2.")] = 1.0,
    detune: Annotated[float, typer.Option(help="Frequency of a notch that is tuned wrongly, over the right one.")] = 0.9,
    sample_time: Annotated[float, typer.Option(help="Of the drive in s, for the digital notch.")] = 0.001,
    plot: Annotated[Path | None, typer.Option(help="Draw poles and responses of the load: .svg, .png or .pdf.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")] = False,
) -> int:
    """Compare a notch filter inside the speed loop, upstream of it, and none: poles, margins, what the load does."""
    from rig.servo.cascade import Cascade  # python-control takes its time
    from rig.servo_studies.notch import NotchTask, compare, sampled

    if plot is not None:
        from rig import picture_file

        picture_file.check(plot)
        check_folder("--plot", plot)
    own = {"antiresonance": antiresonance, "inertia_ratio": inertia_ratio, "damping": damping}
    about = _joint(joint, own)
    gains = Cascade.normalised(about, speed_loop, position_loop, reset_time)
    task = NotchTask(joint=about, gains=gains, denominator_damping=notch_damping)
    rows, wrong, digital = compare(task), _wrong(task, detune), sampled(task, sample_time)
    if plot is not None:
        from rig.servo_studies.notch_figure import draw_notch

        picture_file.save(draw_notch(task), plot)
    if as_json:
        print_json(_document(joint, task, rows, wrong, digital, sample_time))
    else:
        _print(joint, task, rows, wrong, digital, sample_time)
    return 0


def _joint(name: str, own: dict[str, float | None]) -> TwoMass:
    """Raises ConfigError for options that do not go together, PlanError for an unknown joint."""
    from rig.servo.two_mass import TwoMass
    from rig.servo_studies.joints import JOINTS, rig_joint

    if name == "normalised":
        values = {key: EXAMPLE[key] if value is None else value for key, value in own.items()}
        return TwoMass.normalised(values["antiresonance"], values["inertia_ratio"], values["damping"])
    given = [f"--{key.replace('_', '-')} {value:g}" for key, value in own.items() if value is not None]
    if given and name in JOINTS:
        raise ConfigError(f"{given[0]} with --joint {name}; must be with --joint normalised: leave one of the two out")
    return rig_joint(name)


def _wrong(task: NotchTask, detune: float) -> tuple[NotchRow, ...]:
    """Inside and upstream, too low and as much too high."""
    from rig.servo_studies.notch import detuned

    factors = sorted({detune, 1.0 / detune} - {1.0}) if detune > 0.0 else [detune]
    return tuple(row for factor in factors for row in detuned(task, factor))


def _document(
    joint: str,
    task: NotchTask,
    rows: Sequence[NotchRow],
    wrong: Sequence[NotchRow],
    digital: Sequence[Sampled],
    period_s: float,
) -> dict[str, Any]:
    return {
        "exit_status": "ok",
        "joint": joint,
        "antiresonance_rad_s": task.joint.antiresonance_rad_s,
        "gains": {
            "speed_gain_n_m_s_rad": task.gains.speed_gain_n_m_s_rad,
            "reset_time_s": task.gains.reset_time_s,
            "position_gain_1_s": task.gains.position_gain_1_s,
        },
        "placements": [_told(row) for row in rows],
        "detuned": [_told(row) for row in wrong],
        "sample_time_s": period_s,
        "sampled": [row._asdict() | {"shift": row.shift} for row in digital],
        "inferred": " ".join(_inferred(joint)),
    }


def _told(row: NotchRow) -> dict[str, Any]:
    facts = row._asdict() | {
        key: [m._asdict() for m in getattr(row, key)] for key in ("speed_modes", "position_modes", "hidden")
    }
    if row.notch is None:
        return facts
    n = row.notch
    return facts | {
        "notch": {
            "frequency_rad_s": n.frequency_rad_s,
            "numerator_damping": n.numerator_damping,
            "denominator_damping": n.denominator_damping,
            "depth": n.depth,
            "depth_db": n.depth_db,
        }
    }


def _inferred(joint: str) -> tuple[str, ...]:
    return (*LOST, FITTED) if joint == "fitted" else LOST


def _print(
    joint: str,
    task: NotchTask,
    rows: Sequence[NotchRow],
    wrong: Sequence[NotchRow],
    digital: Sequence[Sampled],
    period_s: float,
) -> None:
    wide.print(_pole_table(joint, task, rows))
    out.print("\n".join(UNITS), style="dim")
    wide.print(_response_table("\nWhat the load does", rows))
    wide.print(_response_table("\nThe same when the notch is tuned wrongly", wrong))
    out.print("\n".join(LEGEND), style="dim")
    wide.print(_digital_table(digital, period_s))
    out.print("\n".join(_inferred(joint)), style="dim")
    for line in _verdict(rows):
        out.print(line)


def _pole_table(joint: str, task: NotchTask, rows: Sequence[NotchRow]) -> Table:
    j = task.joint
    title = f"Joint {joint}: ω_z {j.antiresonance_rad_s:.6g} rad/s; Kpv {task.gains.speed_gain_n_m_s_rad:.6g} N m s/rad, "
    title += f"Tiv {task.gains.reset_time_s:.6g} s, Kpp {task.gains.position_gain_1_s:.6g} 1/s"
    view = _table(
        title, ("notch", "tuned to", "speed loop", "position loop", "hidden", "phase margin [°]", "crossover"), left=1
    )
    for row in rows:
        tuned = "" if row.notch is None else _mode(row.notch.frequency_rad_s, row.notch.numerator_damping)
        loops = ("\n".join(_mode(*mode) for mode in modes) for modes in (row.speed_modes, row.position_modes, row.hidden))
        view.add_row(row.name, tuned, *loops, f"{row.phase_margin_deg:.2f}", f"{row.crossover_rad_s:.2f}", end_section=True)
    return view


def _response_table(title: str, rows: Sequence[NotchRow]) -> Table:
    names = ("notch", "tuned", "least damped", "phase margin [°]", "motor step", "load step")
    view = _table(title, (*names, "peak", "rings [%]", "overshoot [%]", "settled [s]"), left=1)
    for row in rows:
        view.add_row(
            row.name,
            "" if row.notch is None else "right" if row.factor == 1.0 else f"×{row.factor:.4g}",
            _mode(*row.least_damped),
            f"{row.phase_margin_deg:.2f}",
            f"{row.motor_step_variation:.5g}",
            f"{row.load_step_variation:.5g}",
            f"{row.position_step_peak_rad_s:.5g}",
            f"{100.0 * row.oscillation:.2f}",
            f"{100.0 * row.overshoot:.2f}",
            f"{row.settling_s:.4f}",
        )
    return view


def _digital_table(rows: Sequence[Sampled], period_s: float) -> Table:
    names = ("notch", "tuned to [rad/s]", "without prewarp at", "shift [%]", "passes", "prewarped", "without")
    view = _table(f"\nSampled every {period_s:g} s (bilinear): what passes of the frequency itself", names, left=1)
    for row in rows:
        passed = (f"{100.0 * share:.4f} %" for share in (row.depth, row.prewarped, row.unwarped))
        figures = (f"{row.frequency_rad_s:.6g}", f"{row.unwarped_rad_s:.6g}", f"{100.0 * row.shift:.4f}")
        view.add_row(row.name, *figures, *passed)
    return view


def _verdict(rows: Sequence[NotchRow]) -> list[str]:
    bare, *placed = rows
    lines = []
    for row in placed:
        before, after = bare.least_damped.damping, row.least_damped.damping
        moves = row.load_step_variation / bare.load_step_variation
        lines.append(
            f"{row.name}: {'better' if after > before else 'worse'} damped, {after:.3f} instead of {before:.3f}; a torque on "
            f"the load moves it {moves:.2f} times as much"
            + "".join(
                f" and shows the hidden pair at {m.frequency_rad_s:.4g} rad/s, damping {m.damping:.3f}" for m in row.hidden
            )
        )
    return lines


def _mode(frequency_rad_s: float, damping: float) -> str:
    return f"{frequency_rad_s:.2f}  {damping:.3f}"


def _table(title: str, headers: Sequence[str], left: int) -> Table:
    view = Table(title=title, **PLAIN)
    for k, header in enumerate(headers):
        view.add_column(header, justify="left" if k < left else "right", no_wrap=True)
    return view
