"""What a sizing comes to, as one document: verdict, checks, moves, motion-law table, figures, catalogue."""

from __future__ import annotations

from typing import NamedTuple

from planners.drives.screw.axis import Axis
from planners.drives.screw.checks import AllowedSpeed, allowed_speed, assess
from planners.drives.screw.cycle import Cycle
from planners.drives.screw.table import Row, table
from planners.drives.screw.verdict import Assessment, Check
from rig.sizing import Sizing
from rig.sizing_published import Comparison, axis_figures, cell_figures, compare, screw_figures


class Judgement(NamedTuple):
    """A sizing's catalogue assessed, best first: what fits before what does not."""

    sizing: Sizing
    found: list[Assessment]
    chosen: Assessment | None  # that of the choice
    judged: Assessment | None  # the choice, without one the best that fits
    figures: dict[str, float]
    motion: list[Row]  # of the judged one
    printed: list[Comparison]

    @property
    def admissible(self) -> bool:
        """Whether the choice breaks nothing; without one, whether there is a screw that does."""
        return self.judged is not None and self.judged.admissible

    @property
    def allowed(self) -> AllowedSpeed | None:
        """The speed that the judged screw can have, and what sets it."""
        return allowed_speed(self.sizing.axis, self.judged) if self.judged else None

    @property
    def verdict(self) -> str:
        """One of "good", "doubtful" while something that is asked cannot be decided, "bad"."""
        if not self.admissible:
            return "bad"
        does = [self.chosen] if self.chosen else [a for a in self.found if a.admissible]
        return "doubtful" if all(a.undecided for a in does) else "good"

    @property
    def reasons(self) -> list[str]:
        """Of a verdict that is not good, with value, bound and next step."""
        if self.chosen:
            return [check.reason for check in (*self.chosen.broken, *self.chosen.undecided)]
        return [] if self.judged else ["no entry of the catalogue fits; must be at least one: add entries, or ask for less"]


def judge(sizing: Sizing) -> Judgement:
    """Assess the catalogue. Raises PlanError and ConfigError for published figures that cannot be compared."""
    axis = sizing.axis
    found = sorted((assess(axis, candidate) for candidate in sizing.catalogue.values()), key=lambda a: a.rank)
    chosen = next((a for a in found if a.candidate is sizing.choice), None)
    judged = chosen or next((a for a in found if a.admissible), None)
    motion = _motion(axis, judged) if judged else []
    figures = axis_figures(axis) | (screw_figures(axis, judged) if judged else {})
    return Judgement(sizing, found, chosen, judged, figures, motion, _printed(sizing, chosen or found[0], chosen is None))


def _printed(sizing: Sizing, a: Assessment, without_choice: bool) -> list[Comparison]:
    if not sizing.published:
        return []
    axis = sizing.axis
    of_screw = screw_figures(axis, a) | cell_figures(_motion(axis, a))
    if without_choice:
        return compare(sizing.published, axis_figures(axis), of_screw)
    return compare(sizing.published, axis_figures(axis) | of_screw)


def document(result: Judgement) -> dict[str, object]:
    """For one JSON document."""
    chosen, judged, allowed = result.chosen, result.judged, result.allowed
    return {
        "verdict": result.verdict,
        "reasons": result.reasons,
        "choice": chosen.candidate.name if chosen else None,
        "judged": judged.candidate.name if judged else None,
        "admissible": chosen.admissible if chosen else None,
        "checks": [_check(check) for check in judged.checks] if judged else [],
        "allowed_speed_m_s": allowed.speed_m_s if allowed else None,
        "allowed_by": allowed.check if allowed else None,
        "moves": _moves(result.sizing.axis.cycle, allowed.speed_m_s if allowed else None),
        "motion": [row._asdict() for row in result.motion],
        "figures": result.figures,
        "catalogue": [_entry(a) for a in result.found],
        "published": [{**row._asdict(), "differs": row.differs} for row in result.printed],
    }


def _motion(axis: Axis, a: Assessment) -> list[Row]:
    return table(axis.cycle, axis.load, axis.drive(a.candidate), a.screw)


def _check(check: Check) -> dict[str, object]:
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


def _moves(cycle: Cycle, allowed: float | None) -> list[dict[str, object]]:
    return [
        {
            "stroke_m": move.stroke_m,
            "law": move.law,
            "time_s": move.time_s,
            "rest_s": move.rest_s,
            "peak_speed_m_s": move.peak_speed_m_s,
            "allowed_time_s": None if allowed is None else move.time_at(allowed),
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
