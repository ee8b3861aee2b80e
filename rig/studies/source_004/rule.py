"""Rule of agreement between a published finding and our figures; pure.

A value has up to two bases: true and measured for swing, planned and reached for motion. Each pair
of runs is checked on each basis on which both have a value: a swing below what the camera can tell
has none, nor has that of a link that it does not see. Without a value on any basis, the check
fails:

    lower       b - a > max(3 sigma, 1 % of the larger one)
    higher      the same with a and b exchanged
    much lower  lower, and a <= b / 2
    similar     |a - b| <= 1 % of the larger peak swing, the width of a line in a plot of the swing
    small       a <= 1 % of the peak swing of the run
    above       a > bound + 3 sigma
    equal       |a - bound| <= 3 sigma + half the last printed digit

sigma is that of the difference. The finding agrees if every check holds, partly if some do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product
from typing import Literal

import msgspec

from rig.studies.source_004.spec import SourceFinding

Agreement = Literal["yes", "partly", "no"]
SIGMAS = 3.0  # a difference of this many standard deviations counts
DIFFERENCE_REL = 0.01  # smallest difference that counts, share of the larger value
LINE_WIDTH_REL = 0.01  # swing that a plot of the whole swing does not resolve, share of its peak
MUCH = 0.5  # share of the other value below which a value is much lower


class BasisValue(msgspec.Struct, frozen=True, kw_only=True):
    """Value of a quantity on one basis, in SI units.

    None = not identifiable: 0 within sigma where that is known, else no value.
    """

    value: float | None
    sigma: float = 0.0


class RunFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of one run: values by quantity and basis."""

    experiment: str
    values: dict[str, dict[str, BasisValue]]

    @property
    def peak_rad(self) -> float:
        """Peak swing [rad], true where it is known."""
        peaks = self.values.get("peak_swing", {}).values()
        return next((one.value for one in peaks if one.value is not None), math.nan)


class FindingCheck(msgspec.Struct, frozen=True, kw_only=True):
    """One check of a finding: a pair of runs, or a run and a bound, on one basis."""

    run: str
    against: str | None
    basis: str
    holds: bool


class FindingResult(msgspec.Struct, frozen=True, kw_only=True):
    """Agreement of our figures with a finding, with its checks."""

    agreement: Agreement
    checks: tuple[FindingCheck, ...]

    @property
    def failed(self) -> tuple[FindingCheck, ...]:
        """Checks that do not hold."""
        return tuple(check for check in self.checks if not check.holds)


def judge(finding: SourceFinding, figures: Mapping[str, RunFigures]) -> FindingResult:
    """Check a finding on the figures of its runs, by experiment.

    Raises ValueError for a quantity that a run does not have on any basis.
    """
    checks: list[FindingCheck] = []
    for name, other in product(finding.runs, finding.against or (None,)):
        run = figures[name]
        partner = figures[other] if other is not None else None
        for basis in _bases(finding.quantity, run, partner):
            value = run.values[finding.quantity][basis]
            against = partner.values[finding.quantity][basis] if partner is not None else None
            scale_rad = max(run.peak_rad, partner.peak_rad if partner else 0.0)
            holds = is_holding(finding, value, against, LINE_WIDTH_REL * scale_rad)
            checks.append(FindingCheck(run=name, against=other, basis=basis, holds=holds))
    return FindingResult(agreement=_agreement(checks), checks=tuple(checks))


def _bases(quantity: str, run: RunFigures, partner: RunFigures | None) -> list[str]:
    """List the bases on which both runs have a value, or else all that both have."""
    values = [one.values.get(quantity, {}) for one in (run, partner) if one is not None]
    bases = [basis for basis in values[0] if all(basis in other for other in values)]
    if not bases:
        raise ValueError(
            f"{quantity} of {run.experiment}: no value; must have one on a basis at least, common "
            "to both runs of a comparison: compare another quantity"
        )
    known = [b for b in bases if all(_seen(one[b]).value is not None for one in values)]
    return known or bases


def is_holding(
    finding: SourceFinding, a: BasisValue, b: BasisValue | None, line_width_rad: float
) -> bool:
    """Tell whether a relation holds for a against b, or against the bound; see the module.

    A value that is not identifiable counts as 0 within its sigma; without one it satisfies no
    relation.
    """
    a = _seen(a)
    b = _seen(b) if b is not None else None
    if finding.bound is not None:
        b = BasisValue(value=finding.bound)
    if b is None:  # small
        return a.value is not None and a.value <= line_width_rad
    if a.value is None or b.value is None:
        return False
    noise = SIGMAS * math.hypot(a.sigma, b.sigma)
    return _compare(finding, a.value, b.value, noise, line_width_rad)


def _seen(one: BasisValue) -> BasisValue:
    """Take a value that is not identifiable as 0 within its sigma, if that is known."""
    if one.value is None and one.sigma > 0.0:
        return BasisValue(value=0.0, sigma=one.sigma)
    return one


def _compare(
    finding: SourceFinding, a: float, b: float, noise: float, line_width_rad: float
) -> bool:
    smallest = max(noise, DIFFERENCE_REL * max(abs(a), abs(b)))
    outcomes = {
        "lower": b - a > smallest,
        "higher": a - b > smallest,
        "much lower": b - a > smallest and a <= MUCH * b,
        "similar": abs(a - b) <= line_width_rad,
        "above": a > b + noise,
        "equal": abs(a - b) <= noise + finding.last_digit / 2,
    }
    return outcomes[finding.relation]


def _agreement(checks: list[FindingCheck]) -> Agreement:
    holding = sum(check.holds for check in checks)
    if holding == len(checks):
        return "yes"
    return "partly" if holding else "no"
