"""Reasons why our figures do not agree with a finding, in words."""

from __future__ import annotations

from rig.studies.source_004.rule import FindingCheck, FindingResult
from rig.studies.source_004.spec import SourceFinding

MAX_NAMED = 2  # failed checks that are named; more are counted


def reason(finding: SourceFinding, result: FindingResult) -> str:
    """Name the checks that do not hold, then the note of the finding; empty when all hold."""
    if not result.failed:
        return ""
    parts = []
    if result.agreement == "partly":
        parts.append(_failed(finding, result))
    if finding.note:
        parts.append(finding.note.strip())
    return " ".join(parts) or f"No value of ours is {finding.relation}."


def _failed(finding: SourceFinding, result: FindingResult) -> str:
    """Name the checks that do not hold, or count those that do where many fail."""
    if len(result.failed) > MAX_NAMED:
        total = len(result.checks)
        return f"{total - len(result.failed)} of {total} comparisons hold."
    names = ", ".join(_name(check) for check in result.failed)
    return f"Not {finding.relation}: {names}."


def _name(check: FindingCheck) -> str:
    if check.against is None:
        return f"{check.run} ({check.basis})"
    return f"{check.run} against {check.against} ({check.basis})"
