"""`rig compare free_cart`: free cart with two bars, nonlinear bench beside the linear model."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table

from rig.errors import BAD_DATA, EXIT_STATUS, OK
from rig.ui.cli.output import print_json, working
from rig.ui.cli.page import Column, plain_table, print_paragraph, print_table, print_written
from rig.ui.plots.picture_file import check, check_folder

if TYPE_CHECKING:
    from rig.studies.thesis_tables.bench import CartMotion
    from rig.studies.thesis_tables.free_cart import CartFigures, ExpectedRelation, FreeCartCase

FINDING = (
    "Published finding (source 004, section 4.2): linear model and a second simulation program "
    "give equal amplitudes of position and angles; the frequencies differ a little."
)
LEGEND = (
    "bench: nonlinear simulation; linear: the planners' model with force input. Bars of 0.2 m and "
    "0.15 m from rest at 30°, 2 N for 2 s, -2 N for 2 s, then none. Travel from the start; modes: "
    "damped frequencies. At 1°: from 1° without force."
)
MASS_NOTE = (
    "Equivalent mass: 10.5223 kg is printed; nut, motor and screw give 19.5223 kg, to which the "
    "frequency printed in appendix C belongs. Stiffness and damping of the joint, printed in N/m "
    "and N s/m, are taken in N m/rad and N m s/rad."
)


def run(plot: Path | None, csv_file: Path | None, as_json: bool) -> int:
    """Simulate, print or write the comparison; give the exit code.

    6 when a relation between bench, linear model and source is not the expected one.
    """
    if plot is not None:
        check(plot)
    if csv_file is not None:
        check_folder("--csv", csv_file)
    from rig.studies.thesis_tables.free_cart import expected_relations, free_cart_cases

    with working("free cart on the bench, two masses, 30° and 1°: about 5 s", quiet=as_json):
        cases = free_cart_cases()
    relations = expected_relations(cases)
    exit_code = OK if all(relation.holds for relation in relations) else BAD_DATA
    if plot is not None:
        from rig.ui.plots.free_cart import draw  # matplotlib is slow to import

        draw(cases, plot)
    if csv_file is not None:
        _write_csv(cases, csv_file)
    if as_json:
        print_json(_document(cases, relations, exit_code))
    else:
        _print(cases, relations)
        print_written(plot, csv_file)
    return exit_code


def _print(cases: Sequence[FreeCartCase], relations: Sequence[ExpectedRelation]) -> None:
    print_table(_figure_table(cases))
    print_paragraph(LEGEND, "dim")
    print_paragraph(MASS_NOTE, "dim")
    print_table(_relation_table(relations))
    print_paragraph(FINDING)
    print_paragraph(explanation(cases))


def explanation(cases: Sequence[FreeCartCase]) -> str:
    """Explain the published finding by the computed frequencies."""
    printed, right = cases
    amplitude_rad = right.bench_figures.theta1_peak_rad
    pendulum_percent = -100.0 * amplitude_rad**2 / 16.0
    mass_percent = 100.0 * (printed.free_modes_hz[0] / right.free_modes_hz[0] - 1.0)
    return (
        "Explanation: the frequency falls with the amplitude. Bench to linear mode with "
        f"{right.cart_mass_kg:.4f} kg: {100.0 * right.small_change_rel:+.4f} % at 1°, "
        f"{100.0 * right.frequency_change_rel:+.2f} % at 30°; with {printed.cart_mass_kg:.4f} kg "
        f"{100.0 * printed.frequency_change_rel:+.2f} % (a simple pendulum of this amplitude "
        f"{pendulum_percent:+.1f} %). A nonlinear program is therefore slower than the "
        "linear model. "
        f"The misprinted mass would raise the frequency of both by {mass_percent:.1f} %."
    )


def _figure_table(cases: Sequence[FreeCartCase]) -> Table:
    """Create the table with one line a figure, bench and linear model for each mass."""
    headers: list[str | Column] = [""]
    for case, origin in zip(cases, ("printed", "of its parts"), strict=True):
        headers += [f"{case.cart_mass_kg:.4f} kg\n{origin}\nbench", "linear"]
    view = plain_table("Free cart with two bars, source 004, section 4.2", headers)
    columns = []
    for case in cases:
        small_hz = case.small_frequency_hz
        columns.append([*_cells(case.bench_figures), f"{small_hz:.4f}", *[""] * 4])
        modes_hz = [f"{mode_hz:.4f}" for mode_hz in (*case.free_modes_hz, *case.driven_modes_hz)]
        columns.append([*_cells(case.linear_figures), modes_hz[0], *modes_hz])
    names = (
        "travel at 10 s [m]",
        "peak travel [m]",
        "peak |θ1| [°]",
        "peak |θ2| [°]",
        "frequency after 4 s [Hz]",
        "the same at 1° [Hz]",
        "free-cart mode 1 [Hz]",
        "free-cart mode 2 [Hz]",
        "driven-cart mode 1 [Hz]",
        "driven-cart mode 2 [Hz]",
    )
    for name, *cells in zip(names, *columns, strict=True):
        view.add_row(name, *cells)
    return view


def _cells(figures: CartFigures) -> list[str]:
    return [
        f"{figures.travel_end_m:.4f}",
        f"{figures.travel_peak_m:.4f}",
        f"{math.degrees(figures.theta1_peak_rad):.2f}",
        f"{math.degrees(figures.theta2_peak_rad):.2f}",
        f"{figures.frequency_hz:.4f}",
    ]


def _relation_table(relations: Sequence[ExpectedRelation]) -> Table:
    columns = (Column("relative difference", folds=True), "[%]", "expected [%]", "")
    view = plain_table("\nExpected relations", columns)
    for relation in relations:
        bounds = f"{100.0 * relation.low_rel:g} to {100.0 * relation.high_rel:g}"
        verdict = "holds" if relation.holds else "fails"
        view.add_row(relation.name, f"{100.0 * relation.value_rel:+.4f}", bounds, verdict)
    return view


def _document(
    cases: Sequence[FreeCartCase], relations: Sequence[ExpectedRelation], exit_code: int
) -> dict[str, Any]:
    return {
        "exit_status": EXIT_STATUS[exit_code],
        "cases": [_case_document(case) for case in cases],
        "relations": [{**relation._asdict(), "holds": relation.holds} for relation in relations],
        "finding": FINDING,
        "explanation": explanation(cases),
    }


def _case_document(case: FreeCartCase) -> dict[str, Any]:
    return {
        "cart_mass_kg": case.cart_mass_kg,
        "bench": case.bench_figures._asdict(),
        "linear": case.linear_figures._asdict(),
        "small_frequency_hz": case.small_frequency_hz,
        "free_modes_hz": case.free_modes_hz,
        "driven_modes_hz": case.driven_modes_hz,
        "frequency_change_rel": case.frequency_change_rel,
        "small_change_rel": case.small_change_rel,
    }


def _write_csv(cases: Sequence[FreeCartCase], path: Path) -> None:
    with path.open("w", newline="") as file:
        lines = csv.writer(file)
        lines.writerow(["cart_mass_kg", "motion", "t_s", "position_m", "theta1_rad", "theta2_rad"])
        for case in cases:
            for name, motion in (("bench", case.bench), ("linear", case.linear)):
                lines.writerows(_csv_rows(case.cart_mass_kg, name, motion))


def _csv_rows(mass_kg: float, name: str, motion: CartMotion) -> list[list[float | str]]:
    rows: list[list[float | str]] = []
    for t_s, position_m, angles_rad in zip(
        motion.t_s.tolist(), motion.position_m.tolist(), motion.angles_rad.tolist(), strict=True
    ):
        rows.append([f"{mass_kg:.4f}", name, f"{t_s:.2f}", position_m, *angles_rad])
    return rows
