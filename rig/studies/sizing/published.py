"""Figures of a sizing by name, and their comparison with the printed ones of a source."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal, InvalidOperation
from typing import NamedTuple

from planners.errors import unknown_name
from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.life import dynamic_load_n, life_h
from rig.drives.screw.limits import (
    RPM_PER_RAD_S,
    absolute_least_lead,
    least_diameter_by_buckling_m,
    least_lead_by_balls_m,
    least_lead_by_whirl_m,
)
from rig.drives.screw.preload import PRELOAD_SHARES
from rig.drives.screw.table import CyclePhaseRow
from rig.drives.screw.verdict import Assessment
from rig.errors import ConfigError
from rig.studies.sizing.axis_file import PublishedFigure

BANDWIDTH_SHARES = (0.5, 0.7)  # of the antiresonance (source 004, C.0.19)
PRINTED_ROUNDING_REL = 1e-9  # of the last printed digit


class FigureComparison(NamedTuple):
    """Printed figure, right figure, and the reason of their difference."""

    name: str
    printed: str
    right: float
    reason: str

    @property
    def differs(self) -> bool:
        """True if the right figure does not round to the printed digits."""
        digits = Decimal(self.printed)
        step = float(Decimal(1).scaleb(int(digits.as_tuple().exponent)))  # of the last digit
        return abs(float(digits) - self.right) > step * (0.5 + PRINTED_ROUNDING_REL)


def axis_figures(axis: AxisSpec) -> dict[str, float]:
    """Compute the figures that are independent of the screw, by name with its unit."""
    need, utilisation = axis.demand, axis.utilisation
    least = absolute_least_lead(
        axis.mounting, need.peak_speed_m_s, utilisation.whirl, axis.balls_m_rpm()
    )
    figures = {
        **need._asdict(),
        "cycle_s": axis.cycle.duration_s,
        "weight_n": axis.load.weight_n,
        "friction_n": axis.load.friction_n,
        "whirl_coefficient": axis.mounting.support.whirl,
        "buckling_coefficient": axis.mounting.support.buckling,
        "lead_min_abs_m": least.lead_m,
        "diameter_at_lead_min_abs_m": least.diameter_m,
        "diameter_min_buckling_m": least_diameter_by_buckling_m(
            axis.mounting, need.peak_force_n, utilisation.buckling
        ),
    }
    if axis.requirements.life_h is not None:
        figures["dynamic_load_at_lead_min_abs_n"] = dynamic_load_n(
            axis.requirements.life_h,
            need.equivalent_force_n,
            need.mean_speed_m_s,
            least.lead_m,
            utilisation.service_factor,
        )
    return figures


def screw_figures(axis: AxisSpec, found: Assessment) -> dict[str, float]:
    """Compute the figures of a screw on an axis, by name with its unit."""
    screw, nut = found.screw, found.candidate
    need, utilisation = axis.demand, axis.utilisation
    inertia, stiffness = axis.transmission.inertia_kg_m2(screw), axis.stiffness_n_m(screw)
    antiresonance = screw.antiresonance_rad_s(axis.load.mass_kg, stiffness)
    figures = {
        "screw_mass_kg": screw.mass_kg,
        "screw_inertia_kg_m2": screw.inertia_kg_m2,
        "rotary_inertia_kg_m2": inertia,
        "equivalent_mass_kg": screw.equivalent_mass_kg(axis.load.mass_kg, inertia),
        "whirl_rad_s": screw.whirl_rad_s,
        "critical_speed_rpm": utilisation.whirl * screw.whirl_rad_s * RPM_PER_RAD_S,
        "lead_min_whirl_m": least_lead_by_whirl_m(screw, need.peak_speed_m_s, utilisation.whirl),
        "lead_min_balls_m": least_lead_by_balls_m(
            screw.circle_m, need.peak_speed_m_s, axis.balls_m_rpm(nut)
        ),
        "buckling_load_n": screw.buckling_load_n,
        "sag_m": screw.sag_m(axis.load.slope_rad, axis.carried_kg),
        "axial_stiffness_n_m": screw.axial_stiffness_n_m,
        "torsional_stiffness_n_m_rad": screw.torsional_stiffness_n_m_rad,
        "stiffness_n_m": stiffness,
        "antiresonance_rad_s": antiresonance,
        "resonance_rad_s": screw.resonance_rad_s(axis.load.mass_kg, stiffness, inertia),
        "bandwidth_low_rad_s": BANDWIDTH_SHARES[0] * antiresonance,
        "bandwidth_high_rad_s": BANDWIDTH_SHARES[1] * antiresonance,
        **found.shaft._asdict(),
        "peak_power_w": found.shaft.peak_power_w,
        "preload_n": axis.preload_n(nut),
        "drag_torque_n_m": axis.transmission_for(nut).drag_torque_n_m or 0.0,
        "equivalent_load_n": axis.equivalent_load_n(nut),
        "peak_speed_rpm": need.peak_speed_m_s / screw.ratio_m_rad * RPM_PER_RAD_S,
        "mean_speed_rpm": need.mean_speed_m_s / screw.ratio_m_rad * RPM_PER_RAD_S,
        "rms_speed_rpm": need.rms_speed_m_s / screw.ratio_m_rad * RPM_PER_RAD_S,
    }
    if axis.requirements.life_h is not None:
        figures["dynamic_load_n"] = dynamic_load_n(
            axis.requirements.life_h,
            axis.equivalent_load_n(nut),
            need.mean_speed_m_s,
            screw.lead_m,
            utilisation.service_factor,
        )
    if nut.dynamic_load_n is not None:
        figures["life_h"] = life_of(axis, nut)
        for end, share in zip(("low", "high"), PRELOAD_SHARES, strict=True):
            preload_n = share * nut.dynamic_load_n
            preloaded = replace(nut, preload_n=preload_n)
            figures[f"preload_{end}_n"] = preload_n
            figures[f"life_at_preload_{end}_h"] = life_of(axis, preloaded)
    return figures


def life_of(axis: AxisSpec, nut: CatalogueEntry) -> float:
    """Compute the life of a nut with its preload [h]; the nut must have a dynamic load rating."""
    force, speed = axis.equivalent_load_n(nut), axis.demand.mean_speed_m_s
    return life_h(
        nut.dynamic_load_n or 0.0, force, speed, nut.lead_m, axis.utilisation.service_factor
    )


def cell_figures(rows: Sequence[CyclePhaseRow]) -> dict[str, float]:
    """Name the cells of the motion-law table as move_N.phase_N.NAME."""
    cells: dict[str, float] = {}
    for row in rows:
        values = row._asdict()
        move, phase = values.pop("move"), values.pop("phase")
        cells |= {f"move_{move}.phase_{phase}.{name}": value for name, value in values.items()}
    return cells


def compare_figures(
    published: dict[str, PublishedFigure],
    of_axis: dict[str, float],
    of_screw: dict[str, float],
    *,
    chosen: bool,
) -> list[FigureComparison]:
    """Compare printed with right figures; those of a screw only if it is the choice.

    Raises PlanError for an unknown name, ConfigError for a text that is not a finite number.
    """
    rows, figures = [], of_axis | of_screw
    for name, figure in published.items():
        if name not in figures:
            raise unknown_name("[published]", name, figures)
        if not _is_finite_number(figure.printed):
            raise ConfigError(
                f"[published] {name} printed = {figure.printed!r}; must be the digits of a "
                "number: as in '4.07e3'"
            )
        if chosen or name in of_axis:
            rows.append(FigureComparison(name, figure.printed, figures[name], figure.reason))
    return rows


def _is_finite_number(text: str) -> bool:
    try:
        return math.isfinite(Decimal(text))
    except InvalidOperation:
        return False
