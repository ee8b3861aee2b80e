"""Result of a sizing, and its JSON document.

It holds verdict, checks, moves, motion-law table, figures and catalogue.
"""

from __future__ import annotations

from typing import NamedTuple

from rig.drives.screw.checks import AllowedSpeed, allowed_speed, assess
from rig.drives.screw.cycle import Cycle
from rig.drives.screw.table import CyclePhaseRow, table
from rig.drives.screw.verdict import Assessment, LimitCheck
from rig.studies.sizing.axis_file import Sizing
from rig.studies.sizing.published import (
    FigureComparison,
    axis_figures,
    cell_figures,
    compare_figures,
    screw_figures,
)


class Judgement(NamedTuple):
    """Assessed catalogue of a sizing, and the figures of the judged entry."""

    sizing: Sizing
    found: list[Assessment]  # best first
    judged: Assessment  # the choice; without one the best
    figures: dict[str, float]  # of the axis and the judged entry
    motion: list[CyclePhaseRow]  # of the judged entry
    printed: list[FigureComparison]

    @property
    def chosen(self) -> Assessment | None:
        """Assessment of the choice; None without a choice."""
        return self.judged if self.sizing.choice else None

    @property
    def criterion(self) -> str:
        """Criterion by which the judged entry was selected."""
        if self.chosen:
            return "choice"
        if self.fitting:
            return "complete data first, then largest minimum margin"
        return "largest minimum margin"

    @property
    def admissible(self) -> bool:
        """True if the judged entry breaks no check."""
        return self.judged.admissible

    @property
    def fitting(self) -> int:
        """Number of catalogue entries that break no check."""
        return sum(a.admissible for a in self.found)

    @property
    def allowed(self) -> AllowedSpeed:
        """Greatest speed of the judged entry, and the check that sets it."""
        return allowed_speed(self.sizing.axis, self.judged)

    @property
    def verdict(self) -> str:
        """Verdict: "good", "bad", or "doubtful" while a required check cannot be decided."""
        if not self.admissible:
            return "bad"
        return "doubtful" if self.judged.undecided else "good"

    @property
    def reasons(self) -> list[str]:
        """Reasons of a verdict that is not good, with value, bound and next step."""
        reasons = []
        if not self.chosen and not self.fitting:
            reasons.append(
                f"0 of {len(self.found)} entries of the catalogue fit; must be at least one: "
                "add entries, or relax the requirements"
            )
        reasons += [check.reason for check in (*self.judged.broken, *self.judged.undecided)]
        return reasons


def judge(sizing: Sizing) -> Judgement:
    """Assess the catalogue and compare the published figures.

    Raises PlanError and ConfigError for published figures that cannot be compared.
    """
    axis = sizing.axis
    found = [assess(axis, candidate) for candidate in sizing.catalogue.values()]
    found.sort(key=lambda assessment: assessment.rank)
    judged = next((a for a in found if a.candidate is sizing.choice), found[0])
    transmission = axis.transmission_for(judged.candidate)
    motion = table(axis.cycle, axis.load, transmission, judged.screw)
    of_axis, of_screw = axis_figures(axis), screw_figures(axis, judged)
    printed = compare_figures(
        sizing.published, of_axis, of_screw | cell_figures(motion), chosen=sizing.choice is not None
    )
    return Judgement(sizing, found, judged, of_axis | of_screw, motion, printed)


def document(result: Judgement) -> dict[str, object]:
    """Build the JSON document of a result."""
    chosen, judged, allowed = result.chosen, result.judged, result.allowed
    return {
        "verdict": result.verdict,
        "reasons": result.reasons,
        "choice": chosen.candidate.name if chosen else None,
        "judged": judged.candidate.name,
        "criterion": result.criterion,
        "admissible": result.admissible,
        "checks": [_check(check) for check in judged.checks],
        "allowed_speed_m_s": allowed.speed_m_s,
        "allowed_by": allowed.check,
        "moves": _moves(result.sizing.axis.cycle, allowed.speed_m_s),
        "motion": [row._asdict() for row in result.motion],
        "figures": result.figures,
        "catalogue": [_entry(a) for a in result.found],
        "published": [{**row._asdict(), "differs": row.differs} for row in result.printed],
    }


def _check(check: LimitCheck) -> dict[str, object]:
    return {
        "name": check.name,
        "value": check.value,
        "bound": check.bound,
        "at_least": check.at_least,
        "unit": check.unit,
        "margin": check.margin,
        "state": check.state,
        "reason": check.reason,
        "note": check.note,
    }


def _moves(cycle: Cycle, allowed_m_s: float) -> list[dict[str, object]]:
    return [
        {
            "stroke_m": move.stroke_m,
            "law": move.law,
            "time_s": move.time_s,
            "rest_s": move.rest_s,
            "peak_speed_m_s": move.peak_speed_m_s,
            "allowed_time_s": move.time_at(allowed_m_s),
        }
        for move in cycle.moves
    ]


def _entry(a: Assessment) -> dict[str, object]:
    return {
        "name": a.candidate.name,
        "diameter_m": a.candidate.diameter_m,
        "lead_m": a.candidate.lead_m,
        "origin": a.candidate.origin,
        "admissible": a.admissible,
        "tightest": a.tightest.name,
        "margin": a.tightest.margin,
        "broken": [_check(check) for check in a.broken],
        "undecided": [check.name for check in a.undecided],
        "notes": a.notes,
    }
