"""First look at drawn pictures: what swings, how it is seen, and about which pivot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.vision.swing_pictures import (
    AMPLITUDE_RAD,
    HEIGHT,
    PIVOT_PX,
    WHITE,
    WIDTH,
    FloatArray,
    Image,
    Point,
    bob,
    cable,
    coloured,
    picture,
    swing,
    swinging,
)
from vision.first_look import Look, LookChoices, Subject, look
from vision.view import PictureRegion, PictureView

COUNT = 14


def pictures_of(covers: list[FloatArray], seed: int, ground: float = WHITE) -> list[Image]:
    random = np.random.default_rng(seed)
    return [picture(cover, random, ground) for cover in covers]


def turned(pictures: list[Image], turns: int) -> list[Image]:
    """Turn pictures counterclockwise by quarter turns."""
    return [np.ascontiguousarray(np.rot90(image, turns)) for image in pictures]


def pivot_of(found: Look) -> Point:
    place = found.pivot_in_picture()
    assert place is not None
    return place


@pytest.mark.parametrize("pivot", [PIVOT_PX, (100.0, 20.0), (60.0, -300.0)])
def test_a_cable_that_swings_gives_its_pivot(pivot: Point) -> None:
    # as wide at the lower border whatever the distance
    amplitude = AMPLITUDE_RAD * (HEIGHT - PIVOT_PX[1]) / (HEIGHT - pivot[1])
    angles = swing(COUNT, min(amplitude, 0.25), math.atan((100.0 - pivot[0]) / (HEIGHT - pivot[1])))
    found = look(pictures_of([cable(float(a), pivot) for a in angles], 1))
    assert found.subject is Subject.CABLE
    assert found.view == PictureView()
    assert found.size == (WIDTH, HEIGHT)
    x, y = pivot_of(found)
    assert x == pytest.approx(pivot[0], abs=0.3)
    assert y == pytest.approx(pivot[1], abs=0.1 if pivot[1] > -100.0 else 1.5)
    assert found.is_pivot_known
    assert found.gate_px() == pytest.approx((x, y))
    assert found.swing_rad == pytest.approx((angles.min(), angles.max()), abs=1e-3)
    assert found.findings == ()


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_turned_pictures_give_the_pivot_where_it_is_in_them(turns: int) -> None:
    found = look(turned(swinging(COUNT), turns))
    assert found.subject is Subject.CABLE
    assert (found.view.turns + turns) % 4 == 0
    x, y = PIVOT_PX
    # counterclockwise: the right border comes to the top
    place = [(y, WIDTH - 1 - x), (WIDTH - 1 - x, HEIGHT - 1 - y), (HEIGHT - 1 - y, x)][turns - 1]
    assert pivot_of(found) == pytest.approx(place, abs=0.1)
    assert found.pivot is not None
    assert found.pivot.at_px == pytest.approx(PIVOT_PX, abs=0.1)


@pytest.mark.parametrize("plane", ["blue", "green", "red"])
def test_a_cable_that_differs_in_one_colour_gives_its_pivot(plane: str) -> None:
    random = np.random.default_rng(2)
    ink = [150.0, 150.0, 150.0]
    ink[["blue", "green", "red"].index(plane)] = 240.0
    levels = (ink[0], ink[1], ink[2])
    covers = [cable(float(angle)) for angle in swing(COUNT)]
    found = look([coloured(cover, random, (150.0,) * 3, levels) for cover in covers])
    assert found.view == PictureView(plane, True)
    assert found.is_pivot_known
    assert pivot_of(found) == pytest.approx(PIVOT_PX, abs=0.15)


def test_a_region_leaves_the_pivot_where_it_is_in_the_picture() -> None:
    region = PictureRegion(30, 40, 150, 110)
    found = look(swinging(COUNT), choices=LookChoices(region=region))
    assert found.view.region == region
    assert pivot_of(found) == pytest.approx(PIVOT_PX, abs=0.15)
    assert found.median.shape == (110, 150)


def test_a_static_line_through_the_pivot_is_not_the_cable() -> None:
    static = cable(0.0)
    covers = [np.maximum(cable(float(angle)), static) for angle in swing(COUNT)]
    found = look(pictures_of(covers, 3))
    assert found.subject is Subject.CABLE
    assert found.is_pivot_known
    assert pivot_of(found) == pytest.approx(PIVOT_PX, abs=0.15)
    assert found.swing_rad == pytest.approx((-0.245, 0.243), abs=2e-3)
    assert len(found.static_lines) == 1
    assert found.static_lines[0].line.slope == pytest.approx(0.0, abs=5e-3)


def test_a_line_that_never_moves_is_still() -> None:
    covers = [cable(0.1)] * COUNT
    found = look(pictures_of(covers, 4))
    assert found.subject is Subject.STILL
    assert found.scene is not None
    assert found.swing_rad is None
    assert not found.is_pivot_known
    gate = found.gate_px()
    assert gate is not None
    true = PIVOT_PX[0] + math.tan(0.1) * (gate[1] - PIVOT_PX[1])
    assert gate[0] == pytest.approx(true, abs=1.0)
    assert gate[1] < 0.0
    # nothing tells it from the cable if that hangs still
    hanging = look(pictures_of(covers, 4), choices=LookChoices(at_rest=True))
    assert hanging.subject is Subject.STILL
    assert hanging.scene is None
    assert hanging.findings == ()


def test_a_bob_without_a_cable_is_found() -> None:
    angles = swing(COUNT)
    found = look(pictures_of([bob(float(angle)) for angle in angles], 5))
    assert found.subject is Subject.BOB
    assert found.is_pivot_known
    assert pivot_of(found) == pytest.approx(PIVOT_PX, abs=1.2)
    assert found.swing_rad == pytest.approx((angles.min(), angles.max()), rel=0.02)
    assert found.bob is not None
    assert found.gate_px() == found.bob.circle.centre_px


@pytest.mark.parametrize("turns", [0, 1])
def test_the_told_motion_of_the_pivot_is_taken_off(turns: int) -> None:
    angles = swing(COUNT)
    shifts = 2.0 * np.arange(COUNT)
    places = [(PIVOT_PX[0] - 12.0 + shift, PIVOT_PX[1]) for shift in shifts]
    told = [(40.0 + shift, 3.0) for shift in shifts]  # only its motion is used
    if turns:
        told = [(y, WIDTH - 1 - x) for x, y in told]
    for draw in (cable, bob):
        covers = [draw(float(a), place) for a, place in zip(angles, places, strict=True)]
        found = look(turned(pictures_of(covers, 6), turns), told)
        assert found.view.turns == (4 - turns) % 4
        assert found.pivot is not None
        assert found.pivot.at_px == pytest.approx((PIVOT_PX[0] - 12.0, PIVOT_PX[1]), abs=1.5)
        assert found.pivot.scatter_px < 0.1
        assert found.swing_rad == pytest.approx((angles.min(), angles.max()), rel=0.03)


def test_an_empty_picture_has_nothing() -> None:
    found = look(pictures_of([0.0 * cable(0.0)] * COUNT, 7))
    assert found.subject is Subject.NOTHING
    assert found.gate_px() is None
    assert found.pivot_in_picture() is None
    assert not found.is_pivot_known


def test_lines_of_a_small_swing_pass_a_gate_above_the_picture() -> None:
    # far above, so that the row of the pivot is not known
    pivot = (100.0, -4000.0)
    angles = swing(COUNT, 3e-4)
    found = look(pictures_of([cable(float(angle), pivot) for angle in angles], 8))
    assert found.subject is Subject.CABLE
    assert found.pivot is not None
    assert found.pivot.sigma_px[1] > 20.0
    assert not found.is_pivot_known
    gate = found.gate_px()
    assert gate is not None
    assert gate[0] == pytest.approx(100.0, abs=1.0)
    assert gate[1] <= -0.1 * HEIGHT


def test_a_bob_whose_pivot_is_far_away_has_no_gate() -> None:
    covers = [bob(float(a), (100.0, -3000.0), 3080.0) for a in swing(COUNT, 0.012)]
    found = look(pictures_of(covers, 9))
    assert found.subject is Subject.BOB
    assert not found.is_pivot_known
    assert found.gate_px() is None


def test_two_cables_have_no_common_pivot() -> None:
    angles = swing(COUNT, 0.12).tolist()
    covers = [np.maximum(cable(a, (70.0, -16.0)), cable(a, (130.0, -16.0))) for a in angles]
    found = look(pictures_of(covers, 10))
    assert found.subject is Subject.CABLE
    assert not found.is_pivot_known
    left = look(
        pictures_of(covers, 10), choices=LookChoices(region=PictureRegion(0, 0, 100, HEIGHT))
    )
    assert left.is_pivot_known
    assert pivot_of(left) == pytest.approx((70.0, -16.0), abs=0.5)


def test_a_told_width_polarity_and_plane_are_kept() -> None:
    choices = LookChoices(width_px=4.0, is_bright=False, plane="green", turns=0)
    assert not choices.is_free
    assert LookChoices(width_px=4.0, at_rest=True).is_free
    found = look(swinging(COUNT), choices=choices)
    assert found.view == PictureView("green", False, 0)
    assert found.cable is not None
    assert found.cable.width_px == 4.0
    assert found.is_pivot_known
