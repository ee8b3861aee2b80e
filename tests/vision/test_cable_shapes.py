"""Tracker on cables of any width and shape, and beside lines that never move."""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ndtr

from vision.knee import find_knee
from vision.line_fit import correlation_factor, local_noise
from vision.profile_look import measure_look
from vision.static_scene import StaticScene, median_picture
from vision.templates import CableLook, make_templates
from vision.tracker import Fit, Tracker, TrackFailure

FloatArray = NDArray[np.float64]
Grey = NDArray[np.uint8]
WIDTH, HEIGHT = 640, 480
PIVOT_PX = (320.0, -40.0)
ROWS = np.arange(float(HEIGHT))
NOISE = 2.5
BACKGROUND, CONTRAST, BLUR_PX = 200.0, 165.0, 0.85


def dark(columns: FloatArray, slope: FloatArray | float, width_px: float) -> FloatArray:
    """Share of each pixel that a line with these columns on the rows covers."""
    cos = 1.0 / np.hypot(1.0, np.broadcast_to(slope, columns.shape))[:, None]
    d = (np.arange(WIDTH) - columns[:, None]) * cos
    half = 0.5 * width_px
    return np.asarray(ndtr((d + half) / BLUR_PX) - ndtr((d - half) / BLUR_PX))


def picture(cover: FloatArray, random: np.random.Generator, noise: float = NOISE) -> Grey:
    level = BACKGROUND - CONTRAST * cover + noise * random.standard_normal(cover.shape)
    return np.clip(np.rint(level), 0, 255).astype(np.uint8)


def straight(angle_rad: float, offset_px: float = 0.0) -> FloatArray:
    return PIVOT_PX[0] + offset_px + math.tan(angle_rad) * (ROWS - PIVOT_PX[1])


def measured(fit: Fit) -> tuple[float, float]:
    assert fit.valid, fit.reason
    assert fit.angle_rad is not None
    assert fit.sigma_rad is not None
    return fit.angle_rad, fit.sigma_rad


def bound_rad(angle_rad: float, width_px: float) -> float:
    """Cramer-Rao bound of the angle: Gaussian profile edges, rows independent, place unknown."""
    information = (
        CONTRAST**2
        / (math.sqrt(math.pi) * BLUR_PX * (NOISE**2 + 1.0 / 12.0))
        * (1.0 - math.exp(-((width_px / (2.0 * BLUR_PX)) ** 2)))
    )
    length_px = HEIGHT / math.cos(angle_rad)
    return math.sqrt(12.0 / (information * length_px**3))


@pytest.mark.parametrize("width_px", [1.2, 2.5, 4.0, 8.0, 12.0, 20.0])
def test_a_cable_of_any_width_is_measured_at_the_cramer_rao_bound(width_px: float) -> None:
    random = np.random.default_rng(1)
    tracker = Tracker(WIDTH, HEIGHT)
    errors, sigmas = [], []
    for angle in 0.2 * np.sin(0.05 * np.arange(80)):
        image = picture(dark(straight(angle), math.tan(angle), width_px), random)
        found, sigma = measured(tracker.measure(image, PIVOT_PX))
        errors.append(found - angle)
        sigmas.append(sigma)
    ratio = np.std(errors) / bound_rad(0.1, width_px)
    assert 0.75 < ratio < 1.3  # 8 % by chance
    assert np.std(errors) == pytest.approx(np.mean(sigmas), rel=0.3)
    assert tracker.look.width_px == pytest.approx(width_px, abs=0.8)


def test_width_and_blur_are_those_of_the_profile() -> None:
    random = np.random.default_rng(2)
    columns = straight(0.15)
    image = picture(dark(columns, math.tan(0.15), 6.0), random)
    look = measure_look(image, ROWS, columns, math.tan(0.15), CableLook(10.0, 2.0))
    assert look is not None
    assert look.width_px == pytest.approx(6.0, abs=0.1)
    assert look.blur_px == pytest.approx(BLUR_PX, abs=0.1)


def test_a_picture_without_a_line_has_no_width() -> None:
    image = picture(np.zeros((HEIGHT, WIDTH)), np.random.default_rng(3))
    assert measure_look(image, ROWS, straight(0.1), 0.1, CableLook()) is None


