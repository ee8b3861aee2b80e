"""First look at a video: view, cable, static scene and pivot, from some 30 spread pictures."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vision.bob_look import BobLook, look_for_bob
from vision.cable_lines import (
    MIN_PICTURES,
    CableLines,
    PictureLine,
    cable_lines,
    static_scene,
    swing_of,
)
from vision.free_lines import FreeLine, find_lines
from vision.line_fit import Grey
from vision.look_findings import (
    LookFinding,
    light_findings,
    pivot_findings,
    second_line_findings,
    static_findings,
    turn_findings,
)
from vision.pivot_fit import MeetingPoint, meeting_point
from vision.ridge import grey_levels
from vision.static_scene import StaticScene
from vision.templates import CableLook
from vision.view import PictureRegion, PictureView, Point, plane_of
from vision.view_choice import choose_view

MAX_PIVOT_SCATTER_PX = 2.0  # of lines that meet in one point
MAX_PIVOT_SIGMA_PX = 20.0  # of the row of a pivot that is told
ABOVE_SHARE = 0.1  # height above the picture of a pivot whose row is not known
MAX_STATIC_LINES = 4


class Subject(enum.Enum):
    """Subject of the pictures."""

    CABLE = "cable"  # one that swings
    STILL = "still"  # lines that do not move: a cable at rest, or none at all
    BOB = "bob"  # a moving blob without a visible cable
    NOTHING = "nothing"


@dataclass(frozen=True, slots=True, kw_only=True)
class LookChoices:
    """Choices of the user; None = find it."""

    plane: str | None = None
    is_bright: bool | None = None
    turns: int | None = None
    width_px: float | None = None
    region: PictureRegion | None = None
    at_rest: bool = False  # a cable that never moves is measured

    @property
    def is_free(self) -> bool:
        """True if view and region are left open."""
        return (self.plane, self.is_bright, self.turns, self.region) == (None,) * 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """Result of a first look. Places and lines are those of the view."""

    view: PictureView
    subject: Subject
    size: tuple[int, int]  # width and height of the pictures
    median: Grey  # of the view: what never moves, and a cable that hardly does
    scene: StaticScene | None = None  # None: the cable cannot be told from what never moves
    cable: CableLook | None = None
    pivot: MeetingPoint | None = None
    bob: BobLook | None = None
    lines: tuple[PictureLine | None, ...] = ()  # one for each picture
    static_lines: tuple[FreeLine, ...] = ()
    swing_rad: tuple[float, float] | None = None  # smallest and largest angle
    findings: tuple[LookFinding, ...] = ()

    @property
    def is_pivot_known(self) -> bool:
        """True if the lines meet in one point, well enough to replace a pivot that was told."""
        pivot = self.pivot
        if pivot is None or self.subject not in (Subject.CABLE, Subject.BOB):
            return False
        is_sharp = pivot.scatter_px <= MAX_PIVOT_SCATTER_PX
        return is_sharp and pivot.sigma_px[1] <= MAX_PIVOT_SIGMA_PX

    def gate_px(self) -> Point | None:
        """Choose the place in the view that a line must pass, where no pivot is told.

        The pivot; if its row is not known, the place of the lines above the picture (bob: None).
        """
        height = self.median.shape[0]
        row = -ABOVE_SHARE * height
        if self.pivot is not None:
            if self.pivot.sigma_px[1] <= MAX_PIVOT_SIGMA_PX:
                return self.pivot.at_px
            if self.bob is not None:
                return None
            measured = [item.measured.line for item in self.lines if item is not None]
            row = min(row, self.pivot.at_px[1])
            return float(np.median([line.at(row) for line in measured])), row
        if self.static_lines:
            return self.static_lines[0].line.at(row), row
        return None

    def pivot_in_picture(self) -> Point | None:
        """Convert the pivot to a place in the pictures [px]."""
        return None if self.pivot is None else self.view.to_picture(self.pivot.at_px, self.size)


def look(
    pictures: Sequence[Grey],
    pivots_px: Sequence[Point] | None = None,
    choices: LookChoices | None = None,
) -> Look:
    """Look at pictures (height, width) or (height, width, 3) of one size, spread over the video.

    pivots_px: predicted pivot in each picture, if known; only its motion is used.
    """
    chosen = choices or LookChoices()
    found = _look(pictures, pivots_px, chosen)
    if found.subject in (Subject.NOTHING, Subject.STILL) and not chosen.is_free:
        other = _look(pictures, pivots_px, LookChoices(at_rest=chosen.at_rest))
        more = _choice_findings(chosen, other)
        return replace(found, findings=(*more, *found.findings))
    return found


def _look(pictures: Sequence[Grey], pivots_px: Sequence[Point] | None, chosen: LookChoices) -> Look:
    size = (pictures[0].shape[1], pictures[0].shape[0])
    view = choose_view(pictures, chosen.plane, chosen.is_bright, chosen.turns, chosen.region)
    seen = [view.picture(picture) for picture in pictures]
    moves_px = _moves_px(pivots_px, len(seen))
    origin = view.to_view((0.0, 0.0), size)[0]
    shifts_px = [view.to_view(move_px, size)[0] - origin for move_px in moves_px]
    found = cable_lines(seen, chosen.width_px)
    pivot = _pivot(found, shifts_px)
    if not found.is_moving:
        bob = look_for_bob(
            pictures,
            moves_px,
            chosen.plane,
            chosen.is_bright,
            chosen.turns,
            chosen.region,
        )
        if bob is not None:
            return _described_bob(bob, size, moves_px)
    if chosen.turns is None and _is_upside_down(found, pivot, seen[0].shape[0]):
        turned = replace(chosen, turns=(view.turns + 2) % 4, plane=view.plane)
        return _look(pictures, pivots_px, replace(turned, is_bright=view.is_bright))
    return _described(view, pictures, seen, found, pivot, chosen)


def _choice_findings(chosen: LookChoices, other: Look) -> Iterator[LookFinding]:
    """Report what is seen without the choices of the user."""
    if other.subject not in (Subject.CABLE, Subject.BOB):
        return
    view = other.view
    what = "cable" if other.subject is Subject.CABLE else "bob without a cable"
    polarity = "bright" if view.is_bright else "dark"
    about = f"with these choices nothing is found that swings, but a {polarity} {what} swings in "
    about += f"the {view.plane} plane"
    if chosen.is_bright is not None and chosen.is_bright is not view.is_bright:
        yield LookFinding(about, "polarity", polarity)
    elif chosen.plane is not None and chosen.plane != view.plane:
        yield LookFinding(about, "plane", view.plane)
    elif chosen.region is not None:
        yield LookFinding(f"{about} of the whole picture", "roi", "X,Y,W,H around it")


def _moves_px(pivots_px: Sequence[Point] | None, count: int) -> list[Point]:
    """Compute the motion of the told pivot in the pictures, from the first one [px]."""
    if not pivots_px:
        return [(0.0, 0.0)] * count
    return [(x - pivots_px[0][0], y - pivots_px[0][1]) for x, y in pivots_px]


def _pivot(found: CableLines, shifts_px: Sequence[float]) -> MeetingPoint | None:
    measured = []
    for item, shift_px in zip(found.lines, shifts_px, strict=True):
        if item is not None:
            measured.append(item.measured._replace(shift_px=shift_px))
    return meeting_point(measured) if found.is_moving else None


def _is_upside_down(found: CableLines, pivot: MeetingPoint | None, height: int) -> bool:
    """Tell if the lines meet below the rows in which they are seen."""
    if pivot is None or pivot.scatter_px > MAX_PIVOT_SCATTER_PX:
        return False
    middles = [item.measured.middle_row for item in found.lines if item is not None]
    below = pivot.at_px[1] - float(np.median(middles))
    return below > max(0.1 * height, 3.0 * pivot.sigma_px[1])


def _described(
    view: PictureView,
    pictures: Sequence[Grey],
    seen: Sequence[Grey],
    found: CableLines,
    pivot: MeetingPoint | None,
    chosen: LookChoices,
) -> Look:
    still = found.median
    statics = find_lines(still, grey_levels(still).noise, MAX_STATIC_LINES)
    subject = Subject.NOTHING
    scene: StaticScene | None = static_scene(still, found.reach_px)
    if found.is_moving:
        subject = Subject.CABLE
    elif statics:
        subject = Subject.STILL
    if len(seen) < MIN_PICTURES or (subject is Subject.STILL and chosen.at_rest):
        scene = None
    described = Look(
        view=view,
        subject=subject,
        size=(pictures[0].shape[1], pictures[0].shape[0]),
        median=still,
        scene=scene,
        cable=found.cable,
        pivot=pivot,
        lines=found.lines,
        static_lines=tuple(statics),
        swing_rad=swing_of(found) if found.is_moving else None,
    )
    return replace(described, findings=tuple(_findings(described, pictures, seen, found, chosen)))


def _findings(
    described: Look,
    pictures: Sequence[Grey],
    seen: Sequence[Grey],
    found: CableLines,
    chosen: LookChoices,
) -> Iterator[LookFinding]:
    yield from turn_findings(described.view.turns)
    pivot, place = described.pivot, described.pivot_in_picture()
    if pivot is not None and place is not None:
        yield from pivot_findings(pivot, len(seen), place)
        yield from static_findings(described.static_lines, pivot.at_px)
    if described.subject is Subject.CABLE and described.scene is not None:
        yield from second_line_findings(seen, found, described.scene)
    elif described.subject is Subject.STILL and described.scene is not None:
        yield from static_findings(described.static_lines, None)
    elif described.subject is Subject.NOTHING:
        upright = [plane_of(picture, described.view.plane) for picture in pictures]
        yield from light_findings(upright, _searched(chosen))


def _searched(chosen: LookChoices) -> str:
    """Name the views that the choices leave open."""
    planes = "all planes" if chosen.plane is None else f"the {chosen.plane} plane"
    polarity = "dark and bright"
    if chosen.is_bright is not None:
        polarity = "for a bright cable" if chosen.is_bright else "for a dark cable"
    turns = ", upright and turned" if chosen.turns is None else ""
    part = "" if chosen.region is None else ", in the region"
    return f"{planes}, {polarity}{turns}{part}"


def _described_bob(bob: BobLook, size: tuple[int, int], moves_px: Sequence[Point]) -> Look:
    circle = bob.circle
    centre = bob.view.to_picture(circle.centre_px, size)
    angles = []
    for blob, move_px in zip(bob.blobs, moves_px, strict=True):
        if blob is not None:
            pivot_px = (centre[0] + move_px[0], centre[1] + move_px[1])
            x, y = bob.view.to_view(pivot_px, size)
            angles.append(math.atan2(blob.u - x, blob.v - y))
    pivot = MeetingPoint(
        circle.centre_px,
        circle.sigma_centre_px,
        circle.scatter_px,
        circle.points,
        len(angles) - circle.points,
        0.0,
    )
    return Look(
        view=bob.view,
        subject=Subject.BOB,
        size=size,
        median=bob.ground,
        bob=bob,
        pivot=pivot,
        swing_rad=(min(angles), max(angles)),
        findings=(
            *turn_findings(bob.view.turns),
            *pivot_findings(pivot, len(moves_px), centre),
            LookFinding("no cable can be seen: the bob is tracked"),
        ),
    )
