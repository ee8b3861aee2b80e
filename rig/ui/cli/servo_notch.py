"""`rig servo notch`: placements of a notch filter for the resonance of a joint."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.errors import ConfigError
from rig.ui.cli import servo_notch_tables as tables
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import print_written

if TYPE_CHECKING:
    from rig.drives.servo.two_mass import TwoMass
    from rig.studies.servo.notch import NotchRow
    from rig.studies.servo.notch_loops import NotchTask

EXAMPLE = {  # joint of the simulations in source 001
    "antiresonance": 200.0,
    "inertia_ratio": 1.0,
    "damping": 0.1,
}
RANGES = {  # lowest and highest value of an option, and advice
    "antiresonance": (1e-3, 1e6, "give rad/s; 200 in source 001"),
    "inertia_ratio": (1e-3, 1e3, "give load over motor, at the motor side; 1 in source 001"),
    "damping": (0.0, 1.0, "give a damping ratio; 0.1 in source 001"),
    "speed_loop": (1e-3, 1e3, "1 in source 001, lower values give more damping"),
    "position_loop": (1e-4, 1e2, "0.1 in source 001, lower values give more damping"),
    "reset_time": (1e-2, 1e4, "10 in source 001, longer ones give more damping"),
    "notch_damping": (1e-3, 1e2, "1 is usual"),
    "detune": (0.1, 10.0, "0.9 is a notch 10 % too low"),
    "sample_time": (1e-6, 1.0, "give s; 0.001 is usual"),
}


def notch(
    joint: Annotated[
        str,
        typer.Option(
            help="Joint: normalised (example of source 001), listed or fitted (its harmonic "
            "drive), or the \\[model] of a comparison FILE.toml.",
        ),
    ] = "normalised",
    antiresonance: Annotated[
        float | None,
        typer.Option(
            help="Antiresonance ω_z of the normalised joint \\[rad/s], 1e-3 to 1e6; 200 by default."
        ),
    ] = None,
    inertia_ratio: Annotated[
        float | None,
        typer.Option(
            help="Inertia ratio of the normalised joint, load over motor, 1e-3 to 1e3; "
            "1 by default.",
        ),
    ] = None,
    damping: Annotated[
        float | None,
        typer.Option(
            help="Damping ratio ζ_z of the normalised joint at the antiresonance, 0 to 1; "
            "0.1 by default.",
        ),
    ] = None,
    speed_loop: Annotated[
        float, typer.Option(help="Gain of the speed loop over ω_z (Jm + Jlr), 1e-3 to 1e3.")
    ] = 1.0,
    position_loop: Annotated[
        float, typer.Option(help="Gain of the position loop over ω_z, 1e-4 to 100.")
    ] = 0.1,
    reset_time: Annotated[
        float, typer.Option(help="Reset time of the speed loop times ω_z, 0.01 to 1e4.")
    ] = 10.0,
    notch_damping: Annotated[
        float, typer.Option(help="Damping ratio ζ_2 of the poles of the notch, 1e-3 to 100.")
    ] = 1.0,
    detune: Annotated[
        float,
        typer.Option(help="Frequency of a detuned notch over that of the tuned one, 0.1 to 10."),
    ] = 0.9,
    sample_time: Annotated[
        float, typer.Option(help="Sample time of the digital notch \\[s], 1e-6 to 1.")
    ] = 0.001,
    plot: Annotated[
        Path | None, typer.Option(help="Figure file of poles and responses: .svg, .png or .pdf.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Compare poles, margins and responses with a notch filter in and before the speed loop."""
    from rig.drives.servo.cascade import Cascade  # python-control is slow to import
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
    two_mass = _joint(joint, own)
    gains = Cascade.normalised(two_mass, speed_loop, position_loop, reset_time)
    task = NotchTask(joint=two_mass, gains=gains, denominator_damping=notch_damping)
    rows = compare(task)
    detuned = _detuned(task, detune)
    digital = sampled(task, sample_time)
    if plot is not None:
        from rig.ui.plots.servo_notch import draw_notch

        picture_file.save(draw_notch(task), plot)
    if as_json:
        print_json(tables.document(joint, task, rows, detuned, digital, sample_time))
    else:
        tables.print_tables(joint, task, rows, detuned, digital, sample_time)
        print_written(plot)
    return 0


def _check(**options: float) -> None:
    """Check options against RANGES; raises ServoError."""
    from rig.drives.servo.errors import check_range

    for name, value in options.items():
        check_range(f"--{name.replace('_', '-')}", value, *RANGES[name])


def _joint(name: str, own: dict[str, float | None]) -> TwoMass:
    """Look up a joint by name, or create the normalised one.

    Raises ConfigError for parameters of the normalised joint with another one, PlanError for
    an unknown joint.
    """
    from rig.studies.servo.joints import named_joint

    given = {key: value for key, value in own.items() if value is not None}
    if name == "normalised":
        return _normalised(EXAMPLE | given)
    joint = named_joint(name, ("normalised",))
    for key, value in given.items():
        option = f"--{key.replace('_', '-')} {value:g}"
        raise ConfigError(
            f"{option} with --joint {name}; must be with --joint normalised: omit one of the two"
        )
    return joint


def _normalised(values: dict[str, float]) -> TwoMass:
    from rig.drives.servo.two_mass import TwoMass

    _check(**values)
    limit = 1.0 / math.sqrt(1.0 + values["inertia_ratio"])
    if not values["damping"] < limit:
        raise ConfigError(
            f"--damping {values['damping']:g} with an inertia ratio of "
            f"{values['inertia_ratio']:g} gives an overdamped joint; must be < {limit:.4g}: "
            "lower it, or model the joint as rigid"
        )
    return TwoMass.normalised(values["antiresonance"], values["inertia_ratio"], values["damping"])


def _detuned(task: NotchTask, detune: float) -> tuple[NotchRow, ...]:
    """Evaluate notches tuned too low and too high by one factor, in both placements."""
    from rig.studies.servo.notch import detuned

    factors = sorted({detune, 1.0 / detune} - {1.0})
    rows: list[NotchRow] = []
    for factor in factors:
        rows.extend(detuned(task, factor))
    return tuple(rows)
