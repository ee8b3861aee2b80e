"""Blob, first look at a bob without a cable, and its tracker, on drawn pictures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.vision.swing_pictures import (
    HEIGHT,
    NOISE,
    PIVOT_PX,
    WHITE,
    WIDTH,
    FloatArray,
    Image,
    Point,
    bob,
    cable,
    coloured,
    disc,
    picture,
    swing,
)
from vision.blob import Blob, find_blob
from vision.bob import BobTracker
from vision.bob_look import BobLook, look_for_bob
from vision.fit import TrackFailure

GROUND = np.full((HEIGHT, WIDTH), round(WHITE), np.uint8)
LENGTH_PX = 120.0
COUNT = 16


def blob_in(cover: FloatArray, random: np.random.Generator) -> Blob:
    found = find_blob(GROUND, picture(cover, random), NOISE)
    assert found is not None
    return found


def test_the_centroid_of_a_blob_is_measured_with_the_sigma_that_it_states() -> None:
    random = np.random.default_rng(1)
    scores = []
    for _ in range(120):
        centre = random.uniform(60.0, 100.0, 2)
        found = blob_in(disc((centre[0], centre[1]), 9.0), random)
        scores.append(np.subtract((found.u, found.v), centre) / found.sigma_px)
    rms = np.sqrt(np.mean(np.square(scores), axis=0))
    assert ((rms > 0.8) & (rms < 1.3)).all()
    assert max(found.sigma_px) < 0.02
    assert found.area_px == pytest.approx(math.pi * 9.0**2, rel=0.12)
    assert found.contrast == pytest.approx(165.0, abs=5.0)
    assert found.rows == pytest.approx(19, abs=2)


def test_the_cable_of_a_bob_does_not_pull_its_centroid() -> None:
    random = np.random.default_rng(2)
    cover = np.maximum(disc((90.0, 100.0), 12.0), cable(0.0, (90.0, -16.0)))
    found = blob_in(cover, random)
    assert found.u == pytest.approx(90.0, abs=0.05)
    # what is left of the cable: 2.5 px times some rows above the edge of 450 px
    assert found.v == pytest.approx(100.0, abs=0.6)


def test_a_blob_at_the_border_is_marked() -> None:
    random = np.random.default_rng(3)
    assert not blob_in(disc((100.0, 80.0), 9.0), random).touches_border
    for centre in ((5.0, 80.0), (WIDTH - 6.0, 80.0), (100.0, 4.0), (100.0, HEIGHT - 6.0)):
        assert blob_in(disc(centre, 9.0), random).touches_border


def test_noise_a_bright_blob_a_thin_line_and_a_speck_are_no_blob() -> None:
    random = np.random.default_rng(4)
    empty = picture(0.0 * GROUND, random)
    bright = picture(disc((100.0, 80.0), 9.0), random, WHITE, 250.0)
    line = picture(cable(0.1), random)
    speck = picture(disc((100.0, 80.0), 2.0), random)
    for image in (empty, bright, line, speck):
        assert find_blob(GROUND, image, NOISE) is None


def bobs(
    angles: FloatArray, seed: int, ground: float = WHITE, ink: float = 35.0, turns: int = 0
) -> list[Image]:
    random = np.random.default_rng(seed)
    pictures = [picture(bob(float(angle)), random, ground, ink) for angle in angles]
    return [np.ascontiguousarray(np.rot90(image, turns)) for image in pictures]


def looked(pictures: list[Image], moves: list[Point] | None = None) -> BobLook | None:
    moves = moves or [(0.0, 0.0)] * len(pictures)
    return look_for_bob(pictures, moves, None, None, None, None)


def seen(pictures: list[Image], moves: list[Point] | None = None) -> BobLook:
    found = looked(pictures, moves)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("ground", "ink", "is_bright"), [(WHITE, 35.0, False), (40.0, 200.0, True)]
)
@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_a_bob_is_found_with_its_pivot_whatever_is_up(
    ground: float, ink: float, is_bright: bool, turns: int
) -> None:
    found = seen(bobs(swing(COUNT), 5, ground, ink, turns))
    assert found.view.is_bright is is_bright
    assert (found.view.turns + turns) % 4 == 0
    assert found.circle.centre_px[0] == pytest.approx(PIVOT_PX[0], abs=0.1)
    assert found.circle.centre_px[1] == pytest.approx(PIVOT_PX[1], abs=1.2)
    # the radius is that of the row of the pivot, as the arc does not tell them apart
    lowest = found.circle.centre_px[1] + found.circle.radius_px
    assert lowest == pytest.approx(PIVOT_PX[1] + LENGTH_PX, abs=0.05)
    assert found.area_px == pytest.approx(math.pi * 9.0**2, rel=0.12)
    level = 255.0 - ground if is_bright else ground
    assert np.abs(found.ground - level).max() < 6.0 * NOISE


def test_the_errors_of_the_pivot_of_a_bob_are_those_that_it_states() -> None:
    random = np.random.default_rng(6)
    scores = []
    for seed in range(10):
        angles = 0.25 * np.sin(random.uniform(0.0, 6.0, COUNT))
        circle = seen(bobs(angles, seed)).circle
        scores.append(np.subtract(circle.centre_px, PIVOT_PX) / circle.sigma_centre_px)
    rms = np.sqrt(np.mean(np.square(scores), axis=0))
    # the noise of the ground, common to pictures in which the bob is near, adds a third
    assert ((rms > 0.6) & (rms < 2.2)).all()


def test_a_bob_that_lingers_is_not_in_its_ground() -> None:
    angles = np.where(np.arange(COUNT) % 4 == 0, 0.25 * np.sin(np.arange(COUNT)), 0.1)
    found = seen(bobs(angles, 7))
    assert not found.view.is_bright
    assert np.abs(found.ground - WHITE).max() < 8.0 * NOISE


def test_a_bob_of_one_colour_is_found_in_its_plane() -> None:
    random = np.random.default_rng(8)
    levels = (150.0, 150.0, 150.0), (150.0, 60.0, 150.0)
    found = seen([coloured(bob(float(a)), random, *levels) for a in swing(COUNT)])
    assert found.view.plane == "green"


def test_the_motion_of_the_pivot_is_taken_off_in_the_picture() -> None:
    random = np.random.default_rng(9)
    moves = [(1.5 * k, -0.5 * k) for k in range(COUNT)]
    pictures = []
    for (x, y), angle in zip(moves, swing(COUNT), strict=True):
        pivot = (PIVOT_PX[0] + x - 10.0, PIVOT_PX[1] + y)
        pictures.append(picture(bob(float(angle), pivot), random))
    found = seen(pictures, moves)
    assert found.circle.centre_px[0] == pytest.approx(PIVOT_PX[0] - 10.0, abs=0.15)
    assert found.circle.centre_px[1] == pytest.approx(PIVOT_PX[1], abs=1.5)
    assert looked(pictures) is None  # on no circle


def test_what_does_not_swing_is_no_bob() -> None:
    random = np.random.default_rng(10)
    places = random.uniform(30.0, 130.0, (COUNT, 2))
    jumping = [picture(disc((x, y), 9.0), random) for x, y in places]
    growing = [
        picture(bob(float(a), radius_px=6.0 + 0.6 * k), random) for k, a in enumerate(swing(COUNT))
    ]
    still = bobs(np.full(COUNT, 0.1), 11)
    for pictures in (jumping, growing, still):
        assert looked(pictures) is None
    assert looked(bobs(swing(4), 12)) is None  # too few


def test_a_load_that_moves_straight_on_is_no_pendulum() -> None:
    random = np.random.default_rng(18)
    pictures = [picture(disc((60.0 + 4.0 * k, 80.0), 9.0), random) for k in range(COUNT)]
    assert looked(pictures) is None


def test_a_load_wider_than_its_way_is_seen_whole() -> None:
    random = np.random.default_rng(19)
    angles = 0.2 * np.cos(np.linspace(0.0, 12.0, COUNT))
    centres = [(80.0 + 80.0 * math.sin(a), 80.0 * math.cos(a)) for a in angles]
    found = seen([picture(disc(centre, 24.0), random) for centre in centres])
    assert found.area_px == pytest.approx(math.pi * 24.0**2, rel=0.1)
    assert found.circle.centre_px[0] == pytest.approx(80.0, abs=0.5)
    assert abs(found.circle.centre_px[1]) < 4.0 * found.circle.sigma_centre_px[1] + 2.0


def test_a_told_polarity_of_the_other_sign_finds_nothing() -> None:
    pictures = bobs(swing(COUNT), 13)
    moves = [(0.0, 0.0)] * COUNT
    assert look_for_bob(pictures, moves, None, True, None, None) is None
    assert look_for_bob(pictures, moves, None, False, None, None) is not None


@pytest.fixture(scope="module")
def look() -> BobLook:
    return seen(bobs(swing(24), 14))


def test_the_angle_of_a_bob_has_the_sigma_that_it_states(look: BobLook) -> None:
    told = BobTracker(look, is_pivot_told=True)
    scores = []
    for angle, image in zip(swing(40), bobs(swing(40), 15), strict=True):
        fit = told.measure(image, PIVOT_PX)
        assert fit.angle_rad is not None
        assert fit.sigma_rad is not None
        scores.append((fit.angle_rad - angle) / fit.sigma_rad)
        assert fit.pivot_miss_px == pytest.approx(0.0, abs=1.5)
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.3


def test_the_accuracy_of_a_pivot_that_was_found_is_in_sigma() -> None:
    scores = []
    for seed in range(6):
        # a swing to one side, where errors of row and column of the pivot go together
        angles = 0.15 + 0.1 * np.sin(0.26 * np.arange(30))
        pictures = bobs(angles, 20 + seed)
        found = seen(pictures)
        tracker = BobTracker(found)
        for angle, image in zip(angles[::3], pictures[::3], strict=True):
            fit = tracker.measure(image, found.circle.centre_px)
            assert fit.angle_rad is not None
            assert fit.sigma_rad is not None
            scores.append((fit.angle_rad - angle) / fit.sigma_rad)
    assert 0.5 < np.sqrt(np.mean(np.square(scores))) < 2.6


@pytest.mark.parametrize("correlation", [1.0, 0.0, -1.0])
def test_errors_of_row_and_column_of_the_pivot_add_with_their_sign(
    look: BobLook, correlation: float
) -> None:
    circle = look.circle._replace(sigma_centre_px=(0.5, 0.5), correlation=correlation)
    tracker = BobTracker(look._replace(circle=circle))
    random = np.random.default_rng(21)
    for angle in (-0.3, 0.3):
        fit = tracker.measure(picture(bob(angle), random), PIVOT_PX)
        # of the component across the line from the pivot
        variance = 0.25 * (1.0 - correlation * math.sin(2.0 * angle))
        assert fit.sigma_rad == pytest.approx(math.sqrt(variance) / LENGTH_PX, rel=1e-2)


def test_the_accuracy_of_the_pivot_turns_with_the_picture() -> None:
    angles = 0.2 + 0.12 * np.sin(0.9 * np.arange(COUNT))
    upright = seen(bobs(angles, 22)).circle
    assert abs(upright.correlation) > 0.5
    for turns in (1, 2, 3):
        circle = seen(bobs(angles, 22, turns=turns)).circle
        assert circle.correlation == pytest.approx(upright.correlation, abs=0.05)
        assert circle.sigma_centre_px == pytest.approx(upright.sigma_centre_px, rel=0.4)


def test_a_bob_that_is_not_measured_has_its_reason(look: BobLook) -> None:
    random = np.random.default_rng(16)
    tracker = BobTracker(look)

    def reason(cover: FloatArray) -> TrackFailure:
        fit = tracker.measure(picture(cover, random), PIVOT_PX)
        assert fit.valid is (fit.angle_rad is not None)
        assert fit.valid is (fit.sigma_rad is not None)
        return fit.reason

    assert reason(bob(0.1)) is TrackFailure.NONE
    assert reason(0.0 * bob(0.1)) is TrackFailure.NO_CABLE
    assert reason(bob(0.1, radius_px=14.0)) is TrackFailure.POOR_FIT
    assert reason(bob(0.1, radius_px=6.0)) is TrackFailure.POOR_FIT
    assert reason(bob(0.83)) is TrackFailure.POOR_FIT  # cut by the border
    assert reason(bob(0.1, length_px=112.0)) is TrackFailure.PIVOT_MISSED
    assert tracker.measure(GROUND[1:], PIVOT_PX).reason is TrackFailure.BAD_IMAGE


def test_a_short_swing_is_measured_about_a_told_pivot() -> None:
    angles = 0.02 * np.sin(0.26 * np.arange(30))
    pictures = bobs(angles, 19)
    found = seen(pictures)
    assert found.circle.sigma_radius_px > 10.0
    tracker = BobTracker(found, is_pivot_told=True)
    for angle, image in zip(angles, pictures, strict=True):
        fit = tracker.measure(image, PIVOT_PX)
        assert fit.angle_rad == pytest.approx(angle, abs=5e-4)


def test_a_bob_above_sixty_degrees_is_refused(look: BobLook) -> None:
    tracker = BobTracker(look)
    image = picture(bob(1.1, (60.0, 40.0)), np.random.default_rng(17))
    fit = tracker.measure(image, (60.0, 40.0))
    assert fit.reason is TrackFailure.PIVOT_MISSED
    assert fit.pivot_miss_px == pytest.approx(0.0, abs=1.5)
