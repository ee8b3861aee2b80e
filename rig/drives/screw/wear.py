"""What makes a nut last: the dynamic load and the preload that leave a life."""

from __future__ import annotations

from dataclasses import replace

from scipy.optimize import brentq

from rig.drives.screw.axis import AxisSpec
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.demand import equivalent_load_n
from rig.drives.screw.life import dynamic_load_n

MOST = 10.0  # times the load without preload: stronger nuts are not tried


def lasting_load_n(axis: AxisSpec, candidate: CatalogueEntry, hours: float) -> float | None:
    """The least dynamic load that lasts, in place of the candidate's; None where the preload, a share of it, grows too much."""

    def short(rated_n: float) -> float:
        return (
            _needed_n(
                axis,
                candidate,
                hours,
                axis.equivalent_load_n(replace(candidate, dynamic_load_n=rated_n)),
            )
            - rated_n
        )

    least = _needed_n(axis, candidate, hours, axis.demand.equivalent_force_n)
    if candidate.preload_n is not None or axis.shares.preload == 0.0:
        return least + short(least)
    return float(brentq(short, least, MOST * least)) if short(MOST * least) <= 0.0 else None


def lasting_preload_n(axis: AxisSpec, candidate: CatalogueEntry, hours: float) -> float | None:
    """The greatest preload, no more than the candidate's, with which its dynamic load lasts; None where none does."""
    now, rated = axis.preload_n(candidate), candidate.dynamic_load_n or 0.0

    def short(preload_n: float) -> float:
        return (
            _needed_n(axis, candidate, hours, equivalent_load_n(axis.cycle, axis.load, preload_n))
            - rated
        )

    if short(0.0) > 0.0:
        return None
    return float(brentq(short, 0.0, now)) if short(now) > 0.0 else now


def _needed_n(axis: AxisSpec, candidate: CatalogueEntry, hours: float, force_n: float) -> float:
    return dynamic_load_n(
        hours, force_n, axis.demand.mean_speed_m_s, candidate.lead_m, axis.shares.service_factor
    )
