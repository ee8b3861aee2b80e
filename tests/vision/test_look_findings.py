"""Findings of a first look, each with its figures and what to try."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
import pytest

from tests.vision.swing_pictures import (
    HEIGHT,
    NOISE,
    PIVOT_PX,
    WHITE,
    FloatArray,
    Image,
    bob,
    cable,
    coloured,
    picture,
    swing,
    swinging,
)
from vision.first_look import LookChoices, look
from vision.look_findings import LookFinding, light_findings, pivot_findings, told_pivot_finding
from vision.pivot_fit import MeetingPoint
from vision.view import PictureRegion

COUNT = 14


def findings(pictures: list[Image], choices: LookChoices | None = None) -> list[LookFinding]:
    return list(look(pictures, choices=choices).findings)


def drawn(
    covers: Iterable[FloatArray], seed: int = 1, ground: float = WHITE, noise: float = NOISE
) -> list[Image]:
    random = np.random.default_rng(seed)
    return [picture(cover, random, ground, noise=noise) for cover in covers]


def covers_of(amplitude_rad: float = 0.25, x_px: float = 100.0) -> list[FloatArray]:
    return [cable(float(a), (x_px, PIVOT_PX[1])) for a in swing(COUNT, amplitude_rad)]


def only(found: Iterable[LookFinding]) -> LookFinding:
    """Return the finding of a list of one."""
    (one,) = found
    return one


def figures(finding: LookFinding) -> list[float]:
    """List the numbers of a text."""
    return [float(text) for text in re.findall(r"[-+]?\d+(?:\.\d+)?", finding.text)]


def test_a_clean_swing_has_no_finding() -> None:
    assert findings(swinging(COUNT)) == []


@pytest.mark.parametrize(
    ("turns", "back"),
    [(1, "90 degrees to the right"), (2, "180 degrees"), (3, "90 degrees to the left")],
)
def test_pictures_that_were_turned_are_named(turns: int, back: str) -> None:
    pictures = drawn((cable if turns == 1 else bob)(float(angle)) for angle in swing(COUNT))
    first = findings([np.ascontiguousarray(np.rot90(image, turns)) for image in pictures])[0]
    assert first == LookFinding(f"the pivot is not at the top: the pictures are turned by {back}")


def test_lines_that_miss_their_meeting_point_are_named_with_the_distance() -> None:
    shifts = [20.0, -12.0, 3.0, -20.0, 15.0, -5.0, -16.0, 20.0, 9.0, -20.0, 0.0, 12.0, -9.0, 5.0]
    covers = []
    for shift, angle in zip(shifts, swing(COUNT, 0.15), strict=True):
        covers.append(cable(float(angle), (100.0 + shift, -16.0)))
    found = findings(drawn(covers))[0]
    lines, x, y, miss_px = figures(found)
    assert "miss their meeting point" in found.text
    assert lines == COUNT
    assert 0.5 * np.std(shifts) < miss_px < 1.2 * np.std(shifts)
    assert (found.parameter, found.value) == ("pivot", f"{x:.1f},{y:.1f}")


def test_lines_of_two_pivots_are_named_with_that_of_more_lines() -> None:
    covers = []
    for k, angle in enumerate(swing(COUNT, 0.15)):
        covers.append(cable(float(angle), (120.0 if k % 4 < 2 else 80.0, -16.0)))
    found = only(findings(drawn(covers)))
    missing, lines, x, y = figures(found)
    assert (missing, lines) == (6, COUNT)
    assert (x, y) == pytest.approx((120.0, -16.0), abs=0.2)
    assert found.text.endswith("the pivot moves, or it is not one cable")


def test_a_swing_too_small_for_the_row_of_the_pivot_is_named_with_its_sigma() -> None:
    covers = [cable(float(a), (100.0, -4000.0)) for a in swing(COUNT, 3e-4)]
    found = only(findings(drawn(covers)))
    assert "too small to tell the row of the pivot" in found.text
    row, sigma_row = figures(found)
    assert sigma_row > 20.0
    assert row == pytest.approx(-4000.0, abs=4.0 * sigma_row)
    assert (found.parameter, found.value) == ("pivot", "X,Y")


def test_a_short_swing_of_a_bob_is_named_too() -> None:
    covers = [bob(float(a), (100.0, -3000.0), 3080.0) for a in swing(COUNT, 0.012)]
    found = findings(drawn(covers))[0]
    assert "too small to tell the row of the pivot" in found.text


def test_a_camera_that_was_pushed_is_named_with_the_distance() -> None:
    covers = []
    for k, angle in enumerate(swing(COUNT)):
        covers.append(cable(float(angle), (100.0 + (5.0 if k >= COUNT // 2 else 0.0), -16.0)))
    texts = findings(drawn(covers))
    found = only(item for item in texts if "from the first to the last third" in item.text)
    assert figures(found)[0] == pytest.approx(5.0, abs=1.0)
    assert (found.parameter, found.value) == ("from", "START --to END of a part without motion")


def test_a_line_in_few_of_the_pictures_is_named_with_their_number() -> None:
    covers = covers_of()
    for k in range(0, COUNT, 2):
        covers[k] = 0.0 * covers[k]
    found = only(findings(drawn(covers)))
    assert found.text == f"only {COUNT // 2} of {COUNT} pictures show what moves"


def pivot(scatter_px: float = 0.02, sigma_row_px: float = 0.1) -> MeetingPoint:
    return MeetingPoint((100.0, -16.0), (0.01, sigma_row_px), scatter_px, 20, 0, 0.0)


def test_the_bounds_of_a_pivot_that_is_told_are_those_of_its_scatter_and_sigma() -> None:
    place = (100.0, -16.0)
    assert list(pivot_findings(pivot(1.9, 19.0), 20, place)) == []
    assert len(list(pivot_findings(pivot(2.1), 20, place))) == 1
    assert len(list(pivot_findings(pivot(sigma_row_px=21.0), 20, place))) == 1
    assert len(list(pivot_findings(pivot(), 29, place))) == 1  # 20 of 29 lines
    assert list(pivot_findings(pivot(), 28, place)) == []
    assert list(pivot_findings(pivot()._replace(outliers=8), 28, place)) == []
    assert len(list(pivot_findings(pivot()._replace(outliers=9), 28, place))) == 1
    drifting = pivot()._replace(drift_px=1.1)
    assert len(list(pivot_findings(drifting, 20, place))) == 1


def test_a_told_pivot_beside_the_lines_is_named_with_the_right_one() -> None:
    found = only(told_pivot_finding(pivot(), (312.44, -41.0), (300.0, -30.5)))
    assert found == LookFinding(
        "the lines found meet at 312.4,-41.0, +12.4 px and -10.5 rows from the pivot 300,-30.5",
        "pivot",
        "312.4,-41.0",
    )


def test_a_told_pivot_within_the_gate_or_the_accuracy_is_not_named() -> None:
    assert list(told_pivot_finding(pivot(), (100.0, -16.0), (104.0, -13.5))) == []
    assert len(list(told_pivot_finding(pivot(), (100.0, -16.0), (104.0, -12.5)))) == 1
    unsure = pivot(sigma_row_px=10.0)
    assert list(told_pivot_finding(unsure, (100.0, -16.0), (100.0, 13.0))) == []
    scattered = pivot(scatter_px=3.0)
    assert list(told_pivot_finding(scattered, (100.0, -16.0), (200.0, 80.0))) == []


def test_a_line_that_never_moves_is_named_with_its_place() -> None:
    found = only(findings(drawn([cable(0.1)] * COUNT)))
    assert "does not move in any picture: it is not taken for a cable" in found.text
    assert (found.parameter, found.value) == ("at_rest", "")
    x0, y0, x1, y1, degrees = figures(found)
    for x, y in ((x0, y0), (x1, y1)):
        assert x == pytest.approx(PIVOT_PX[0] + np.tan(0.1) * (y - PIVOT_PX[1]), abs=1.5)
    assert y0 < 12
    assert y1 > HEIGHT - 12
    assert degrees == pytest.approx(np.degrees(0.1), abs=0.3)


def test_few_pictures_say_nothing_of_what_never_moves() -> None:
    assert findings(swinging(1)) == []
    assert findings(drawn([cable(0.1)] * 4)) == []
    assert findings(drawn([cable(0.1)] * COUNT), LookChoices(at_rest=True)) == []


@pytest.mark.parametrize(("offset_px", "is_named"), [(0.0, True), (6.0, True), (45.0, False)])
def test_a_static_line_through_the_pivot_is_named(offset_px: float, is_named: bool) -> None:
    static = cable(0.0, (PIVOT_PX[0] + offset_px, PIVOT_PX[1]))
    texts = findings(drawn(np.maximum(cover, static) for cover in covers_of()))
    through = [item for item in texts if "passes through the pivot" in item.text]
    assert len(through) == is_named
    for item in through:
        x0, _, x1, _, _ = figures(item)
        assert (x0, x1) == pytest.approx((100.0 + offset_px, 100.0 + offset_px), abs=1.5)


@pytest.mark.parametrize("offset_px", [-60.0, 40.0])
def test_a_second_cable_is_named_with_its_distance(offset_px: float) -> None:
    # the second one is paler and shorter, so that the first one is found in every picture
    rows = np.arange(HEIGHT)[:, None]
    covers = []
    for cover, other in zip(covers_of(0.12), covers_of(0.12, 100.0 + offset_px), strict=True):
        covers.append(np.maximum(cover, 0.6 * other * (rows < 130)))
    found = only(findings(drawn(covers)))
    assert "a second line moves" in found.text
    distance_px, pictures, tried = figures(found)[:3]
    assert distance_px == pytest.approx(offset_px, abs=2.0)
    assert 0.5 * tried < pictures <= tried
    assert (found.parameter, found.value) == ("roi", "X,Y,W,H of the cable alone")


def test_a_bob_without_a_cable_is_named() -> None:
    found = only(findings(drawn(bob(float(angle)) for angle in swing(COUNT))))
    assert found == LookFinding("no cable can be seen: the bob is tracked")


def test_an_overexposed_an_underexposed_and_an_empty_picture_are_told_apart() -> None:
    empty = [0.0 * cable(0.0)] * COUNT
    over = only(findings(drawn(empty, ground=300.0)))
    assert over.text == (
        "100 % of the pixels are at full scale: overexposed; record with a shorter exposure"
    )
    under = only(findings(drawn(empty, ground=4.0, noise=1.0)))
    assert under.text == (
        "the median grey level is 4 of 255: underexposed; record with more light or a longer "
        "exposure"
    )
    blank = only(findings(drawn(empty, ground=120.0)))
    assert "no line stands out: median grey level 120, noise 2." in blank.text
    assert blank.text.endswith(
        f"{COUNT} pictures searched in all planes, dark and bright, upright and turned"
    )


def test_a_bright_view_is_judged_by_its_pictures() -> None:
    dim = drawn([0.0 * cable(0.0)] * COUNT, ground=4.0, noise=1.0)
    found = only(findings(dim, LookChoices(is_bright=True)))
    assert "underexposed" in found.text


def test_the_median_of_the_pictures_tells_the_light() -> None:
    levels = [30.0, 100.0, 200.0]
    pictures = [picture(0.0 * cable(0.0), np.random.default_rng(1), level) for level in levels]
    assert "median grey level 100," in only(light_findings(pictures, "all planes")).text


def test_what_was_searched_is_named() -> None:
    choices = LookChoices(
        plane="green", is_bright=True, turns=0, region=PictureRegion(0, 0, 160, 128)
    )
    found = only(findings(drawn([0.0 * cable(0.0)] * COUNT), choices))
    assert found.text.endswith("searched in the green plane, for a bright cable, in the region")


def test_choices_that_hide_the_cable_are_named_with_those_that_show_it() -> None:
    dark = swinging(COUNT)
    polarity = findings(dark, LookChoices(is_bright=True))[0]
    assert (polarity.parameter, polarity.value) == ("polarity", "dark")
    assert "a dark cable swings in the grey plane" in polarity.text

    random = np.random.default_rng(2)
    levels = (150.0, 150.0, 150.0), (150.0, 150.0, 60.0)
    red = [coloured(cover, random, *levels) for cover in covers_of()]
    plane = findings(red, LookChoices(plane="green"))[0]
    assert (plane.parameter, plane.value) == ("plane", "red")
    assert "a dark cable swings in the red plane" in plane.text

    region = findings(dark, LookChoices(region=PictureRegion(0, 0, 64, 64)))[0]
    assert (region.parameter, region.value) == ("roi", "X,Y,W,H around it")
    assert region.text.endswith("in the grey plane of the whole picture")

    light = drawn((bob(float(a)) for a in swing(COUNT)), ground=100.0)
    bright = findings(light, LookChoices(is_bright=True))[0]
    assert "a dark bob without a cable swings" in bright.text


def test_choices_that_hide_nothing_are_not_named() -> None:
    empty = drawn([0.0 * cable(0.0)] * COUNT)
    assert len(findings(empty, LookChoices(is_bright=True))) == 1
    assert findings(swinging(COUNT), LookChoices(is_bright=False)) == []