@pytest.mark.parametrize("look", [CableLook(), CableLook(12.0, 0.85), CableLook(1.0, 3.0)])
def test_a_template_is_blind_to_the_level_and_finds_its_own_profile(look: CableLook) -> None:
    templates = make_templates(look)
    assert np.abs(templates.pairs.sum(axis=2)).max() < 1e-5
    x = np.arange(-templates.half_px, templates.half_px + 1.0)
    blur_px = max(look.blur_px, 1.0)
    half = 0.5 * look.width_px
    profile = ndtr((x + half) / blur_px) - ndtr((x - half) / blur_px)
    first, second = templates.pairs[len(templates.pairs) // 2] @ -profile
    assert abs(first) < 1e-5
    assert second > 0.0


def fit_of(columns: FloatArray, seed: int, **known: float) -> Fit:
    """Measure one picture of a cable with these columns."""
    slope = np.gradient(columns)
    image = picture(dark(columns, slope, 2.5), np.random.default_rng(seed))
    return Tracker(WIDTH, HEIGHT).measure(image, PIVOT_PX)


@pytest.mark.parametrize("bend_px", [-6.0, -1.5, 0.5, 3.0])
def test_the_angle_of_a_bent_cable_is_that_of_the_line_that_fits_it_best(bend_px: float) -> None:
    t = (ROWS - 239.5) / 239.5
    columns = straight(0.1) + bend_px * (1.0 - t * t) - bend_px * 0.7
    expected = math.atan(np.polyfit(ROWS, columns, 1)[0])
    fits = [fit_of(columns, seed) for seed in range(12)]
    errors = [measured(fit)[0] - expected for fit in fits]
    assert np.sqrt(np.mean(np.square(errors))) < 2e-5
    assert np.mean([fit.bend_px for fit in fits]) == pytest.approx(bend_px, abs=0.02)


def test_a_straight_cable_has_no_bend() -> None:
    fits = [fit_of(straight(0.12), seed) for seed in range(20)]
    assert sum(fit.bend_px == 0.0 for fit in fits) >= 18
    assert all(fit.lower is None for fit in fits)


@pytest.mark.parametrize(("upper", "lower"), [(0.1, 0.2), (-0.05, 0.03), (0.15, 0.05)])
def test_two_links_give_both_angles_and_their_joint(upper: float, lower: float) -> None:
    joint_row = 250.3
    columns = straight(upper)
    columns += (math.tan(lower) - math.tan(upper)) * np.maximum(ROWS - joint_row, 0.0)
    scores = []
    for seed in range(10):
        fit = fit_of(columns, seed)
        angle, sigma = measured(fit)
        assert fit.lower is not None
        scores.append((angle - upper) / sigma)
        scores.append((fit.lower.angle_rad - lower) / fit.lower.sigma_rad)
        assert fit.lower.joint_px[1] == pytest.approx(joint_row, abs=2.0)
        assert fit.last_row <= joint_row + 2.0
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.0, abs=0.6)


def test_two_links_are_followed_through_the_instant_when_they_align() -> None:
    random = np.random.default_rng(5)
    tracker = Tracker(WIDTH, HEIGHT)
    errors = []
    for change in np.linspace(0.12, -0.12, 25):
        columns = straight(0.05) + change * np.maximum(ROWS - 260.0, 0.0)
        image = picture(dark(columns, np.gradient(columns), 2.5), random)
        errors.append(measured(tracker.measure(image, PIVOT_PX))[0] - 0.05)
    assert np.abs(errors).max() < 3e-4


def test_the_joint_is_found_where_the_slope_changes() -> None:
    rows = np.arange(0.0, 480.0, 4.0)
    columns = 300.0 + 0.1 * rows - 0.05 * np.maximum(rows - 201.0, 0.0)
    knee = find_knee(rows, columns)
    assert knee is not None
    assert knee.row == pytest.approx(201.0, abs=2.0)
    assert knee.change == pytest.approx(-0.05, abs=1e-3)
    assert find_knee(rows[:8], columns[:8]) is None


