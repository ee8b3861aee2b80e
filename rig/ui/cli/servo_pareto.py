"""Table, picture and JSON document of `rig servo compare --pareto`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from rig.errors import BAD_DATA
from rig.ui.cli.output import counting, print_json
from rig.ui.cli.page import Column, plain_table, print_paragraph, print_table, print_written

if TYPE_CHECKING:
    from rig.studies.servo.pareto import TradeOffPoint
    from rig.studies.servo.spec import ServoSpec

COLUMNS = (
    "controller\n",
    Column("knob\n", folds=True),
    "value\n",
    "peak\nsensitivity",
    "residual\n[%]",
    "on the\nfront",
)
LEGEND = (
    "peak sensitivity: largest |1 / (1 + L)| of the sampled loop on the joint model. residual: "
    "peak speed of the load after the end of the move, in % of the top speed of the move; largest "
    "of the moves. On the front: no other point has a lower or equal value of both. omega_z: "
    "natural frequency of the load with locked rotor."
)


class TradeOffRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Options of the trade-off."""

    spec: ServoSpec
    variants: Sequence[str]
    controllers: Sequence[str]
    points: int
    plot: Path | None
    as_json: bool


def show_trade_off(request: TradeOffRequest) -> int:
    """Compute the trade-off and print it; returns the exit code."""
    from rig.studies.servo.pareto import TRADE_OFF_NOTE, front

    points = _compute(request)
    best = front(points)
    if request.plot is not None:
        from rig.ui.plots import picture_file
        from rig.ui.plots.servo_pareto import draw_trade_off

        picture_file.save(draw_trade_off(points, best), request.plot)
    if request.as_json:
        print_json(_document(request, points, best))
    else:
        _print_points(points, best)
        print_paragraph(LEGEND, "dim")
        print_paragraph(f"plant variants: {', '.join(request.variants)}. {TRADE_OFF_NOTE}", "dim")
        _print_refused(points)
        print_written(request.plot)
    return 0 if best else BAD_DATA


def _compute(request: TradeOffRequest) -> list[TradeOffPoint]:
    from rig.studies.servo.pareto import sweep

    total = request.points * len(request.controllers)
    found = sweep(request.spec, request.variants, request.controllers, request.points)
    points = []
    with counting("points of the trade-off", total, quiet=request.as_json) as progress:
        for point in found:
            points.append(point)
            progress(len(points))
    return points


def _print_points(points: Sequence[TradeOffPoint], best: Sequence[TradeOffPoint]) -> None:
    """Print the points that have figures; a knob stands in the first row of its controller."""
    from rig.studies.servo.pareto import KNOBS

    table = plain_table("residual vibration over peak sensitivity", COLUMNS, left=2)
    previous = ""
    for point in points:
        if point.peak_sensitivity is None or point.residual is None:
            continue
        is_first = point.controller != previous
        if previous and is_first:
            table.add_section()
        previous = point.controller
        knob = KNOBS[point.controller]
        table.add_row(
            point.controller if is_first else "",
            f"{knob.name} [{knob.unit}]" if is_first else "",
            f"{point.value:g}",
            f"{point.peak_sensitivity:.3f}",
            f"{100 * point.residual:.3f}",
            "yes" if point in best else "",
        )
    print_table(table)


def _print_refused(points: Sequence[TradeOffPoint]) -> None:
    from rig.studies.servo.pareto import KNOBS

    for point in points:
        if point.refusal:
            where = f"{point.controller} at {KNOBS[point.controller].name} = {point.value:g}"
            print_paragraph(f"{where}: {point.refusal}", "red", "  ")


def _document(
    request: TradeOffRequest, points: Sequence[TradeOffPoint], best: Sequence[TradeOffPoint]
) -> dict[str, Any]:
    """Create the JSON document."""
    from rig.studies.servo.pareto import KNOBS, TRADE_OFF_NOTE

    knobs = {}
    for name in request.controllers:
        knob = KNOBS[name]
        knobs[name] = {"name": knob.name, "unit": knob.unit, "low": knob.low, "high": knob.high}
    rows = [point._asdict() | {"on_front": point in best} for point in points]
    return {
        "exit_status": "ok" if best else "bad_data",
        "period_s": request.spec.drive.period_s,
        "seed": request.spec.seed,
        "truths": list(request.variants),
        "knobs": knobs,
        "points": rows,
        "note": TRADE_OFF_NOTE,
    }
