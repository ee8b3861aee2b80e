"""Lines of a cable that moves, and the picture without it, on drawn pictures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.vision.swing_pictures import (
    BLUR_PX,
    HEIGHT,
    INK,
    NOISE,
    PIVOT_PX,
    WHITE,
    WIDTH,
    FloatArray,
    Image,
    cable,
    picture,
    swing,
    swinging,
)
from vision.cable_lines import CableLines, cable_lines, median_without, static_scene, swing_of
from vision.line_fit import ImageLine
from vision.static_scene import median_picture
from vision.templates import CableLook


def beside(static: FloatArray, angles: FloatArray, seed: int) -> list[Image]:
    """Pictures of a swinging cable before something that never moves."""
    random = np.random.default_rng(seed)
    return [picture(np.maximum(cable(float(a)), static), random) for a in angles]


def errors_rad(found: CableLines, angles: FloatArray) -> FloatArray:
    """Errors of the lines found, each over its sigma."""
    scores = []
    for item, angle in zip(found.lines, angles, strict=True):
        if item is not None:
            error = item.measured.line.slope - math.tan(angle)
            scores.append(error / item.measured.sigma_slope)
    return np.array(scores)


def line(angle_rad: float) -> ImageLine:
    slope = math.tan(angle_rad)
    return ImageLine(PIVOT_PX[0] - slope * PIVOT_PX[1], slope)


@pytest.mark.parametrize("width_px", [1.2, 2.5, 5.0, 10.0])
def test_a_cable_that_swings_is_measured_with_its_width(width_px: float) -> None:
    angles = swing(16)
    found = cable_lines(swinging(16, 1, width_px=width_px))
    assert found.is_moving
    assert found.cable is not None
    assert found.cable.width_px == pytest.approx(width_px, abs=0.15)
    assert found.cable.blur_px == pytest.approx(BLUR_PX, abs=0.15)
    scores = errors_rad(found, angles)
    assert len(scores) >= 14
    assert 0.5 < np.sqrt(np.mean(np.square(scores))) < 1.6
    low, high = swing_of(found)
    assert (low, high) == pytest.approx((angles.min(), angles.max()), abs=1e-3)


def test_a_told_width_is_kept() -> None:
    found = cable_lines(swinging(12), 4.0)
    assert found.cable is not None
    assert found.cable.width_px == 4.0
    assert found.is_moving


def test_the_median_without_the_cable_is_the_ground() -> None:
    columns = np.arange(WIDTH)
    ground = WHITE - 40.0 * columns / WIDTH
    angles = 0.02 * np.sin(0.9 * np.arange(12))  # always within 4 px: in every plain median
    random = np.random.default_rng(2)
    pictures = []
    for angle in angles:
        shade = cable(float(angle)) * (ground - INK) + WHITE - ground
        pictures.append(picture(shade, random, WHITE, WHITE - 1.0))
    assert np.abs(median_picture(pictures) - ground).max() > 100.0
    lines = [line(float(angle)) for angle in angles]
    median = median_without(pictures, lines, CableLook(2.5, BLUR_PX))
    assert np.abs(median - ground).max() < 6.0 * NOISE


def test_a_cable_that_lingers_is_not_in_the_median_without_it() -> None:
    angles = [0.1] * 7 + [-0.2] * 5
    random = np.random.default_rng(7)
    pictures = [picture(cable(angle), random) for angle in angles]
    for image in pictures:
        image[:, 110:130] //= 2  # seen beside the cable in five pictures
    lines = [line(angle) for angle in angles]
    ground = np.full((HEIGHT, WIDTH), WHITE)
    ground[:, 110:130] *= 0.5
    assert np.abs(median_picture(pictures) - ground).max() > 50.0
    median = median_without(pictures, lines, CableLook(2.5, BLUR_PX))
    assert np.abs(median - ground).max() < 6.0 * NOISE


def test_a_picture_without_a_line_is_no_part_of_the_median() -> None:
    pictures = swinging(12, 3)
    pictures[5] = np.zeros_like(pictures[5])
    lines: list[ImageLine | None] = [line(float(angle)) for angle in swing(12)]
    lines[5] = None
    median = median_without(pictures, lines, CableLook(2.5, BLUR_PX))
    assert np.abs(median - WHITE).max() < 6.0 * NOISE


@pytest.mark.parametrize("offset_px", [0.0, 9.0])
@pytest.mark.parametrize("amplitude_rad", [0.25, 0.1])
def test_a_line_that_never_moves_is_not_the_cable(offset_px: float, amplitude_rad: float) -> None:
    static = cable(0.0, (PIVOT_PX[0] + offset_px, PIVOT_PX[1]))
    angles = amplitude_rad * np.sin(0.26 * np.arange(30))
    found = cable_lines(beside(static, angles, 4))
    assert found.is_moving
    scores = errors_rad(found, angles)
    assert len(scores) >= 9
    assert np.abs(scores).max() < 5.0
    # it is in the picture without the cable down to every row, also where the cable covers it
    across = found.median.astype(float)
    centre = round(PIVOT_PX[0] + offset_px)
    assert (across[:, centre - 1 : centre + 2].max(axis=1) < WHITE - 80.0).all()


def test_a_cable_at_rest_does_not_move() -> None:
    random = np.random.default_rng(5)
    found = cable_lines([picture(cable(0.05), random) for _ in range(12)])
    assert not found.is_moving
    assert found.cable is None
    assert set(found.lines) == {None}


def test_four_pictures_do_not_tell_what_moves() -> None:
    assert cable_lines(swinging(5)).is_moving
    assert not cable_lines(swinging(4)).is_moving


def test_the_noise_of_a_median_of_few_pictures_is_no_structure() -> None:
    random = np.random.default_rng(6)
    noisy = picture(cable(0.0), random, noise=6.0)
    scene = static_scene(noisy, 5)
    rows = np.arange(HEIGHT)
    assert scene.is_free(rows, np.full(HEIGHT, 40.0)).mean() > 0.97
    assert not scene.is_free(rows, np.full(HEIGHT, 103.0)).any()
