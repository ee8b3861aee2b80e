"""`rig servo`: drive controllers of an elastic joint, compared on paper and on the simulated bench."""

from __future__ import annotations

import typer

from rig.ui.cli import servo_compare, servo_notch, servo_observer, servo_shaping

app = typer.Typer(
    no_args_is_help=True,
    help="Controllers of an elastic joint: on paper and on the simulated bench.",
)
app.command("compare")(servo_compare.compare)
app.command("notch")(servo_notch.notch)
app.command("observer")(servo_observer.observer)
app.command("shaping")(servo_shaping.shaping)
