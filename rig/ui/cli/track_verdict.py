"""Verdict on a tracked video: how far its angles can be used, and what to try."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from rig.ui.cli.track_calibration import VideoCalibration
from vision.first_look import Look
from vision.look_findings import LookFinding, told_pivot_finding
from vision.stream import FindingKind, FrameStream, StreamFinding
from vision.tracked import TrackedFrame
from vision.view import Point

Verdict = Literal["good", "doubtful", "bad"]
MIN_VALID_SHARE = 0.5
MIN_SIDE_SHARE = 0.4  # of the swing seen, on each side of its middle
BEND_SIGMAS, MIN_BEND_PX, MIN_BENT_SHARE = 6.0, 0.1, 0.1
MAX_PLACES = 8  # named in one line
MIN_SWING_RAD = 2e-3  # of a swing whose sides are told apart
# what makes time, order or number of the frames untrue
TIME_FINDINGS = {
    FindingKind.STEP_BACK,
    FindingKind.REPEATED_STAMP,
    FindingKind.PULLDOWN,
    FindingKind.CUT,
    FindingKind.LOOP,
    FindingKind.SIZE_CHANGE,
    FindingKind.ENDS_EARLY,
}
OPTION = {"at_rest": "--at-rest"}  # of a parameter; else -- and its name
NEXT_STEPS = {
    "no_cable": "see `rig track --look` for what was found",
    "few_rows": "the visible part of the line is short: keep what covers it out of the picture",
    "pivot_missed": "try --pivot auto",
    "ambiguous": "a second line passes through the pivot: try --roi X,Y,W,H around the cable",
    "poor_fit": "the rows do not lie on one line: try --width or --roi",
    "bad_image": "the picture is flat: check the exposure of the camera",
    "static": "if it is the cable and hangs still, try --at-rest",
    "duplicate": "record at the rate of the camera",
    "frozen": "cut the part that stands still off with --from and --to",
    "damaged": "copy the file again from the camera",
}


class TrackedVideo(NamedTuple):
    """Result of a video."""

    rows: list[TrackedFrame]
    look: Look
    source: FrameStream
    findings: Sequence[StreamFinding]
    told: Point | None
    gate_px: Point | None  # in the view
    calibration: VideoCalibration | None


class VideoJudgement(NamedTuple):
    """Verdict with its reasons, and remarks that do not change it."""

    verdict: Verdict
    reasons: list[str]
    remarks: list[str]


def worded(finding: LookFinding) -> str:
    """Write a finding of the first look with the option to try."""
    if not finding.parameter:
        return finding.text
    option = OPTION.get(finding.parameter, f"--{finding.parameter}")
    return f"{finding.text}: try {option} {finding.value}".rstrip()


def judge(tracked: TrackedVideo, *, has_row_time: bool = False) -> VideoJudgement:
    """Judge the frames of a video; has_row_time: the rolling shutter is known."""
    rows, look, told = tracked.rows, tracked.look, tracked.told
    reasons: list[str] = []
    valid = [row for row in rows if row.valid]
    if len(valid) < MIN_VALID_SHARE * len(rows):
        reasons += _refusals(rows, len(valid))
    elif told is None or look.swing_rad is not None:
        reasons += _missing_side(valid, look)
    wrong_pivot = _pivot_reasons(look, told)
    seen = [worded(finding) for finding in look.findings]
    if reasons:  # evidence of the first look first: it names the cause
        reasons = [*wrong_pivot, *seen, *reasons]
        remarks: list[str] = []
    else:
        remarks = [*wrong_pivot, *seen]
    if tracked.calibration is not None:
        misplaced = tracked.calibration.finding(look)
        reasons += [misplaced] if misplaced else []
    reasons += _grouped([found for found in tracked.findings if found.kind in TIME_FINDINGS])
    remarks += _grouped([found for found in tracked.findings if found.kind not in TIME_FINDINGS])
    remarks += _bend(valid, has_row_time)
    if not valid:
        return VideoJudgement("bad", reasons, remarks)
    return VideoJudgement("doubtful" if reasons else "good", reasons, remarks)


def _grouped(findings: Sequence[StreamFinding]) -> Iterator[str]:
    """Word the irregularities of the stream; those with one text in one line."""
    places: dict[str, list[str]] = {}
    for found in findings:
        place = f"{found.first}" if found.last == found.first else f"{found.first} to {found.last}"
        places.setdefault(found.text, []).append(place)
    for text, where in places.items():
        shown = ", ".join(where[:MAX_PLACES])
        if len(where) > MAX_PLACES:
            shown += f" and {len(where) - MAX_PLACES} more"
        noun = "frame" if len(where) == 1 and " " not in shown else "frames"
        yield f"{noun} {shown}: {text}"


def _bend(valid: Sequence[TrackedFrame], has_row_time: bool) -> Iterator[str]:
    """Report an axis that is bent beyond its noise, and what bends it."""
    bent = [
        abs(row.bend_px)
        for row in valid
        if abs(row.bend_px) > max(BEND_SIGMAS * row.sigma_bend_px, MIN_BEND_PX)
    ]
    if len(bent) < MIN_BENT_SHARE * len(valid) or not bent:
        return
    text = f"the line is bent by up to {max(bent):.2f} px in {len(bent)} of {len(valid)} frames"
    if has_row_time:
        yield f"{text} beyond what the rolling shutter does: a bent cable, or a lens that bends it"
    else:
        yield (
            f"{text}: a bent cable, a lens, or a rolling shutter; either way the angle is that of "
            "the best straight line. Give the time of a row with --row-time to tell a rolling "
            "shutter, and to correct the time stamps by it"
        )


def _refusals(rows: Sequence[TrackedFrame], valid: int) -> Iterator[str]:
    """Name the most frequent reasons of refused frames, with what was measured."""
    counts = Counter(row.reason for row in rows if not row.valid)
    parts = ", ".join(f"{reason} {count}" for reason, count in counts.most_common())
    yield f"{valid} of {len(rows)} frames have an angle ({parts})"
    reason, count = counts.most_common(1)[0]
    refused = [row for row in rows if row.reason == reason]
    measured = f"{reason} in {count} frames"
    misses = [row.pivot_miss_px for row in refused if row.pivot_miss_px is not None]
    if misses and reason == "pivot_missed":
        measured += f": the lines pass the pivot at {float(np.median(misses)):+.1f} px (median)"
    elif reason in ("few_rows", "poor_fit"):
        fitted = float(np.median([row.rows for row in refused]))
        measured += f": {fitted:.0f} rows fitted (median)"
        scatter = [row.residual_px for row in refused if row.residual_px is not None]
        if scatter:
            measured += f", {float(np.median(scatter)):.2f} px off the line"
    yield f"{measured}; {NEXT_STEPS.get(reason, 'see `rig track --look`')}"


def _missing_side(valid: Sequence[TrackedFrame], look: Look) -> Iterator[str]:
    """Report angles on one side of the swing only."""
    if look.swing_rad is None or look.swing_rad[1] - look.swing_rad[0] < MIN_SWING_RAD:
        return
    low, high = look.swing_rad
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    angles = [row.angle_rad for row in valid if row.angle_rad is not None]
    least, most = min(angles), max(angles)
    if most - middle >= MIN_SIDE_SHARE * half and middle - least >= MIN_SIDE_SHARE * half:
        return
    yield (
        f"the valid angles are {1e3 * least:.1f} to {1e3 * most:.1f} mrad, the cable swings from "
        f"{1e3 * low:.1f} to {1e3 * high:.1f} mrad: one side of the swing is missing; try --pivot "
        "auto"
    )


def _pivot_reasons(look: Look, told: Point | None) -> list[str]:
    place = look.pivot_in_picture()
    if told is None or look.pivot is None or place is None:
        return []
    return [worded(finding) for finding in told_pivot_finding(look.pivot, place, told)]
