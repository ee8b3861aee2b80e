"""`rig servo notch`: a notch filter against a joint's resonance, inside the speed loop and upstream of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from rig.errors import ConfigError
from rig.studies.servo.joints import FITTED_NOTE
from rig.studies.servo.notch import UNPUBLISHED_NOTE
from rig.ui.cli.output import plain_table, print_json, say, wide

if TYPE_CHECKING:
    from rig.drives.servo.two_mass import TwoMass
    from rig.studies.servo.notch import NotchRow, SampledNotch
    from rig.studies.servo.notch_loops import NotchTask

EXAMPLE = {
    "antiresonance": 200.0,
    "inertia_ratio": 1.0,
    "damping": 0.1,
}  # source 001, its simulations
RANGES = {
    "antiresonance": (1e-3, 1e6, "give rad/s; source 001's is 200"),
    "inertia_ratio": (1e-3, 1e3, "load over motor, at the motor's side; source 001's is 1"),
    "damping": (0.0, 1.0, "source 001's is 0.1"),
    "speed_loop": (1e-3, 1e3, "1 is source 001's, a lower one is calmer"),
    "position_loop": (1e-4, 1e2, "0.1 is source 001's, a lower one is calmer"),
    "reset_time": (1e-2, 1e4, "10 is source 001's, a longer one is calmer"),
    "notch_damping": (1e-3, 1e2, "1 is usual"),
    "detune": (0.1, 10.0, "0.9 is a notch that lies 10 % too low"),
    "sample_time": (1e-6, 1.0, "give s; 0.001 is usual"),
}
BOTH = "\n[rad/s], damping"
POLE_LEGEND = (
    "hidden: cancelled by the notch, only disturbances move them. Margins: of phase, of the speed loop opened at the torque "
    "and of the position loop opened at the error of the motor's angle, each where it crosses gain 1."
)
LEGEND = (
    "motor, load step: total variation of the load's speed after 1 N m on motor or load, at the motor's side of the gear. "
    "After a setpoint step of 1 rad: peak: of the load's speed; rings: its variation beyond up and down, over up and down; "
    "overshoot: of the load's angle, in % of the step; settled: when that angle stays within 2 % of the step."
)


def notch(
    joint: Annotated[
        str,
        typer.Option(
            help="normalised (source 001's example), its harmonic drive (listed or fitted constants), or \\[model] of a "
            "comparison FILE.toml."
        ),
    ] = "normalised",
    antiresonance: Annotated[
        float | None,
        typer.Option(help="Of the normalised joint, ω_z in rad/s, 1e-3 to 1e6; 200 unless given."),
    ] = None,
    inertia_ratio: Annotated[
        float | None,
        typer.Option(help="Of the normalised joint, load over motor, 1e-3 to 1e3; 1 unless given."),
    ] = None,
    damping: Annotated[
        float | None,
        typer.Option(
            help="Of the normalised joint, ζ_z at the antiresonance, 0 to 1; 0.1 unless given."
        ),
    ] = None,
    speed_loop: Annotated[
        float, typer.Option(help="Speed gain over ω_z (Jm + Jlr), 1e-3 to 1e3.")
    ] = 1.0,
    position_loop: Annotated[
        float, typer.Option(help="Position gain over ω_z, 1e-4 to 100.")
    ] = 0.1,
    reset_time: Annotated[
        float, typer.Option(help="Of the speed loop's integrator, times ω_z, 0.01 to 1e4.")
    ] = 10.0,
    notch_damping: Annotated[
        float, typer.Option(help="Of the notch's poles, ζ_2, 1e-3 to 100.")
    ] = 1.0,
    detune: Annotated[
        float,
        typer.Option(
            help="Frequency of a notch that is tuned wrongly, over the right one, 0.1 to 10."
        ),
    ] = 0.9,
    sample_time: Annotated[
        float, typer.Option(help="Of the drive in s, for the digital notch, 1e-6 to 1.")
    ] = 0.001,
    plot: Annotated[
        Path | None, typer.Option(help="Draw poles and responses of the load: .svg, .png or .pdf.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")
    ] = False,
) -> int:
    """Compare a notch filter inside the speed loop, upstream of it, and none: poles, margins, what the load does."""
    from rig.drives.servo.cascade import Cascade  # python-control takes its time
    from rig.studies.servo.notch import compare, sampled
    from rig.studies.servo.notch_loops import NotchTask

    if plot is not None:
        from rig.ui.plots import picture_file

        picture_file.check(plot)
    _check(
        speed_loop=speed_loop,
        position_loop=position_loop,
        reset_time=reset_time,
        notch_damping=notch_damping,
        detune=detune,
        sample_time=sample_time,
    )
    own = {"antiresonance": antiresonance, "inertia_ratio": inertia_ratio, "damping": damping}
    about = _joint(joint, own)
    gains = Cascade.normalised(about, speed_loop, position_loop, reset_time)
    task = NotchTask(joint=about, gains=gains, denominator_damping=notch_damping)
    rows, wrong, digital = compare(task), _wrong(task, detune), sampled(task, sample_time)
    if plot is not None:
        from rig.ui.plots.servo_notch import draw_notch

        picture_file.save(draw_notch(task), plot)
    if as_json:
        print_json(_document(joint, task, rows, wrong, digital, sample_time))
    else:
        _print(joint, task, rows, wrong, digital, sample_time)
    return 0


def _check(**options: float) -> None:
    """Raises ServoError for a value out of its option's range."""
    from rig.drives.servo.errors import check_range

    for name, value in options.items():
        check_range(f"--{name.replace('_', '-')}", value, *RANGES[name])


