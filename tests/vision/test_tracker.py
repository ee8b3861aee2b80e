"""Tracker on images with an exact angle: error, standard deviation, and rejection of bad images."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from tests.vision.rendered_cable import (
    HEIGHT,
    PIVOT_PX,
    WIDTH,
    Camera,
    FloatArray,
    Grey,
    Scene,
    stripe,
)
from vision.errors import VisionError
from vision.line_fit import (
    RowOffsets,
    coarse_line,
    huber_fit,
    huber_line,
)
from vision.ridge import search
from vision.row_offsets import row_offsets
from vision.tracker import Fit, Tracker, TrackFailure

MRAD = 1e-3
WRONG_RAD = 5 * MRAD

Change = Callable[[FloatArray, Scene, np.random.Generator], FloatArray]


@pytest.fixture
def camera() -> Camera:
    """A camera with the same noise for every test, in any order."""
    return Camera(seed=1)


def cold(image: Grey, pivot_px: tuple[float, float] = PIVOT_PX) -> Fit:
    """Measure an image without a prediction."""
    return Tracker(WIDTH, HEIGHT).measure(image, pivot_px)


def error_rad(fit: Fit, truth_rad: float) -> float:
    assert fit.angle_rad is not None, fit.reason
    return fit.angle_rad - truth_rad


def errors_rad(
    camera: Camera,
    angles_rad: Iterable[float],
    pivot_px: tuple[float, float] = PIVOT_PX,
    **scene: float,
) -> FloatArray:
    images = ((camera.expose(Scene(angle_rad=a, **scene).light()), a) for a in angles_rad)  # type: ignore[arg-type]
    return np.array([error_rad(cold(image, pivot_px), a) for image, a in images])


def test_over_20_degrees_each_way_the_angle_is_as_exact_as_the_noise_allows(camera: Camera) -> None:
    errors = errors_rad(camera, np.radians(np.linspace(-20.0, 20.0, 100)))
    assert np.std(errors) < 0.016 * MRAD  # Cramer-Rao with a free intercept: 0.0105 mrad
    assert abs(np.mean(errors)) < 0.005 * MRAD


def test_within_10_mrad_the_angle_is_linear_and_never_off_by_a_tenth_of_a_milliradian(
    camera: Camera,
) -> None:
    angles = np.linspace(-10.0, 10.0, 200) * MRAD
    errors = errors_rad(camera, angles)
    assert np.abs(errors).max() < 0.1 * MRAD
    assert abs(np.polyfit(angles, errors, 1)[0]) < 2e-3


@pytest.mark.parametrize("width_px", [2.0, 2.5, 3.0])
@pytest.mark.parametrize("psf_px", [0.7, 1.0])
def test_the_angle_is_not_biased_towards_whole_pixels(width_px: float, psf_px: float) -> None:
    angles = np.linspace(-3.0, 3.0, 25) * MRAD
    errors = errors_rad(Camera(seed=2, noise=0.0), angles, width_px=width_px, psf_px=psf_px)
    assert np.abs(errors).max() < 0.005 * MRAD


@pytest.mark.parametrize("scene", [{}, {"contrast": 35.0, "background": 90.0}, {"psf_px": 2.5}])
def test_sigma_is_the_scatter_of_the_angle(camera: Camera, scene: dict[str, float]) -> None:
    light = Scene(angle_rad=0.1, **scene).light()  # type: ignore[arg-type]
    fits = [cold(camera.expose(light)) for _ in range(80)]
    scatter = np.std([error_rad(fit, 0.1) for fit in fits])
    assert scatter == pytest.approx(np.mean([fit.sigma_rad or math.nan for fit in fits]), rel=0.25)


def test_a_swing_is_followed_as_exactly_as_single_pictures_are_measured(camera: Camera) -> None:
    tracker = Tracker(WIDTH, HEIGHT)
    swing = 0.3 * np.sin(3.2 * 0.02 * np.arange(100))  # 0.96 rad/s at 50 Hz
    errors = [
        error_rad(tracker.measure(camera.expose(Scene(angle_rad=a).light()), PIVOT_PX), a)
        for a in swing
    ]
    assert np.std(errors) < 0.016 * MRAD


def test_the_cable_is_followed_while_platform_and_cable_move_during_the_exposure(
    camera: Camera,
) -> None:
    tracker, errors = Tracker(WIDTH, HEIGHT), []
    for k in range(30):
        angle, pivot = 0.1 * math.sin(0.064 * k), (250.0 + 2.5 * k, -40.0)
        scene = Scene(
            angle_rad=angle, pivot_px=pivot, turn_rad=0.0032 * math.cos(0.064 * k), shift_px=1.25
        )
        errors.append(error_rad(tracker.measure(camera.expose(scene.light()), pivot), angle))
    assert np.abs(errors).max() < 0.1 * MRAD


def test_without_noise_the_line_meets_the_pivot() -> None:
    camera = Camera(seed=2, noise=0.0)
    for angle in np.radians(np.linspace(-20.0, 20.0, 9)):
        fit = cold(camera.expose(Scene(angle_rad=float(angle)).light()))
        assert fit.pivot_miss_px == pytest.approx(0.0, abs=0.005)


def test_outlier_rows_hardly_change_the_line_and_its_sigma() -> None:
    rng, v = np.random.default_rng(3), np.arange(480.0)
    offset = 0.1 + 2e-4 * v + 0.03 * rng.standard_normal(480)
    curvature = np.full(480, 50.0)
    clean = huber_line(v, RowOffsets(offset, curvature))
    offset[400:440] += 0.5
    fit = huber_line(v, RowOffsets(offset, curvature))
    assert fit.shift + 240.0 * fit.slope == pytest.approx(0.1 + 2e-4 * 240.0, abs=0.02)
    assert fit.slope == pytest.approx(clean.slope, abs=1.2e-4)  # least squares: 3.9e-4
    # with those rows: 16 times
    assert fit.variance_slope == pytest.approx(clean.variance_slope, rel=0.6)
    assert fit.rows == pytest.approx(440, abs=10)


def test_a_fit_over_any_basis_is_that_of_a_line_for_the_basis_of_a_line() -> None:
    rng, t = np.random.default_rng(4), np.linspace(-1.0, 1.0, 300)
    offsets = RowOffsets(0.2 + 0.3 * t + 0.05 * rng.standard_normal(300), rng.uniform(40, 60, 300))
    line, same = huber_line(t, offsets), huber_fit(np.stack([np.ones(300), t]), offsets)
    assert (same.shift, same.slope) == pytest.approx((line.shift, line.slope), rel=1e-9)
    assert same.variance_slope == pytest.approx(line.variance_slope, rel=1e-6)
    assert (same.rows, same.scatter_px) == (line.rows, pytest.approx(line.scatter_px))


def counted(monkeypatch: pytest.MonkeyPatch, name: str, function: Callable[..., Any]) -> list[int]:
    """Calls of a function that the tracker uses, one entry each."""
    calls: list[int] = []

    def count(*arguments: Any) -> Any:
        calls.append(1)
        return function(*arguments)

    monkeypatch.setattr(f"vision.{name}", count)
    return calls


@pytest.mark.parametrize("following", [True, False])
def test_one_newton_step_a_picture_is_enough(
    camera: Camera, monkeypatch: pytest.MonkeyPatch, following: bool
) -> None:
    tracker = Tracker(WIDTH, HEIGHT)
    steps = counted(monkeypatch, "axis_fitter.row_offsets", row_offsets)
    searches, strips = (
        counted(monkeypatch, "finder.search", search),
        counted(monkeypatch, "finder.coarse_line", coarse_line),
    )
    for k in range(43):
        if k == 3:  # three angles are known
            del steps[:], searches[:], strips[:]
        if not following:
            tracker.forget()
        assert tracker.measure(
            camera.expose(Scene(angle_rad=0.3 * math.sin(0.064 * k)).light()), PIVOT_PX
        ).valid
    assert len(steps) <= 42  # of 40 pictures
    assert len(searches) == (0 if following else 40)
    assert not strips


def test_a_jump_misses_the_prediction_in_two_pictures_only(
    camera: Camera, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracker, searches = Tracker(WIDTH, HEIGHT), counted(monkeypatch, "finder.search", search)
    for k, angle in enumerate([0.0, 0.0, 0.0, *[0.02] * 5]):
        if k == 3:
            del searches[:]
        assert tracker.measure(camera.expose(Scene(angle_rad=angle).light()), PIVOT_PX).valid
    assert len(searches) == 2  # the extrapolated velocity is wrong in the second


def test_the_angle_does_not_depend_on_the_prediction(camera: Camera) -> None:
    for angle in np.radians([-17.0, 0.0, 3.0]):
        image = camera.expose(Scene(angle_rad=angle).light())
        tracker, predictions = Tracker(WIDTH, HEIGHT), angle + np.linspace(-20.0, 20.0, 81) * MRAD
        found = [error_rad(tracker.measure(image, PIVOT_PX, float(p)), angle) for p in predictions]
        assert np.ptp(found) < 0.005 * MRAD


@pytest.mark.parametrize("jump_rad", [1 * MRAD, 5 * MRAD, 20 * MRAD, 60 * MRAD, 200 * MRAD])
def test_a_cable_that_jumps_between_two_pictures_is_measured_at_its_new_angle(
    camera: Camera, jump_rad: float
) -> None:
    for start in (-0.2, 0.01):
        tracker = Tracker(WIDTH, HEIGHT)
        angles = [
            start,
            start + 0.01,
            start + 0.02,
            start + 0.03 + jump_rad,
            start + 0.04 + jump_rad,
        ]
        errors = [
            error_rad(tracker.measure(camera.expose(Scene(angle_rad=a).light()), PIVOT_PX), a)
            for a in angles
        ]
        assert np.abs(errors).max() < 0.15 * MRAD


@pytest.mark.parametrize("bar_px", [0.0, 10.0, 14.0])
def test_a_cable_that_is_missing_or_behind_a_bar_is_not_measured(
    camera: Camera, bar_px: float
) -> None:
    tracker = Tracker(WIDTH, HEIGHT)
    for _ in range(3):
        assert tracker.measure(camera.expose(Scene(angle_rad=0.1).light()), PIVOT_PX).valid
    empty = np.full((HEIGHT, WIDTH), 210.0) - (
        165.0 * stripe(0.1, PIVOT_PX, bar_px, 0.8) if bar_px else 0.0
    )
    assert not tracker.measure(camera.expose(empty), PIVOT_PX, predicted_angle_rad=0.1).valid


@pytest.mark.parametrize("off_px", [-3.0, 3.0])
def test_a_pivot_predicted_3_px_off_does_not_change_the_angle_and_is_reported(
    camera: Camera, off_px: float
) -> None:
    angles = np.radians(np.linspace(-20.0, 20.0, 30))
    tracker = Tracker(WIDTH, HEIGHT)
    for angle in angles:
        fit = tracker.measure(
            camera.expose(Scene(angle_rad=angle).light()),
            (PIVOT_PX[0] + off_px, PIVOT_PX[1]),
            angle,
        )
        assert abs(error_rad(fit, angle)) < 0.06 * MRAD
        assert fit.pivot_miss_px == pytest.approx(-off_px, abs=0.05)


def test_a_pivot_predicted_8_px_off_is_refused_with_its_miss(camera: Camera) -> None:
    fit = cold(camera.expose(Scene(angle_rad=0.05).light()), (PIVOT_PX[0] - 8.0, PIVOT_PX[1]))
    assert fit.reason is TrackFailure.PIVOT_MISSED
    assert fit.angle_rad is None
    assert fit.pivot_miss_px == pytest.approx(8.0, abs=0.1)


# some of these lines leave the image
@pytest.mark.parametrize("predicted_rad", [-0.2, -0.8, 0.8, 1.5])
def test_the_whole_picture_is_searched_when_the_prediction_fails(
    camera: Camera, predicted_rad: float
) -> None:
    tracker = Tracker(WIDTH, HEIGHT)
    image = camera.expose(Scene(angle_rad=0.2).light())
    assert abs(error_rad(tracker.measure(image, PIVOT_PX, predicted_rad), 0.2)) < 0.1 * MRAD


def bar(light: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Add a dark upright bar, 14 to 20 px wide, over the full height."""
    left, wide = int(rng.integers(150, 480)), int(rng.integers(14, 21))
    light[:, left : left + wide] = 45.0
    return light


