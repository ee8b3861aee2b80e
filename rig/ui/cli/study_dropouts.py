"""`rig study dropouts`: interpolator policies against lost references."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer

from rig.errors import ConfigError
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import counting, print_json
from rig.ui.cli.page import (
    PageTable,
    plain_table,
    print_paragraph,
    print_table,
    print_written,
)

if TYPE_CHECKING:
    from rig.studies.dropouts import DropoutRow, DropoutSpec

LEGEND = (
    "Seeds 1 to {seeds}, {burst} references lost in a row. Residual vibration: true amplitude of "
    "the load after the move. Acceleration: change of the robot's true speed over 30 ms. Cable of "
    "the bench equal to that of the model, no camera."
)


def dropouts(
    planners: Annotated[
        str | None,
        typer.Option(help="Planners separated by commas; matrix_exponential,zv,mzv,zvd,ei."),
    ] = None,
    policies: Annotated[
        str | None, typer.Option(help="Policies separated by commas; source,bounded,buffer.")
    ] = None,
    losses: Annotated[
        str, typer.Option(help="Shares of the references that are lost, separated by commas.")
    ] = "0,0.05,0.1,0.2,0.3",
    burst: Annotated[int, typer.Option(min=1, max=1000, help="References lost in a row.")] = 5,
    seeds: Annotated[int, typer.Option(help="Runs of each setting, with seeds 1, 2, ...")] = 5,
    plot: Annotated[Path | None, typer.Option(help="Figure file: .svg, .png or .pdf.")] = None,
    as_json: AsJson = False,
) -> int:
    """Compare residual vibration and acceleration of the interpolator policies under losses."""
    from rig.studies.dropouts import DropoutSpec, check, study

    if plot is not None:
        from rig.ui.plots import picture_file  # matplotlib is slow to import

        picture_file.check(plot)
    spec = DropoutSpec(losses=_shares(losses), burst=burst, seeds=seeds)
    if planners is not None:
        spec = msgspec.structs.replace(spec, planners=_words(planners))
    if policies is not None:
        spec = msgspec.structs.replace(spec, policies=_words(policies))
    check(spec)
    with counting("runs in virtual time", spec.runs, quiet=as_json) as progress:
        rows = study(spec, progress)
    if plot is not None:
        from rig.ui.plots.dropouts import draw_dropouts

        picture_file.save(draw_dropouts(spec, rows), plot)
    if as_json:
        print_json(_document(spec, rows))
    else:
        for policy in spec.policies:
            print_table(_residuals(spec, policy, rows))
        print_table(_accelerations(spec, rows))
        print_paragraph(LEGEND.format(seeds=spec.seeds, burst=spec.burst))
        print_written(plot)
    return 0


def _words(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",") if word.strip())


def _shares(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in _words(text))
    except ValueError:
        raise ConfigError(
            f"--losses {text!r}; must be numbers separated by commas, e.g. 0,0.1 for 0 and 10 %"
        ) from None


def _document(spec: DropoutSpec, rows: Sequence[DropoutRow]) -> dict[str, Any]:
    return {"exit_status": "ok", "burst": spec.burst, "seeds": spec.seeds, "rows": rows}


def _residuals(spec: DropoutSpec, policy: str, rows: Sequence[DropoutRow]) -> PageTable:
    table = plain_table(
        f"policy {policy}: residual vibration [mrad] against loss, mean / largest",
        ("planner", *_loss_columns(spec)),
    )
    _add_rows(table, spec, policy, rows, _residual)
    return table


def _residual(row: DropoutRow) -> str:
    if row.residual_mean_rad is None or row.residual_max_rad is None:
        return "stopped"
    return f"{row.residual_mean_rad * 1e3:.2f}/{row.residual_max_rad * 1e3:.2f}"


def _accelerations(spec: DropoutSpec, rows: Sequence[DropoutRow]) -> PageTable:
    title = "largest acceleration of the robot [m/s²] against loss"
    table = plain_table(title, ("policy", "planner", *_loss_columns(spec)))
    for policy in spec.policies:
        _add_rows(table, spec, policy, rows, _acceleration, policy)
    return table


def _acceleration(row: DropoutRow) -> str:
    return f"{row.acceleration_max_m_s2:.2f}"


def _loss_columns(spec: DropoutSpec) -> list[str]:
    return [f"{loss * 100:g} %" for loss in spec.losses]


def _add_rows(
    table: PageTable,
    spec: DropoutSpec,
    policy: str,
    rows: Sequence[DropoutRow],
    cell: Callable[[DropoutRow], str],
    *first: str,
) -> None:
    """Add a row for each planner; first: the cells before its name."""
    cells = {(row.planner, row.loss): cell(row) for row in rows if row.policy == policy}
    table.columns[len(first)].justify = "left"
    for planner in spec.planners:
        table.add_row(*first, planner, *(cells[planner, loss] for loss in spec.losses))
