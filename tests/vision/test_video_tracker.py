"""Tracker of a video that finds everything by itself, on drawn pictures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.vision.swing_pictures import (
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
)
from vision.first_look import LookChoices, Subject
from vision.fit import Fit, TrackFailure
from vision.video_tracker import VideoTracker
from vision.view import PictureRegion, PictureView

COUNT = 26
ANGLES = 0.25 * np.sin(0.26 * np.arange(COUNT))


def pictures_of(
    covers: list[FloatArray], seed: int, ground: float = WHITE, ink: float = 35.0
) -> list[Image]:
    random = np.random.default_rng(seed)
    return [picture(cover, random, ground, ink) for cover in covers]


def cables(angles: FloatArray, width_px: float = 2.5) -> list[FloatArray]:
    return [cable(float(angle), width_px=width_px) for angle in angles]


def prepared(
    pictures: list[Image],
    told: Point | None = None,
    choices: LookChoices | None = None,
    *,
    keeps_pivot: bool = False,
) -> VideoTracker:
    """Tracker that has seen every other picture."""
    height, width = pictures[0].shape[:2]
    tracker = VideoTracker(width, height, choices, keeps_pivot=keeps_pivot)
    spread = pictures[::2]
    tracker.prepare(spread, [told] * len(spread) if told else None)
    return tracker


def tracked(
    pictures: list[Image], told: Point | None = None, choices: LookChoices | None = None
) -> list[Fit]:
    tracker = prepared(pictures, told, choices)
    return [tracker.measure(image, told) for image in pictures]


def scores(fits: list[Fit], angles: FloatArray) -> FloatArray:
    """Errors over sigmas of the valid angles; none may be wrong by 5 mrad."""
    found = []
    for fit, angle in zip(fits, angles, strict=True):
        assert fit.valid is (fit.angle_rad is not None)
        if fit.angle_rad is None:
            continue
        assert fit.sigma_rad is not None
        error = fit.angle_rad - angle
        assert abs(error) < 5e-3
        found.append(error / fit.sigma_rad)
    return np.array(found)


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize(
    ("ground", "ink", "width_px"),
    [(WHITE, 35.0, 1.2), (40.0, 200.0, 2.5), (WHITE, 35.0, 8.0), (40.0, 200.0, 8.0)],
)
def test_a_cable_is_measured_without_any_choice(ground: float, ink: float, width_px: float) -> None:
    fits = tracked(pictures_of(cables(ANGLES, width_px), 1, ground, ink))
    found = scores(fits, ANGLES)
    assert len(found) == COUNT
    assert 0.55 < rms(found) < 1.5
    assert np.mean([fit.sigma_rad for fit in fits]) < 1e-4


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_a_cable_of_one_colour_is_measured_in_its_plane(channel: int) -> None:
    random = np.random.default_rng(2)
    ink = [150.0, 150.0, 150.0]
    ink[channel] = 60.0
    levels = (150.0, 150.0, 150.0), (ink[0], ink[1], ink[2])
    pictures = [coloured(cover, random, *levels) for cover in cables(ANGLES)]
    tracker = prepared(pictures)
    assert tracker.look is not None
    assert tracker.look.view.plane == ("blue", "green", "red")[channel]
    found = scores([tracker.measure(image, None) for image in pictures], ANGLES)
    assert len(found) == COUNT
    assert 0.55 < rms(found) < 1.5


@pytest.mark.parametrize(("turns", "draw"), [(1, cable), (2, cable), (3, bob)])
def test_turned_pictures_give_the_angles_of_upright_ones(turns: int, draw: type) -> None:
    covers = [draw(float(angle)) for angle in ANGLES]
    pictures = [np.ascontiguousarray(np.rot90(p, turns)) for p in pictures_of(covers, 3)]
    tracker = prepared(pictures)
    assert tracker.height == HEIGHT
    found = scores([tracker.measure(image, None) for image in pictures], ANGLES)
    assert len(found) == COUNT
    assert rms(found) < 2.5  # the error of a bob's pivot is common to all pictures


def test_a_bob_is_measured_without_a_cable() -> None:
    means = []
    for seed in range(4):
        fits = tracked(pictures_of([bob(float(angle)) for angle in ANGLES], seed))
        found = scores(fits, ANGLES)
        assert len(found) == COUNT
        means.append(np.mean(np.square(found)))
    assert 0.4 < math.sqrt(np.mean(means)) < 2.2


@pytest.mark.parametrize(
    ("amplitude_rad", "offset_px", "seed"),
    [(0.25, 0.0, 1), (0.1, 0.0, 4), (0.25, 3.0, 3)],
)
def test_beside_a_static_line_no_angle_is_wrong(
    amplitude_rad: float, offset_px: float, seed: int
) -> None:
    static = cable(0.0, (PIVOT_PX[0] + offset_px, PIVOT_PX[1]))
    angles = amplitude_rad * np.sin(0.26 * np.arange(60))
    covers = [np.maximum(cover, static) for cover in cables(angles)]
    found = scores(tracked(pictures_of(covers, seed)), angles)
    assert len(found) >= 15
    assert 0.5 < rms(found) < 1.6


def test_a_wrong_pivot_is_corrected_unless_it_is_kept() -> None:
    told = (130.0, 0.0)
    pictures = pictures_of(cables(ANGLES), 5)
    tracker = prepared(pictures, told)
    assert tracker.gate_px(told) == pytest.approx(PIVOT_PX, abs=0.1)
    # the correction follows a pivot that moves
    assert tracker.gate_px((137.0, 2.0)) == pytest.approx((107.0, -14.0), abs=0.1)
    assert len(scores([tracker.measure(p, told) for p in pictures], ANGLES)) == COUNT

    keeper = prepared(pictures, told, keeps_pivot=True)
    assert keeper.gate_px(told) == told
    reasons = {keeper.measure(image, told).reason for image in pictures}
    assert TrackFailure.NONE not in reasons
    assert TrackFailure.PIVOT_MISSED in reasons


def test_a_told_pivot_is_converted_to_the_view() -> None:
    pictures = [np.ascontiguousarray(np.rot90(p)) for p in pictures_of(cables(ANGLES), 6)]
    told = (PIVOT_PX[1], WIDTH - 1 - PIVOT_PX[0])  # the right border came to the top
    keeper = prepared(pictures, told, keeps_pivot=True)
    assert keeper.gate_px(told) == pytest.approx(PIVOT_PX, abs=1e-9)
    assert len(scores([keeper.measure(p, told) for p in pictures], ANGLES)) == COUNT


def test_a_told_pivot_of_a_bob_leaves_no_error_of_its_own_in_sigma() -> None:
    pictures = pictures_of([bob(float(angle)) for angle in ANGLES], 7)
    keeper = prepared(pictures, PIVOT_PX, keeps_pivot=True)
    fits = [keeper.measure(image, PIVOT_PX) for image in pictures]
    found = scores(fits, ANGLES)
    assert 0.55 < rms(found) < 1.5
    free = tracked(pictures)
    widest = int(np.abs(ANGLES).argmax())
    told_sigma, free_sigma = fits[widest].sigma_rad, free[widest].sigma_rad
    assert told_sigma is not None
    assert free_sigma is not None
    assert free_sigma > 1.5 * told_sigma


def test_a_line_that_never_moves_is_static_unless_it_hangs_at_rest() -> None:
    pictures = pictures_of(cables(np.full(COUNT, 0.1)), 8)
    assert {fit.reason for fit in tracked(pictures)} == {TrackFailure.STATIC}
    assert {fit.angle_rad for fit in tracked(pictures)} == {None}
    hanging = tracked(pictures, choices=LookChoices(at_rest=True))
    found = scores(hanging, np.full(COUNT, 0.1))
    assert len(found) == COUNT
    assert 0.55 < rms(found) < 1.5


def test_an_empty_picture_is_no_static_line() -> None:
    fits = tracked(pictures_of([0.0 * cover for cover in cables(ANGLES)], 9))
    assert {fit.reason for fit in fits} == {TrackFailure.NO_CABLE}


def test_a_picture_that_comes_again_is_a_duplicate_and_then_frozen() -> None:
    pictures = pictures_of(cables(ANGLES), 10)
    tracker = prepared(pictures)
    shown = [0, 1, 1, 2, 3, 3, 3, 3, 4]
    fits = [tracker.measure(pictures[index], None) for index in shown]
    assert [fit.reason.value for fit in fits] == [
        "none", "none", "duplicate", "none", "none", "duplicate", "frozen", "frozen", "none"
    ]  # fmt: skip
    assert [fit.valid for fit in fits] == [fit.angle_rad is not None for fit in fits]
    assert fits[2].sigma_rad is None


def test_equal_pictures_of_a_cable_at_rest_are_measured() -> None:
    image = pictures_of(cables(ANGLES[:1]), 11)[0]
    tracker = prepared([image] * 12, choices=LookChoices(at_rest=True))
    assert all(tracker.measure(image, None).valid for _ in range(4))
    blank = np.full_like(image, 200)
    assert not any(tracker.measure(blank, None).valid for _ in range(3))


def test_a_refused_picture_that_comes_again_keeps_its_reason() -> None:
    pictures = pictures_of(cables(ANGLES), 12)
    tracker = prepared(pictures)
    blank = np.full_like(pictures[0], 200)
    reasons = [tracker.measure(blank, None).reason for _ in range(3)]
    assert reasons[0] is reasons[1] is reasons[2]
    assert reasons[0] is not TrackFailure.NONE


def test_a_region_hides_what_is_outside_it() -> None:
    angles = 0.3 * ANGLES
    covers = []
    for cover, angle in zip(cables(angles), angles, strict=True):
        covers.append(np.maximum(cover, cable(float(angle), (170.0, -16.0))))
    region = PictureRegion(60, 0, 80, HEIGHT)
    pictures = pictures_of(covers, 13)
    tracker = prepared(pictures, choices=LookChoices(region=region))
    assert tracker.look is not None
    assert tracker.look.view == PictureView(region=region)
    found = scores([tracker.measure(image, None) for image in pictures], angles)
    assert len(found) == COUNT
    assert 0.55 < rms(found) < 1.5
    gate = tracker.gate_px(None)
    assert gate == pytest.approx((PIVOT_PX[0] - 60.0, PIVOT_PX[1]), abs=0.5)


def test_two_cables_without_a_pivot_give_no_wrong_angle() -> None:
    angles = 0.5 * ANGLES
    covers = []
    for angle in angles:
        sides = (cable(float(angle), (70.0, -16.0)), cable(float(angle), (130.0, -16.0)))
        covers.append(np.maximum(*sides))
    scores(tracked(pictures_of(covers, 14)), angles)


def test_a_bob_whose_pivot_is_not_known_is_refused() -> None:
    angles = 0.012 * np.sin(0.26 * np.arange(COUNT))
    pictures = pictures_of([bob(float(a), (100.0, -3000.0), 3080.0) for a in angles], 15)
    tracker = prepared(pictures)
    assert tracker.look is not None
    assert tracker.look.subject is Subject.BOB
    assert not any(tracker.measure(image, None).valid for image in pictures)
    told = tracked(pictures, (100.0, -3000.0))
    found = scores(told, angles)
    assert len(found) == COUNT
    assert 0.55 < rms(found) < 1.5


def test_without_a_first_look_the_red_plane_is_measured_about_the_told_pivot() -> None:
    random = np.random.default_rng(16)
    levels = (150.0, 150.0, 200.0), (150.0, 150.0, 60.0)
    tracker = VideoTracker(WIDTH, HEIGHT)
    assert tracker.height == HEIGHT
    assert tracker.gate_px(PIVOT_PX) == PIVOT_PX
    for angle in ANGLES[:8]:
        fit = tracker.measure(coloured(cable(float(angle)), random, *levels), PIVOT_PX)
        assert fit.angle_rad == pytest.approx(angle, abs=5e-4)
    assert tracker.measure(np.zeros((HEIGHT, WIDTH), np.uint8), None).reason is (
        TrackFailure.NO_CABLE
    )
