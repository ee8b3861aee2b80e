"""Units of what is typed: a number that carries one, and a value that suggests another one.

Lengths are in metres and angles in radians; who types centimetres or degrees is told.
"""

from __future__ import annotations

import math
import re
import warnings
from typing import NamedTuple

from rig.errors import ConfigError, StrangeValue

# unit asked for: unit typed, and its size in the unit asked for
SIZES = {
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0},
    "ms": {"ms": 1.0, "s": 1e3, "us": 1e-3, "µs": 1e-3},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "°": math.pi / 180},
    "kg": {"kg": 1.0, "g": 1e-3},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2},
}
SUFFIXES = {  # ending of a key: its unit, the longer ending first
    "_n_m_s_rad": "N m s/rad",
    "_n_m_rad": "N m/rad",
    "_n_m": "N m",
    "_per_m": "1/m",
    "_rad_s": "rad/s",
    "_m_s2": "m/s²",
    "_m_s": "m/s",
    "_rad": "rad",
    "_deg": "deg",
    "_ms": "ms",
    "_kg": "kg",
    "_hz": "Hz",
    "_m": "m",
    "_s": "s",
}
NUMBER_WITH_UNIT = re.compile(
    r"([-+]?\d*\.?\d+(?:e[-+]?\d+)?)\s*(?!e[-+]?\d)([a-zµ°][a-z/²³0-9]*)", re.I
)


class Usual(NamedTuple):
    """Size of a quantity in a laboratory, and the unit that it may have been typed in.

    Above `strange` there is a note, above `absurd` an error.
    """

    what: str
    unit: str
    plural: str  # of the unit
    other: str
    other_size: float  # in the unit
    strange: float
    absurd: float


CABLE = Usual("a cable", "m", "metres", " cm", 0.01, strange=5.0, absurd=20.0)
MOVE = Usual("a move", "m", "metres", " cm", 0.01, strange=2.0, absurd=10.0)
SWING = Usual("a swing", "rad", "radians", "°", math.pi / 180, strange=0.6, absurd=1.6)
TURN = Usual("a turn", "rad", "radians", "°", math.pi / 180, strange=20.0, absurd=math.inf)


def suspect(name: str, value: float, usual: Usual) -> None:
    """Warn of a value that suggests another unit, StrangeValue; name is e.g. "length_m =".

    Raises ConfigError for a value far beyond a laboratory. NaN and infinity are left to others.
    """
    if not math.isfinite(value) or abs(value) <= usual.strange:
        return
    text = (
        f"{name} {value:g}: {usual.what} of {value:g} {usual.unit}? In {_converted(value, usual)}"
    )
    if abs(value) > usual.absurd:
        raise ConfigError(text)
    warnings.warn(text, StrangeValue, stacklevel=2)


def other_unit(key: str, value: object) -> str:
    """Word what a value above its bound is when it was typed in cm or degrees; else empty."""
    usual = {"rad": SWING, "m": CABLE}.get(key_unit(key))
    if usual is None or not isinstance(value, int | float) or not 1.0 <= value < math.inf:
        return ""
    return f"; in {_converted(value, usual)}"


def _converted(value: float, usual: Usual) -> str:
    converted = value * usual.other_size
    return f"{usual.plural} {value:g}{usual.other} are {converted:.4g}"


def key_unit(key: str) -> str:
    """Unit of a key of a file by its ending; empty where it has none."""
    return next((unit for ending, unit in SUFFIXES.items() if key.endswith(ending)), "")


def without_unit(text: str, unit: str) -> str:
    """Word how a number that carries a unit is typed; empty for any other text."""
    found = NUMBER_WITH_UNIT.fullmatch(text.strip())
    if found is None:
        return ""
    number, typed = found.groups()
    size = SIZES.get(unit, {}).get(typed)
    converted = "" if size is None else f": {float(number) * size:.6g}"
    return f"carries a unit; type the number alone, in {unit}{converted}"
