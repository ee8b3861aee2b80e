"""Check of the options of a verb for numbers that carry a unit, before they are parsed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from rig.errors import ConfigError
from rig.run.units import without_unit

UNIT_IN_HELP = re.compile(r"\[([^],]+)")  # "Distance [m].", "[rad/s², or m/s² with --distance]"


def check_units(command: Any, words: Sequence[str]) -> None:
    """Raise ConfigError for an option such as `--length 980mm`; its help names the unit."""
    units = _units(command)
    for word, after in zip(words, [*words, ""][1:], strict=True):
        option, equals, value = word.partition("=")
        unit = units.get(option)
        if unit is None:
            continue
        typed = value if equals else after
        advice = without_unit(typed, unit)
        if advice:
            raise ConfigError(f"{option} {typed}: {advice}")


def _units(command: Any) -> dict[str, str]:
    """Collect the unit of every option of a command and of its own commands."""
    units: dict[str, str] = {}
    for param in command.params:
        found = UNIT_IN_HELP.search(getattr(param, "help", None) or "")
        if found is not None:
            units |= dict.fromkeys(param.opts, found[1])
    for inner in getattr(command, "commands", {}).values():
        units |= _units(inner)
    return units
