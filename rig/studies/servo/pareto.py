"""Trade-off of every controller: residual vibration over peak sensitivity, one knob each.

The peak sensitivity is max |1 / (1 + L)| of the sampled loop on the joint model, opened at the
motor torque: the torque is held over a sample, and every delay of the controller is in its system.
The residual is the largest of the moves of the file on the simulated joint, see MoveMetrics.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import msgspec
import numpy as np

from planners.errors import unknown_name
from rig.drives.servo.errors import ServoError
from rig.errors import RunFailed
from rig.run.joint.controllers import Drive
from rig.run.joint.sections import AssignedSection
from rig.studies.servo.compare import (
    analyse_drives,
    build_drives,
    check_samples,
    compare,
    run_duration_s,
)
from rig.studies.servo.spec import ServoSpec

VALUE_DIGITS = 4  # significant, so that a printed value repeats its point
FIGURE_DIGITS = 6  # significant, of two figures that count as equal
DEFAULT_POINTS = 9  # values of each knob
MAX_POINTS = 200
TRADE_OFF_NOTE = (
    "Knobs and ranges are ours. A shaper and the filter of lqg_ff are outside of the loop: neither "
    "changes the sensitivity, but each delays the end of the move."
)


class Knob(NamedTuple):
    """Tuning knob of a controller: its name, unit, range, and the change of the file it makes."""

    name: str  # key of the comparison file, or "scale of" one
    unit: str
    low: float
    high: float
    apply: Callable[[ServoSpec, float], ServoSpec]

    def values(self, points: int) -> list[float]:
        """List values from low to high in geometric progression, rounded to VALUE_DIGITS."""
        spaced = np.geomspace(self.low, self.high, points)
        return [float(f"{value:.{VALUE_DIGITS}g}") for value in spaced]


class TradeOffPoint(NamedTuple):
    """One controller at one value of its knob.

    Without figures if refused: the reason is that the loop is unstable on the joint model, that
    the design is not possible, or that the load did not reach its goal.
    """

    controller: str
    value: float
    peak_sensitivity: float | None = None
    residual: float | None = None  # share of the largest reference speed, largest of the moves
    refusal: str = ""


def set_key(section: str, key: str, spec: ServoSpec, value: float) -> ServoSpec:
    """Replace one key of one section of a specification."""
    changed = msgspec.structs.replace(getattr(spec, section), **{key: value})
    return msgspec.structs.replace(spec, **{section: changed})


def scale_poles(spec: ServoSpec, factor: float) -> ServoSpec:
    """Multiply the eigenvalues of the state feedback by a factor; those of the observer stay."""
    poles_1_s = tuple((factor * real, factor * imag) for real, imag in spec.assigned.poles_1_s)
    estimator_poles_1_s = spec.assigned.estimator_poles_1_s
    section = AssignedSection(poles_1_s=poles_1_s, estimator_poles_1_s=estimator_poles_1_s)
    return msgspec.structs.replace(spec, assigned=section)


def _key(section: str, key: str, unit: str, low: float, high: float) -> Knob:
    return Knob(f"{section}.{key}", unit, low, high, partial(set_key, section, key))


# Ranges are ours: around the value of source_001.toml, up to where its loop loses its margins.
KNOBS = {
    "pid": _key("pid", "speed_crossover", "omega_z", 0.2, 10.0),
    "pid_ff": _key("pid", "speed_crossover", "omega_z", 0.2, 10.0),
    # depth of the notch: zeros have the damping ratio of the pair, poles have this one
    "pid_notch": _key("compensators", "notch_damping", "1", 0.5, 4.0),
    # shorter ones excite the load, longer ones leave it to the cascade
    "pid_observer": _key("compensators", "observer_time_s", "s", 0.002, 0.2),
    "pid_shaped": _key("pid", "speed_crossover", "omega_z", 0.2, 10.0),
    "assigned": Knob("scale of assigned.poles_1_s", "1", 0.5, 2.0, scale_poles),
    "lqg": _key("lqg", "torque_weight", "1", 0.01, 100.0),
    # not corner_rad_s of the filter, which is outside of the loop: its curve would be upright
    "lqg_ff": _key("lqg", "torque_weight", "1", 0.01, 100.0),
}


def sweep(
    spec: ServoSpec, variants: Sequence[str], controllers: Sequence[str], points: int
) -> Iterator[TradeOffPoint]:
    """Compute the points of every controller, one after the other.

    Before the first point it raises PlanError for an unknown controller, ConfigError for a plant
    variant that is missing or not valid, and for too many samples.
    """
    for name in controllers:
        if name not in KNOBS:
            raise unknown_name("--controllers", name, KNOBS)
    for variant in variants:
        spec.plant_variant_tables(variant)
    runs = points * len(controllers) * len(variants)
    check_samples(spec, runs * run_duration_s(spec, 0.0))
    return (
        _point(KNOBS[name].apply(spec, value), variants, name, value)
        for name in controllers
        for value in KNOBS[name].values(points)
    )


def front(points: Sequence[TradeOffPoint]) -> list[TradeOffPoint]:
    """Find the points that no other point dominates, lowest peak sensitivity first.

    A point dominates another if neither of its figures is larger and one is smaller.
    """
    rated = [point for point in points if not point.refusal]
    kept = [point for point in rated if not any(_dominates(other, point) for other in rated)]
    return sorted(kept, key=_figures)


def _dominates(one: TradeOffPoint, other: TradeOffPoint) -> bool:
    first, second = _figures(one), _figures(other)
    return first != second and first[0] <= second[0] and first[1] <= second[1]


def _figures(point: TradeOffPoint) -> tuple[float, float]:
    if point.peak_sensitivity is None or point.residual is None:
        raise ValueError(f"{point.controller} at {point.value}: refused, it has no figures")
    # rounded: that of pid and of pid_ff differ in their last digits alone
    figures = (point.peak_sensitivity, point.residual)
    return float(f"{figures[0]:.{FIGURE_DIGITS}g}"), float(f"{figures[1]:.{FIGURE_DIGITS}g}")


def _point(spec: ServoSpec, variants: Sequence[str], name: str, value: float) -> TradeOffPoint:
    try:
        drives = build_drives(spec, [name])
        loop = analyse_drives(spec, drives)[name]
    except ServoError as error:
        return TradeOffPoint(name, value, refusal=f"not possible: {error}")
    if not loop.stable:
        return TradeOffPoint(name, value, refusal="unstable on the joint model")
    return _run_moves(spec, variants, drives, value, loop.margins.peak_sensitivity)


def _run_moves(
    spec: ServoSpec,
    variants: Sequence[str],
    drives: dict[str, Drive],
    value: float,
    peak_sensitivity: float,
) -> TradeOffPoint:
    (name,) = drives
    residuals = []
    try:
        for run in compare(spec, variants, drives):
            if not run.outcome.arrived:
                refusal = f"did not arrive: {run.title}, plant variant {run.plant_variant}"
                return TradeOffPoint(name, value, refusal=refusal)
            residuals.append(run.outcome.residual)
    except RunFailed as error:
        return TradeOffPoint(name, value, refusal=f"did not arrive: {error}")
    return TradeOffPoint(name, value, peak_sensitivity, max(residuals))