def crossing_line(light: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Add a second thin line that crosses the cable in the image at 30 to 200 mrad."""
    v, turn = rng.uniform(100.0, 400.0), rng.choice([-1, 1]) * rng.uniform(0.03, 0.2)
    crossing = (PIVOT_PX[0] + math.tan(scene.angle_rad) * (v + 40.0), v)
    return light - 150.0 * np.minimum(
        stripe(scene.angle_rad + turn, crossing, 2.5, 0.8), (light - 45.0) / 165.0
    )


def parallel_line(light: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Add a second thin line 7 to 30 px beside the cable, within 10 mrad of its direction."""
    beside = PIVOT_PX[0] + rng.choice([-1, 1]) * rng.uniform(7.0, 30.0)
    return light - 165.0 * stripe(
        scene.angle_rad + rng.uniform(-0.01, 0.01), (beside, -40.0), 2.5, 0.8
    )


def bob(light: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Add a dark disc of 60 px on the cable."""
    v = rng.uniform(150.0, 440.0)
    u = PIVOT_PX[0] + math.tan(scene.angle_rad) * (v + 40.0) + rng.uniform(-8.0, 8.0)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.asarray(np.where(np.hypot(x - u, y - v) < 30.0, 30.0, light))


def glare(light: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Add a bright patch over a tenth of the cable."""
    v = rng.uniform(60.0, 420.0)
    u = PIVOT_PX[0] + math.tan(scene.angle_rad) * (v + 40.0) + rng.uniform(-10.0, 10.0)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.asarray(light + 200.0 * np.exp(-0.5 * ((x - u) ** 2 + (y - v) ** 2) / 12.0**2))


def shade(light: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Darken 55 % of the rows; the others show the cable."""
    top = int(rng.integers(0, int(0.55 * HEIGHT)))
    light[:top], light[top + int(0.45 * HEIGHT) :] = 60.0, 60.0
    return light


def uneven(light: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
    """Apply a 35 % gradient across the screen and a 12 % flicker band."""
    v, u = np.arange(HEIGHT)[:, None], np.arange(WIDTH)
    flicker = 1.0 + 0.06 * np.sin(2.0 * np.pi * v / 300.0 + rng.uniform(0.0, 6.28))
    return np.asarray(light * (0.65 + 0.35 * u / WIDTH) * flicker)


def untouched(light: FloatArray, scene: Scene, rng: np.random.Generator) -> FloatArray:
    return light


# name: (change of the image, scene, share that must be measured)
CASES: dict[str, tuple[Change, dict[str, float], float]] = {
    "bar": (bar, {}, 0.9),
    "crossing line": (crossing_line, {}, 0.6),
    "parallel line": (parallel_line, {}, 0.6),
    "bob": (bob, {}, 1.0),
    "glare": (glare, {}, 1.0),
    "shade": (shade, {}, 1.0),
    "uneven": (uneven, {}, 1.0),
    "saturated": (untouched, {"background": 330.0, "contrast": 285.0}, 1.0),
    "faint": (untouched, {"background": 90.0, "contrast": 35.0}, 1.0),
    "defocused": (untouched, {"psf_px": 2.5}, 1.0),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("predicted_off_rad", [0.2 * MRAD, 2 * MRAD, None])
def test_a_disturbed_picture_gives_the_angle_or_a_reason_but_no_wrong_angle(
    camera: Camera, case: str, predicted_off_rad: float | None
) -> None:
    change, settings, share = CASES[case]
    rng, measured = np.random.default_rng(7), 0
    angles = rng.uniform(-0.35, 0.35, 16)
    for angle in angles:
        scene = Scene(angle_rad=float(angle), **settings)  # type: ignore[arg-type]
        image = camera.expose(change(scene.light(), scene, rng))
        predicted = None if predicted_off_rad is None else float(angle) + predicted_off_rad
        fit = Tracker(WIDTH, HEIGHT).measure(image, PIVOT_PX, predicted)
        if fit.valid:
            measured += 1
            assert abs(error_rad(fit, float(angle))) < WRONG_RAD
    assert measured >= share * len(angles)


@pytest.mark.parametrize("change", [untouched, bar])
def test_a_picture_without_a_cable_is_refused(camera: Camera, change: Change) -> None:
    rng = np.random.default_rng(8)
    for _ in range(10):
        scene = Scene(contrast=0.0)
        fit = cold(camera.expose(change(scene.light(), scene, rng)))
        assert not fit.valid
        assert fit.angle_rad is None
        assert fit.sigma_rad is None


def test_a_second_line_through_the_pivot_is_ambiguous(camera: Camera) -> None:
    light = Scene(angle_rad=0.1).light() - 165.0 * stripe(-0.1, PIVOT_PX, 2.5, 0.8)
    assert cold(camera.expose(light)).reason is TrackFailure.AMBIGUOUS


def test_a_cable_seen_on_a_tenth_of_the_rows_is_too_short(camera: Camera) -> None:
    light = Scene(angle_rad=0.05).light()
    light[48:] = 210.0
    assert cold(camera.expose(light)).reason is TrackFailure.FEW_ROWS


@pytest.mark.parametrize("grey", [0, 255])
def test_a_picture_of_one_grey_is_a_bad_image(grey: int) -> None:
    fit = cold(np.full((HEIGHT, WIDTH), grey, np.uint8))
    assert fit.reason is TrackFailure.BAD_IMAGE
    assert fit.background == grey
    assert fit.saturation == (grey == 255)


@pytest.mark.parametrize(
    "image", [np.zeros((HEIGHT, WIDTH - 1), np.uint8), np.zeros((HEIGHT, WIDTH), np.uint16)]
)
def test_a_picture_of_another_size_or_type_is_a_bad_image(image: Grey) -> None:
    assert cold(image).reason is TrackFailure.BAD_IMAGE


def test_no_picture_makes_the_tracker_raise() -> None:
    rng = np.random.default_rng(9)
    trackers = [Tracker(WIDTH, HEIGHT), Tracker(67, 81)]
    for k in range(60):
        tracker = trackers[k % 2]
        image = rng.integers(0, 256, (tracker.height, tracker.width)).astype(
            np.uint8
        ) // rng.choice([1, 64, 255])
        for _ in range(rng.integers(0, 6)):  # hard-edged boxes, thin ones among them
            v, u = rng.integers(tracker.height), rng.integers(tracker.width)
            image[v : v + rng.integers(1, 481), u : u + rng.choice([1, 2, 3, 20])] = rng.choice(
                [0, 255]
            )
        pivot = (
            float(rng.uniform(-50, tracker.width + 50)),
            float(rng.uniform(-60, tracker.height + 60)),
        )
        predicted = None if k % 3 else float(rng.uniform(-1.5, 1.5))
        fit = tracker.measure(image, pivot, predicted)
        assert fit.valid is (fit.angle_rad is not None)


def test_background_and_saturation_are_the_picture_s(camera: Camera) -> None:
    fit = cold(camera.expose(Scene(angle_rad=0.1, background=255.0).light()))
    assert fit.background == pytest.approx(255.0, abs=1.0)
    assert fit.saturation == pytest.approx(0.55, abs=0.06)  # P(noise > -0.5 level) at 4 levels


def test_a_camera_too_small_for_the_strip_is_refused() -> None:
    with pytest.raises(VisionError, match="32 x 480"):
        Tracker(32, 480)