def test_correlated_rows_raise_sigma_as_much_as_they_raise_the_error() -> None:
    random = np.random.default_rng(6)
    tracker = Tracker(WIDTH, HEIGHT)
    scores = []
    for angle in 0.2 * np.sin(0.05 * np.arange(120)):
        noise = cv2.GaussianBlur(random.standard_normal((HEIGHT, WIDTH)), (0, 0), 1.5)
        cover = dark(straight(angle), math.tan(angle), 2.5)
        level = BACKGROUND - CONTRAST * cover + 20.0 * noise
        image = np.clip(np.rint(level), 0, 255).astype(np.uint8)
        found, sigma = measured(tracker.measure(image, PIVOT_PX))
        scores.append((found - angle) / sigma)
    assert 0.75 < np.sqrt(np.mean(np.square(scores[20:]))) < 1.35


def test_the_correlation_factor_of_a_moving_average_is_its_length() -> None:
    random = np.random.default_rng(7)
    white = random.standard_normal(48_000)
    averaged = np.convolve(white, np.ones(4) / 4.0, mode="same")
    assert correlation_factor(white) == pytest.approx(1.0, rel=0.1)
    # less by what the ends of blocks of 16 rows lose
    assert correlation_factor(averaged) == pytest.approx(4.0, rel=0.15)


def test_local_noise_does_not_see_a_smooth_curve() -> None:
    random = np.random.default_rng(8)
    rows = np.arange(480)
    curve = 0.3 * np.sin(2.0 * np.pi * rows / 480.0)
    noise_px, factor = local_noise(curve + 0.02 * random.standard_normal(480))
    # without it the deviation would be 0.21 px
    assert noise_px == pytest.approx(0.02, rel=0.35)
    assert factor < 3.0


# lines that never move

Cover = Callable[[float], FloatArray]


def beside_plumb_line(angle_rad: float, offset_px: float = 0.0) -> FloatArray:
    cable = dark(straight(angle_rad), math.tan(angle_rad), 2.5)
    plumb = dark(straight(0.0, offset_px), 0.0, 2.5)
    return np.maximum(cable, plumb)


def swing_pictures(offset_px: float) -> list[tuple[float, Grey]]:
    random = np.random.default_rng(9)
    angles = 0.2 * np.sin(0.26 * np.arange(30))
    return [(a, picture(beside_plumb_line(a, offset_px), random)) for a in angles]


@pytest.mark.parametrize("offset_px", [0.0, 3.0, 12.0])
def test_beside_a_static_line_no_angle_is_wrong_and_a_scene_makes_it_measured(
    offset_px: float,
) -> None:
    shown = swing_pictures(offset_px)
    reach = make_templates(CableLook()).half_px
    scene = StaticScene(median_picture([image for _, image in shown[::2]]), reach)
    for static, least in ((None, 0), (scene, 20)):
        tracker = Tracker(WIDTH, HEIGHT, static=static)
        fits = [(a, tracker.measure(image, PIVOT_PX)) for a, image in shown]
        given = [(a, fit.angle_rad) for a, fit in fits if fit.angle_rad is not None]
        assert len(given) >= least
        # alone, a line within 8 px is not told apart before it has been seen beside the cable
        if static is not None or offset_px != 3.0:
            assert all(abs(found - angle) < 5e-3 for angle, found in given)


def test_a_static_line_alone_is_no_cable() -> None:
    random = np.random.default_rng(10)
    images = [picture(dark(straight(0.0), 0.0, 2.5), random) for _ in range(10)]
    scene = StaticScene(median_picture(images), make_templates(CableLook()).half_px)
    tracker = Tracker(WIDTH, HEIGHT, static=scene)
    assert not any(tracker.measure(image, PIVOT_PX).valid for image in images)


def test_a_rival_is_remembered_while_it_hides_behind_the_cable() -> None:
    random = np.random.default_rng(11)
    tracker = Tracker(WIDTH, HEIGHT)
    apart = picture(beside_plumb_line(0.1), random)
    together = picture(beside_plumb_line(0.001), random)
    assert tracker.measure(apart, PIVOT_PX).reason is TrackFailure.AMBIGUOUS
    assert tracker.measure(together, PIVOT_PX).reason is TrackFailure.AMBIGUOUS
