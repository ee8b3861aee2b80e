"""Dynamic load rating and preload with which a nut reaches a required life."""

from __future__ import annotations

from dataclasses import replace

from scipy.optimize import brentq

from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.demand import equivalent_load_n
from rig.drives.screw.life import dynamic_load_n

MAX_RATING_FACTOR = 10.0  # largest rating tried, over the one required without preload


def required_dynamic_load_n(
    axis: AxisSpec, candidate: CatalogueEntry, hours: float
) -> float | None:
    """Compute the least dynamic load rating that reaches a life, in place of the candidate's.

    None where the preload, a share of the rating, grows too much with it.
    """

    def deficit_n(rated_n: float) -> float:
        other = replace(candidate, dynamic_load_n=rated_n)
        return _required_n(axis, candidate, hours, axis.equivalent_load_n(other)) - rated_n

    least_n = _required_n(axis, candidate, hours, axis.demand.equivalent_force_n)
    if candidate.preload_n is not None or axis.utilisation.preload == 0.0:
        return least_n + deficit_n(least_n)
    if deficit_n(MAX_RATING_FACTOR * least_n) > 0.0:
        return None
    return float(brentq(deficit_n, least_n, MAX_RATING_FACTOR * least_n))


def greatest_preload_n(axis: AxisSpec, candidate: CatalogueEntry, hours: float) -> float | None:
    """Compute the greatest preload, up to the candidate's, with which it reaches a life.

    None where it does not reach the life without preload either.
    """
    preload_n = axis.preload_n(candidate)
    rated_n = candidate.dynamic_load_n or 0.0

    def deficit_n(preload_n: float) -> float:
        force_n = equivalent_load_n(axis.cycle, axis.load, preload_n)
        return _required_n(axis, candidate, hours, force_n) - rated_n

    if deficit_n(0.0) > 0.0:
        return None
    if deficit_n(preload_n) > 0.0:
        return float(brentq(deficit_n, 0.0, preload_n))
    return preload_n


def _required_n(axis: AxisSpec, candidate: CatalogueEntry, hours: float, force_n: float) -> float:
    """Compute the rating for a life under an equivalent force [N]."""
    speed_m_s = axis.demand.mean_speed_m_s
    factor = axis.utilisation.service_factor
    return dynamic_load_n(hours, force_n, speed_m_s, candidate.lead_m, factor)
