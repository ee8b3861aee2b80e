"""Search for lines without a pivot, on drawn pictures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.vision.swing_pictures import HEIGHT, NOISE, WIDTH, Image, cable, picture
from vision.free_lines import FreeLine, find_lines

LARGE = (640, 544)


def line_picture(angle_rad: float, seed: int, width_px: float = 2.5) -> Image:
    cover = cable(angle_rad, (100.0, -16.0), width_px)
    return picture(cover, np.random.default_rng(seed))


def column(angle_rad: float, row: float) -> float:
    return 100.0 + math.tan(angle_rad) * (row + 16.0)


def only(lines: list[FreeLine]) -> FreeLine:
    assert len(lines) == 1
    return lines[0]


@pytest.mark.parametrize("angle_rad", [-0.4, -0.1, 0.0, 0.02, 0.3])
def test_a_line_is_found_without_its_pivot(angle_rad: float) -> None:
    for seed in range(3):
        found = only(find_lines(line_picture(angle_rad, seed), NOISE))
        for row in (20.0, 140.0):
            assert found.line.at(row) == pytest.approx(column(angle_rad, row), abs=0.7)
        assert found.support > 0.9
        assert found.first_row < 12
        assert found.last_row > 145


@pytest.mark.parametrize("width_px", [1.2, 2.5, 6.0, 12.0, 20.0])
def test_a_line_of_any_width_is_found_at_its_middle(width_px: float) -> None:
    cover = cable(0.1, (300.0, -40.0), width_px, LARGE)
    found = only(find_lines(picture(cover, np.random.default_rng(4)), NOISE))
    for row in (50.0, 500.0):
        true = 300.0 + math.tan(0.1) * (row + 40.0)
        assert found.line.at(row) == pytest.approx(true, abs=0.8)
    assert found.support > 0.8


def test_pictures_without_a_line_give_none() -> None:
    random = np.random.default_rng(5)
    columns = np.broadcast_to(np.arange(WIDTH), (HEIGHT, WIDTH))
    empty = np.zeros((HEIGHT, WIDTH))
    step = (columns > 80).astype(float)
    ramp = columns / WIDTH
    bar = (np.abs(columns - 100) < 40).astype(float)
    for cover in (empty, step, ramp, bar):
        for _ in range(5):
            assert find_lines(picture(cover, random), NOISE) == []


def test_a_bright_line_and_a_flat_one_are_no_dark_line() -> None:
    random = np.random.default_rng(6)
    bright = picture(cable(0.1), random, 60.0, 200.0)
    assert find_lines(bright, NOISE) == []
    flat = np.ascontiguousarray(np.rot90(picture(cable(0.3, size=(HEIGHT, WIDTH)), random)))
    assert find_lines(flat, NOISE) == []
    steep = np.ascontiguousarray(np.rot90(flat))
    assert len(find_lines(steep, NOISE)) == 1


def test_the_longer_of_two_lines_comes_first() -> None:
    rows = np.arange(HEIGHT)[:, None]
    long, short = cable(0.1, (60.0, -16.0)), cable(-0.1, (150.0, -16.0)) * (rows < 90)
    image = picture(np.maximum(long, short), np.random.default_rng(7))
    first, second = find_lines(image, NOISE, 2)
    assert first.line.slope == pytest.approx(math.tan(0.1), abs=0.01)
    assert second.line.slope == pytest.approx(math.tan(-0.1), abs=0.01)
    assert first.support == pytest.approx(1.0, abs=0.1)
    assert second.support == pytest.approx(90.0 / HEIGHT, abs=0.1)
    assert second.first_row < 12
    assert second.last_row == pytest.approx(88.0, abs=5.0)
    assert len(find_lines(image, NOISE, 4)) == 2


def test_a_line_on_few_rows_is_none() -> None:
    rows = np.arange(HEIGHT)[:, None]
    short = cable(0.1) * (rows < 0.1 * HEIGHT)
    assert find_lines(picture(short, np.random.default_rng(8)), NOISE) == []
    tall = np.arange(LARGE[1])[:, None]
    for share, count in ((0.12, 0), (0.2, 1)):
        part = cable(0.1, (300.0, -40.0), 2.5, LARGE) * (tall < share * LARGE[1])
        assert len(find_lines(picture(part, np.random.default_rng(8)), NOISE)) == count


def test_the_strength_is_the_contrast_of_the_line() -> None:
    cover = cable(0.05)
    strengths = []
    for ink in (140.0, 80.0):
        found = find_lines(picture(cover, np.random.default_rng(9), 200.0, ink), NOISE)
        strengths.append(only(found).strength)
    # of 60 and of 120 levels; 2.5 px wide, over 3 px
    assert strengths[1] / strengths[0] == pytest.approx(2.0, rel=0.1)
    assert 0.5 * 120.0 < strengths[1] < 120.0


def test_what_moved_must_be_dark_in_the_picture_itself() -> None:
    random = np.random.default_rng(10)
    moved = picture(cable(0.1), random)
    lit = picture(0.0 * cable(0.1), random)  # nothing dark is there
    assert len(find_lines(moved, NOISE, own=moved)) == 1
    assert find_lines(moved, NOISE, own=lit) == []
    assert find_lines(moved, NOISE, own=picture(cable(-0.3), random)) == []
