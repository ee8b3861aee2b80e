"""Findings of a first look: what is unusual in the pictures, with figures and what to try."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vision.cable_lines import CableLines
from vision.free_lines import FreeLine, find_lines
from vision.line_fit import Grey
from vision.pivot_fit import MeetingPoint
from vision.ridge import grey_levels
from vision.static_scene import StaticScene

MAX_SCATTER_PX = 2.0  # of lines that meet in one point
MAX_ROW_SIGMA_PX = 20.0  # of a pivot that can be told from the lines
MAX_DRIFT_SIGMAS = 6.0  # of the pivot between the first and the last third
MIN_DRIFT_PX = 1.0
MAX_TOLD_MISS_PX = 5.0  # the gate of the tracker
PASSING_PX = 12.0  # a line nearer to the pivot passes through it
FEW_SHARE = 0.7  # of the pictures with a line
DARK_LEVEL, BRIGHT_SHARE = 12.0, 0.5  # under- and overexposed
SECOND_SUPPORT = 0.5  # of that of the cable
SECOND_PICTURES = 6
TURNED = {1: "90 degrees to the left", 2: "180 degrees", 3: "90 degrees to the right"}


class LookFinding(NamedTuple):
    """Finding in plain words; parameter and value name what to try."""

    text: str
    parameter: str = ""
    value: str = ""


def turn_findings(turns: int) -> Iterator[LookFinding]:
    """Report a picture that was turned."""
    if turns:
        text = f"the pivot is not at the top: the pictures are turned by {TURNED[turns]}"
        yield LookFinding(text)


def pivot_findings(
    pivot: MeetingPoint, pictures: int, place: tuple[float, float]
) -> Iterator[LookFinding]:
    """Report how well lines meet in a pivot; place: of the pivot in the pictures."""
    where = f"{place[0]:.1f},{place[1]:.1f}"
    lines = pivot.lines + pivot.outliers
    if pivot.scatter_px > MAX_SCATTER_PX:
        yield LookFinding(
            f"the lines of {lines} pictures miss their meeting point {where} by "
            f"{pivot.scatter_px:.1f} px: the pivot moves, or it is not one cable",
            "pivot",
            where,
        )
    elif pivot.sigma_px[1] > MAX_ROW_SIGMA_PX:
        yield LookFinding(
            f"the swing is too small to tell the row of the pivot: {place[1]:.0f} +- "
            f"{pivot.sigma_px[1]:.0f} px",
            "pivot",
            "X,Y",
        )
    elif pivot.lines < FEW_SHARE * lines:
        yield LookFinding(
            f"{pivot.outliers} of {lines} lines miss the point {where} in which the others meet: "
            "the pivot moves, or it is not one cable"
        )
    limit_px = max(MIN_DRIFT_PX, MAX_DRIFT_SIGMAS * pivot.scatter_px / math.sqrt(pivot.lines))
    if abs(pivot.drift_px) > limit_px and pivot.scatter_px <= 3.0 * abs(pivot.drift_px):
        yield LookFinding(
            f"the meeting point moves by {pivot.drift_px:+.1f} px from the first to the last third "
            "of the video: the camera or the pivot moved",
            "from",
            "START --to END of a part without motion",
        )
    if lines < FEW_SHARE * pictures:
        yield LookFinding(f"only {lines} of {pictures} pictures show what moves")


def told_pivot_finding(
    pivot: MeetingPoint, place: tuple[float, float], told: tuple[float, float]
) -> Iterator[LookFinding]:
    """Report a told pivot that the lines do not go through; place: of the pivot found."""
    if pivot.scatter_px > MAX_SCATTER_PX:
        return
    across, along = place[0] - told[0], place[1] - told[1]
    if math.hypot(across, along) <= max(MAX_TOLD_MISS_PX, 3.0 * pivot.sigma_px[1]):
        return
    where = f"{place[0]:.1f},{place[1]:.1f}"
    yield LookFinding(
        f"the lines found meet at {where}, {across:+.1f} px and {along:+.1f} rows from the pivot "
        f"{told[0]:g},{told[1]:g}",
        "pivot",
        where,
    )


def static_findings(
    lines: Sequence[FreeLine], pivot: tuple[float, float] | None
) -> Iterator[LookFinding]:
    """Report lines that never move; those through the pivot if it is known."""
    for item in lines:
        degrees = math.degrees(math.atan(item.line.slope))
        place = f"from {item.line.at(item.first_row):.0f},{item.first_row} to "
        place += f"{item.line.at(item.last_row):.0f},{item.last_row} ({degrees:+.1f} degrees)"
        if pivot is None:
            yield LookFinding(
                f"the line {place} does not move in any picture: it is not taken for a cable",
                "at_rest",
            )
        elif abs(item.line.at(pivot[1]) - pivot[0]) <= PASSING_PX:
            yield LookFinding(
                f"the line {place} passes through the pivot and never moves: rows near it are not "
                "used"
            )


def second_line_findings(
    seen: Sequence[Grey], found: CableLines, scene: StaticScene
) -> Iterator[LookFinding]:
    """Report a second line that moves: another cable, or a shadow."""
    distances_px = []
    tried = 0
    step = max(1, len(seen) // SECOND_PICTURES)
    for picture, item in list(zip(seen, found.lines, strict=True))[::step]:
        if item is None:
            continue
        tried += 1
        noise = grey_levels(picture).noise
        lines = find_lines(scene.without(picture), noise, 2, picture)
        if len(lines) < 2 or lines[1].support < SECOND_SUPPORT * lines[0].support:
            continue
        middle = 0.5 * picture.shape[0]
        own = item.measured.line.at(middle)
        distances_px.append(max((line.line.at(middle) - own for line in lines), key=abs))
    if tried and len(distances_px) > 0.5 * tried:
        yield LookFinding(
            f"a second line moves, {float(np.median(distances_px)):+.0f} px beside the first in "
            f"the middle of the picture ({len(distances_px)} of {tried} pictures): a second cable, "
            "or a shadow",
            "roi",
            "X,Y,W,H of the cable alone",
        )


def light_findings(pictures: Sequence[Grey], where: str) -> Iterator[LookFinding]:
    """Report pictures (height, width) of a view without a line; where: what was searched."""
    levels = [grey_levels(picture) for picture in pictures]
    background = float(np.median([item.background for item in levels]))
    saturation = float(np.median([item.saturation for item in levels]))
    if saturation > BRIGHT_SHARE:
        yield LookFinding(
            f"{100.0 * saturation:.0f} % of the pixels are at full scale: overexposed; record with "
            "a shorter exposure"
        )
    elif background < DARK_LEVEL:
        yield LookFinding(
            f"the median grey level is {background:.0f} of 255: underexposed; record with more "
            "light or a longer exposure"
        )
    else:
        noise = float(np.median([item.noise for item in levels]))
        yield LookFinding(
            f"no line stands out: median grey level {background:.0f}, noise {noise:.1f} levels, "
            f"{len(pictures)} pictures searched in {where}"
        )
