"""Classes of trackers: imported by name, constructed, and their results checked.

Every fault is a ConfigError that names the tracker and what must change.
"""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, cast

from rig.errors import ConfigError
from vision.protocol import CableAngle, CableTracker, TrackerClass

SIGNATURE = "measure(image, pivot_px)"


class Place(NamedTuple):
    """Tracker, scene and frame that an error names."""

    tracker: str
    scene: str
    frame: int  # from 0

    def __str__(self) -> str:
        return f"tracker {self.tracker}, scene {self.scene}, frame {self.frame}"


def load_tracker(name: str) -> TrackerClass:
    """Import the class `package.module:Class`; modules in the current folder are found too.

    Raises ConfigError for a name of another form, a module that cannot be imported, a class that
    is not in it, and one without a method `measure`.
    """
    module_name, _, class_name = name.partition(":")
    parts = [*module_name.split("."), class_name]
    if not all(part.isidentifier() for part in parts):
        raise ConfigError(
            f"tracker '{name}'; must be package.module:Class: for example my_tracker:MyTracker"
        )
    folder = str(Path.cwd())
    if folder not in sys.path:
        sys.path.insert(0, folder)
    try:
        module = import_module(module_name)
    except Exception as error:  # noqa: BLE001 - the code of another author
        raise ConfigError(
            f"tracker '{name}': module {module_name} cannot be imported ({_worded(error)}); must "
            f"be a module in {folder} or of an installed package: start in its folder, or correct "
            "the module"
        ) from None
    found = getattr(module, class_name, None)
    if not inspect.isclass(found):
        raise ConfigError(
            f"tracker '{name}': no class {class_name} in {module.__file__}; must be one of "
            f"{', '.join(_classes(module)) or 'its classes, but it has none'}: correct the name"
        )
    if not callable(getattr(found, "measure", None)):
        raise ConfigError(
            f"tracker '{name}': class without a method measure; must have {SIGNATURE}: add it"
        )
    return cast(TrackerClass, found)


def _classes(module: Any) -> list[str]:
    """List the public classes that a module defines."""
    own = []
    for name, value in vars(module).items():
        is_own = inspect.isclass(value) and value.__module__ == module.__name__
        if is_own and not name.startswith("_"):
            own.append(name)
    return own


def construct(place: Place, tracker_class: TrackerClass, size: tuple[int, int]) -> CableTracker:
    """Construct a tracker for pictures of (width, height).

    Raises ConfigError if that fails, or if its method does not take picture and pivot.
    """
    try:
        tracker = tracker_class(*size)
    except Exception as error:  # noqa: BLE001
        raise ConfigError(
            f"tracker {place.tracker}, scene {place.scene}: cannot be constructed with width, "
            f"height = {size[0]}, {size[1]} ({_worded(error)}); must take these two arguments: "
            "correct __init__"
        ) from None
    try:
        inspect.signature(tracker.measure).bind(None, None)
    except TypeError as error:
        raise ConfigError(
            f"tracker {place.tracker}: measure does not take two arguments ({error}); must be "
            f"{SIGNATURE}: correct it"
        ) from None
    except ValueError:  # a compiled method without a signature
        pass
    return tracker


def prepare(
    place: Place, tracker: Any, pictures: Sequence[Any], pivots_px: Sequence[tuple[float, float]]
) -> None:
    """Call the method prepare of a tracker; raises ConfigError for an exception in it."""
    try:
        tracker.prepare(pictures, pivots_px)
    except Exception as error:  # noqa: BLE001
        raise ConfigError(
            f"tracker {place.tracker}, scene {place.scene}: prepare raised {_worded(error)}; must "
            "take pictures and the pivot in each: correct it"
        ) from None


def measured(
    place: Place, tracker: CableTracker, picture: Any, pivot_px: tuple[float, float]
) -> Any:
    """Call the tracker; raises ConfigError for an exception in it."""
    try:
        return tracker.measure(picture, pivot_px)
    except Exception as error:  # noqa: BLE001
        raise ConfigError(
            f"{place}: measure raised {_worded(error)}; must return a result for every picture, "
            "with angle_rad = None where there is no angle: correct it"
        ) from None


def check_result(place: Place, result: Any) -> CableAngle:
    """Check a result of measure; raises ConfigError for one that is not an angle."""
    for name in ("angle_rad", "sigma_rad"):
        if not hasattr(result, name):
            raise ConfigError(
                f"{place}: result {_short(result)} without {name}; must have angle_rad and "
                "sigma_rad, each a number or None: return vision.protocol.CableAngle"
            )
    angle_rad = _number(place, "angle_rad", result.angle_rad)
    sigma_rad = _number(place, "sigma_rad", result.sigma_rad)
    if angle_rad is None:
        return CableAngle()
    if sigma_rad is not None and sigma_rad <= 0.0:
        raise ConfigError(
            f"{place}: sigma_rad = {sigma_rad:g}; must be > 0: give None where it is not known"
        )
    return CableAngle(angle_rad, sigma_rad)


def _number(place: Place, name: str, value: Any) -> float | None:
    """Convert a value to a finite float; None stays None."""
    if value is None:
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ConfigError(
            f"{place}: {name} = {_short(value)}; must be a number or None: correct measure"
        ) from None
    if not math.isfinite(number):
        raise ConfigError(
            f"{place}: {name} = {number}; must be finite: give None where there is no value"
        )
    return number


def _short(value: Any) -> str:
    """Write a value in one line of at most 60 characters."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def _worded(error: Exception) -> str:
    """Write an exception in one line, with the place in the file of its author."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    place = ""
    trace = error.__traceback__
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        if file != __file__ and not file.startswith("<"):
            place = f" at {Path(file).name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return text + place