def _joint(name: str, own: dict[str, float | None]) -> TwoMass:
    """Raises ConfigError for options that do not go together, PlanError for an unknown joint."""
    from rig.studies.servo.joints import named_joint

    given = {key: value for key, value in own.items() if value is not None}
    if name == "normalised":
        return _normalised(EXAMPLE | given)
    joint = named_joint(name, ("normalised",))
    for key, value in given.items():
        option = f"--{key.replace('_', '-')} {value:g}"
        raise ConfigError(
            f"{option} with --joint {name}; must be with --joint normalised: leave one of the two out"
        )
    return joint


def _normalised(values: dict[str, float]) -> TwoMass:
    from rig.drives.servo.two_mass import TwoMass

    _check(**values)
    most = 1.0 / math.sqrt(1.0 + values["inertia_ratio"])
    if not values["damping"] < most:
        raise ConfigError(
            f"--damping {values['damping']:g} with an inertia ratio of {values['inertia_ratio']:g} makes a joint that does not "
            f"swing; must be < {most:.4g}: lower it, or treat the joint as rigid"
        )
    return TwoMass.normalised(values["antiresonance"], values["inertia_ratio"], values["damping"])


def _wrong(task: NotchTask, detune: float) -> tuple[NotchRow, ...]:
    """Inside and upstream, too low and as much too high."""
    from rig.studies.servo.notch import detuned

    factors = sorted({detune, 1.0 / detune} - {1.0})
    return tuple(row for factor in factors for row in detuned(task, factor))


def _document(
    joint: str,
    task: NotchTask,
    rows: Sequence[NotchRow],
    wrong: Sequence[NotchRow],
    digital: Sequence[SampledNotch],
    period_s: float,
) -> dict[str, Any]:
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
        "placements": [_told(row) for row in rows],
        "detuned": [_told(row) for row in wrong],
        "sample_time_s": period_s,
        "sampled": [row._asdict() | {"shift": row.shift} for row in digital],
        "inferred": _inferred(joint),
    }


