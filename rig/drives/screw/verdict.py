"""What a check says of a screw, and what all of them say of a candidate."""

from __future__ import annotations

from typing import NamedTuple

from rig.drives.motor import TOLERANCE
from rig.drives.screw import digits
from rig.drives.screw.candidate import CatalogueEntry
from rig.drives.screw.demand import ShaftDemand
from rig.drives.screw.shaft import BallScrew

KEPT, BROKEN, UNDECIDED, NOT_ASKED = "kept", "broken", "not decidable", "not asked"


class LimitCheck(NamedTuple):
    """One limit. value <= bound, or >= with at_least; a bound of None is not asked, unless `missing` says what lacks.

    Values and bounds are above 0; a value may be 0 where it has an upper bound.
    """

    name: str
    value: float | None
    bound: float | None
    unit: str
    remedy: str = ""  # the next step where it is broken
    at_least: bool = False
    missing: str = ""
    note: str = ""  # what is told beside it, whatever the state
    classes: bool = (
        False  # values are of a few classes, of which the one that is asked has nothing left
    )

    @property
    def margin(self) -> float | None:
        """How far the value is on the safe side of the bound, over the bound; below 0 it is broken, None is not decided."""
        if self.value is None or self.bound is None:
            return None
        return self.value / self.bound - 1.0 if self.at_least else 1.0 - self.value / self.bound

    @property
    def state(self) -> str:
        """KEPT, BROKEN, UNDECIDED or NOT_ASKED."""
        if self.missing:
            return UNDECIDED
        if self.margin is None:
            return NOT_ASKED
        return BROKEN if self.margin < -TOLERANCE else KEPT

    @property
    def reason(self) -> str:
        """Why it is broken or open, with value, bound and next step; empty when kept or not asked."""
        if self.state == UNDECIDED:
            return f"{self.name}: {self.missing}"
        if self.state != BROKEN:
            return ""
        (value, bound), unit = digits.shown((self.value, self.bound), self.unit)
        return f"{self.name} {value} {unit}; must be {'>=' if self.at_least else '<='} {bound} {unit}: {self.remedy}"


class Assessment(NamedTuple):
    """A candidate's checks."""

    candidate: CatalogueEntry
    screw: BallScrew
    shaft: ShaftDemand
    checks: tuple[LimitCheck, ...]

    @property
    def admissible(self) -> bool:
        """Whether no check is broken; some may be open."""
        return not self.broken

    @property
    def broken(self) -> list[LimitCheck]:
        """The checks that fail."""
        return [check for check in self.checks if check.state == BROKEN]

    @property
    def undecided(self) -> list[LimitCheck]:
        """The checks for which the catalogue says too little."""
        return [check for check in self.checks if check.state == UNDECIDED]

    @property
    def notes(self) -> list[str]:
        """What is told and not judged."""
        return [check.note for check in self.checks if check.note]

    @property
    def tightest(self) -> LimitCheck:
        """The decided check with the least margin; a class that does is no tight one."""
        decided = [
            c
            for c in self.checks
            if c.state in (KEPT, BROKEN) and not (c.classes and c.state == KEPT)
        ]
        return min(decided, key=lambda c: c.margin or 0.0)

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Sorts what fits before what fits as far as is told and what does not, and of each the greatest least margin first."""
        return (
            not self.admissible,
            self.admissible and bool(self.undecided),
            -(self.tightest.margin or 0.0),
        )
