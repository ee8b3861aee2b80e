"""Table of the verbs, and the command group that imports a verb's module when the verb is called.

`rig --help` and `rig stop` then load neither numpy nor any planner.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command, get_group

from rig.ui.cli.examples import EXAMPLES
from rig.ui.cli.option_units import check_units


class VerbRow(NamedTuple):
    """A row of a verb table."""

    target: str  # "module:name" of a function, or of a typer.Typer with commands of its own
    help: str  # the line in the list of verbs
    has_signed_argument: bool = False  # a number such as -5, which is no option


VERBS = {
    "doctor": VerbRow("rig.ui.cli.doctor:doctor", "Check that this machine can run experiments."),
    "plan": VerbRow(
        "rig.ui.cli.plan:plan", "Plan one move and show its demands and predicted swing."
    ),
    "compare": VerbRow("rig.ui.cli.compare:compare", "Compare published tables with our figures."),
    "run": VerbRow(
        "rig.ui.cli.run:run", "Run an experiment: plan, move, watch, log, analyse, report."
    ),
    "stop": VerbRow(
        "rig.ui.cli.stop:stop", "Stop every running experiment: robot first, then the log."
    ),
    "sim": VerbRow("rig.ui.cli.sim:sim", "Write a synthetic video with its truth."),
    "track": VerbRow("rig.ui.cli.track:track", "Measure the cable angle in a video file."),
    "analyze": VerbRow("rig.ui.cli.analyze:analyze", "Analyse a recorded run."),
    "identify": VerbRow(
        "rig.ui.cli.identify:identify", "Find frequency and damping of a decay in any file."
    ),
    "tune": VerbRow(
        "rig.ui.cli.tune:tune", "Fit a move to an unknown load: identify, plan, run, verify."
    ),
    "recover": VerbRow(
        "rig.ui.cli.recover:recover_log", "Write a complete file from a damaged log."
    ),
    "export": VerbRow("rig.ui.cli.export:export", "Write one table for each channel of a log."),
    "laws": VerbRow("rig.ui.cli.laws:app", "List, compare and draw motion laws."),
    "spline": VerbRow("rig.ui.cli.spline:spline", "Plan a motion through the points of a file."),
    "motor-check": VerbRow(
        "rig.ui.cli.motor_check:motor_check",
        "Check peak torque, rms torque, speed and power of a motor.",
    ),
    "size": VerbRow(
        "rig.ui.cli.size:size", "Size a ball-screw axis: every check with bound and margin."
    ),
    "servo": VerbRow(
        "rig.ui.cli.servo:app", "Compare and tune drive controllers of an elastic joint."
    ),
    "study": VerbRow("rig.ui.cli.study:app", "Repeat an experiment over many settings."),
    "calibrate": VerbRow("rig.ui.cli.calibrate:app", "Make the calibration files of the tracker."),
    "can": VerbRow("rig.ui.cli.can:app", "Look at a CANopen field bus and its nodes."),
}

SERVO_VERBS = {
    "compare": VerbRow(
        "rig.ui.cli.servo_compare:compare", "Compare controllers on the same moves."
    ),
    "notch": VerbRow(
        "rig.ui.cli.servo_notch:notch", "Tune a notch filter inside or before the speed loop."
    ),
    "observer": VerbRow(
        "rig.ui.cli.servo_observer:observer",
        "Find the stable time constants of a disturbance observer.",
    ),
    "shaping": VerbRow(
        "rig.ui.cli.servo_shaping:shaping", "Compare input shapers on an elastic joint."
    ),
}


STUDY_VERBS = {
    "dropouts": VerbRow(
        "rig.ui.cli.study_dropouts:dropouts",
        "Compare the interpolator policies under lost references.",
    ),
    "source004": VerbRow(
        "rig.ui.cli.study_source004:source004",
        "Repeat the experiments of source 004.",
    ),
}

CAN_VERBS = {
    "scan": VerbRow("rig.ui.cli.can_scan:scan", "List the nodes of a bus with their identity."),
    "monitor": VerbRow(
        "rig.ui.cli.can_monitor:monitor", "Show the frames of a bus, a log or a trace file."
    ),
    "sdo": VerbRow("rig.ui.cli.can_sdo:sdo", "Read an object of a node, or write it.", True),
}


class LazyGroup(TyperGroup):
    """Command group whose commands are imported when they are called; subclasses name the table."""

    verbs: Mapping[str, VerbRow] = {}
    path = ""  # words before the verb, below `rig`

    def list_commands(self, ctx: Any) -> list[str]:
        """List the names of the verbs, in the order of the table."""
        return list(self.verbs)

    def get_command(self, ctx: Any, cmd_name: str) -> TyperCommand | None:
        """Make a stand-in that carries the help line of a verb, for lists of commands."""
        verb = self.verbs.get(cmd_name)
        return TyperCommand(name=cmd_name, help=verb.help) if verb else None

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Import the verb that the first argument names; a usage error for an unknown one."""
        name, stand_in, rest = super().resolve_command(ctx, args)
        if name is None or name not in self.verbs:  # click's own fallback, without a name
            return name, stand_in, rest
        command = load(name, self.verbs[name], self.path)
        if not ctx.resilient_parsing:  # a shell that completes the line is told nothing
            check_units(command, rest)
        return name, command, rest


class RigGroup(LazyGroup):
    """Group of `rig`."""

    verbs = VERBS


class ServoGroup(LazyGroup):
    """Group of `rig servo`."""

    verbs = SERVO_VERBS
    path = "servo"


class StudyGroup(LazyGroup):
    """Group of `rig study`."""

    verbs = STUDY_VERBS
    path = "study"


class CanGroup(LazyGroup):
    """Group of `rig can`."""

    verbs = CAN_VERBS
    path = "can"


def load(name: str, verb: VerbRow, path: str = "") -> Any:
    """Import a verb and make its command; path: the words before the verb, below `rig`."""
    module, _, attribute = verb.target.partition(":")
    found = getattr(import_module(module), attribute)
    command = get_group(found) if isinstance(found, typer.Typer) else _command_of(found)
    command.name = name
    command.ignore_unknown_options = verb.has_signed_argument
    _add_examples(command, f"{path} {name}".strip())
    return command


def _add_examples(command: Any, words: str) -> None:
    """End the help of a command, and of the commands below it, with examples."""
    lines = [f"rig {example}" for example in EXAMPLES.get(words, ())]
    if lines:
        command.epilog = "\n\n".join(["Examples:", *lines])  # a paragraph each, or they are joined
    for name, inner in getattr(command, "commands", {}).items():
        _add_examples(inner, f"{words} {name}")


def _command_of(function: Any) -> Any:
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(function)
    return get_command(app)