def _told(row: NotchRow) -> dict[str, Any]:
    facts = row._asdict() | {
        key: [m._asdict() for m in getattr(row, key)]
        for key in ("speed_modes", "position_modes", "hidden")
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


def _inferred(joint: str) -> str:
    return f"{UNPUBLISHED_NOTE} {FITTED_NOTE}" if joint == "fitted" else UNPUBLISHED_NOTE


def _print(
    joint: str,
    task: NotchTask,
    rows: Sequence[NotchRow],
    wrong: Sequence[NotchRow],
    digital: Sequence[SampledNotch],
    period_s: float,
) -> None:
    wide.print(_pole_table(joint, task, rows))
    say(POLE_LEGEND, "dim")
    wide.print(_response_table("\nWhat the load does", rows))
    if wrong:
        wide.print(_response_table("\nThe same when the notch is tuned wrongly", wrong))
    say(LEGEND, "dim")
    wide.print(_digital_table(digital, period_s))
    for line in _verdict(rows):
        say(line)
    say(_inferred(joint), "dim")


def _pole_table(joint: str, task: NotchTask, rows: Sequence[NotchRow]) -> Table:
    j = task.joint
    title = (
        f"Joint {joint}: ω_z {j.antiresonance_rad_s:.6g} rad/s, Jm {j.motor_inertia_kg_m2:.6g}, "
    )
    title += f"Jlr {j.reflected_inertia_kg_m2:.6g} kg m²; Kpv {task.gains.speed_gain_n_m_s_rad:.6g} N m s/rad, "
    title += f"Tiv {task.gains.reset_time_s:.6g} s, Kpp {task.gains.position_gain_1_s:.6g} 1/s"
    pairs = [name + BOTH for name in ("tuned to", "speed loop", "position loop", "hidden")]
    margins = [
        f"{loop} loop\n{what}"
        for loop in ("speed", "position")
        for what in ("margin\n[°]", "crossover\n[rad/s]")
    ]
    view = plain_table(title, ("notch", *pairs, *margins), left=1)
    for row in rows:
        tuned = (
            ""
            if row.notch is None
            else _mode(row.notch.frequency_rad_s, row.notch.numerator_damping)
        )
        loops = (
            "\n".join(_mode(*mode) for mode in modes)
            for modes in (row.speed_modes, row.position_modes, row.hidden)
        )
        speed = (f"{row.phase_margin_deg:.2f}", f"{row.crossover_rad_s:.2f}")
        position = (f"{row.position_margin_deg:.2f}", f"{row.position_crossover_rad_s:.2f}")
        view.add_row(row.name, tuned, *loops, *speed, *position, end_section=True)
    return view


def _response_table(title: str, rows: Sequence[NotchRow]) -> Table:
    margins = ("speed loop\nmargin [°]", "position loop\nmargin [°]")
    figures = (
        "motor step\n[rad/s]",
        "load step\n[rad/s]",
        "peak\n[rad/s]",
        "rings\n[%]",
        "overshoot\n[%]",
        "settled\n[s]",
    )
    view = plain_table(title, ("notch", "tuned", f"least damped{BOTH}", *margins, *figures), left=1)
    for row in rows:
        view.add_row(
            row.name,
            "" if row.notch is None else "right" if row.factor == 1.0 else f"×{row.factor:.4g}",
            _mode(*row.least_damped),
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
    names = ("notch", "tuned to\n[rad/s]", "without prewarp\nat [rad/s]", "shift\n[%]")
    passes = ("passes\n[%]", "prewarped\n[%]", "without\n[%]")
    title = f"\nSampled every {1e3 * period_s:g} ms (bilinear): what passes of the frequency itself"
    view = plain_table(title, (*names, *passes), left=1)
    for row in rows:
        passed = (f"{100.0 * share:.4f}" for share in (row.depth, row.prewarped, row.unwarped))
        figures = (
            f"{row.frequency_rad_s:.6g}",
            f"{row.unwarped_rad_s:.6g}",
            f"{100.0 * row.shift:.4f}",
        )
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
                f" and shows the hidden pair at {m.frequency_rad_s:.4g} rad/s, damping {m.damping:.3f}"
                for m in row.hidden
            )
        )
    return lines


def _mode(frequency_rad_s: float, damping: float) -> str:
    return f"{frequency_rad_s:.2f}  {damping:.3f}"
