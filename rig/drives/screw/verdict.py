"""Result of a limit check, and assessment of a catalogue entry by all of them."""

from __future__ import annotations

from typing import NamedTuple

from rig.drives.motor import LIMIT_EXCESS_REL
from rig.drives.screw import digits
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.demand import ShaftDemand
from rig.drives.screw.shaft import BallScrew

KEPT, BROKEN, UNDECIDED, NOT_ASKED = "kept", "broken", "not decidable", "not asked"


class LimitCheck(NamedTuple):
    """Value and bound of one limit: value <= bound, or value >= bound with at_least.

    Without a bound nothing is required, unless `missing` names absent catalogue data. Values and
    bounds are above 0; a value with an upper bound may be 0.
    """

    name: str
    value: float | None
    bound: float | None
    unit: str
    remedy: str = ""  # next step if the limit is broken
    at_least: bool = False
    missing: str = ""
    note: str = ""  # remark, in any state
    discrete: bool = False  # a value of a few classes: one that equals its bound is not tight

    @property
    def margin(self) -> float | None:
        """Distance of the value from the bound over the bound, positive on the safe side.

        None without a value or without a bound.
        """
        if self.value is None or self.bound is None:
            return None
        return self.value / self.bound - 1.0 if self.at_least else 1.0 - self.value / self.bound

    @property
    def state(self) -> str:
        """State of the check: KEPT, BROKEN, UNDECIDED or NOT_ASKED."""
        if self.missing:
            return UNDECIDED
        if self.margin is None:
            return NOT_ASKED
        return BROKEN if self.margin < -LIMIT_EXCESS_REL else KEPT

    @property
    def reason(self) -> str:
        """Value, bound and next step of a broken check, missing data of an undecided one.

        Empty in the other states.
        """
        if self.state == UNDECIDED:
            return f"{self.name}: {self.missing}"
        if self.state != BROKEN:
            return ""
        (value, bound), unit = digits.shown((self.value, self.bound), self.unit)
        relation = ">=" if self.at_least else "<="
        return f"{self.name} {value} {unit}; must be {relation} {bound} {unit}: {self.remedy}"


class Assessment(NamedTuple):
    """Catalogue entry with its checks."""

    candidate: CatalogueEntry
    screw: BallScrew
    shaft: ShaftDemand
    checks: tuple[LimitCheck, ...]

    @property
    def admissible(self) -> bool:
        """True if no check is broken; some may be undecided."""
        return not self.broken

    @property
    def broken(self) -> list[LimitCheck]:
        """Checks that fail."""
        return [check for check in self.checks if check.state == BROKEN]

    @property
    def undecided(self) -> list[LimitCheck]:
        """Checks for which the catalogue lacks data."""
        return [check for check in self.checks if check.state == UNDECIDED]

    @property
    def notes(self) -> list[str]:
        """Remarks of the checks."""
        return [check.note for check in self.checks if check.note]

    @property
    def tightest(self) -> LimitCheck:
        """Decided check with the least margin; a discrete one counts only if it is broken."""
        kept = [check for check in self.checks if check.state == KEPT and not check.discrete]
        return min([*self.broken, *kept], key=lambda check: check.margin or 0.0)

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Sort key, best first.

        Admissible and decided entries, then admissible ones with undecided checks, then the others;
        each group by decreasing least margin.
        """
        return (
            not self.admissible,
            self.admissible and bool(self.undecided),
            -(self.tightest.margin or 0.0),
        )
