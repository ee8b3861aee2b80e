"""Choice of plane, polarity and turn by the pictures."""

from __future__ import annotations

import numpy as np
import pytest

from tests.vision.swing_pictures import (
    Image,
    cable,
    coloured,
    picture,
    swing,
    swinging,
)
from vision.view import PictureRegion, PictureView
from vision.view_choice import choose_view

CHANNELS = {"blue": 0, "green": 1, "red": 2}
GREY = 150.0
COUNT = 10


def in_colour(plane: str, level: float, ground: float = GREY) -> list[Image]:
    """Pictures of a cable that differs from the ground in one colour, or in all."""
    random = np.random.default_rng(1)
    ink = [ground] * 3
    for name, channel in CHANNELS.items():
        if plane in (name, "grey"):
            ink[channel] = level
    levels = (ink[0], ink[1], ink[2])
    return [coloured(cable(float(a)), random, (ground,) * 3, levels) for a in swing(COUNT)]


def chosen(pictures: list[Image]) -> PictureView:
    return choose_view(pictures, None, None, None, None)


@pytest.mark.parametrize("plane", ["red", "green", "blue", "grey"])
@pytest.mark.parametrize(("level", "is_bright"), [(70.0, False), (230.0, True)])
def test_the_plane_and_the_polarity_in_which_the_cable_differs_are_chosen(
    plane: str, level: float, is_bright: bool
) -> None:
    assert chosen(in_colour(plane, level)) == PictureView(plane, is_bright, 0)


@pytest.mark.parametrize("plane", ["red", "green", "blue"])
def test_a_coloured_cable_on_black_is_bright_in_its_plane(plane: str) -> None:
    assert chosen(in_colour(plane, 200.0, 20.0)) == PictureView(plane, True, 0)


def test_a_picture_turned_by_a_quarter_is_turned_back() -> None:
    pictures = [np.ascontiguousarray(np.rot90(image)) for image in swinging(COUNT)]
    assert chosen(pictures).turns == 1
    assert chosen(swinging(COUNT)).turns == 0


def test_a_faint_line_that_moves_is_preferred_to_a_clear_one_that_does_not() -> None:
    random = np.random.default_rng(2)
    pictures = []
    for angle in swing(COUNT):
        light = GREY + 60.0 * cable(float(angle))
        light[40:43] = 20.0  # lies across
        pictures.append(picture(light, random, 0.0, 1.0))
    assert chosen(pictures) == PictureView("grey", True, 0)
    still = [pictures[0]] * COUNT
    assert chosen(still).turns == 1


def test_what_is_told_is_kept() -> None:
    pictures = in_colour("red", 70.0)
    region = PictureRegion(20, 10, 160, 140)
    assert choose_view(pictures, "red", True, 1, region) == PictureView("red", True, 1, region)
    assert choose_view(pictures, None, None, 0, region) == PictureView("red", False, 0, region)
