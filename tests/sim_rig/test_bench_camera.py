"""Images of the simulated cable: projective geometry, brute-force rendering and a line fit."""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ndtr

from sim_rig.camera import CableLine, Pinhole
from sim_rig.camera_params import CameraParams
from sim_rig.params import BenchParams, PendulumParams, View
from sim_rig.renderer import BACKGROUNDS, Renderer
from sim_rig.synthetic import ColourPlanes, swinging_video

CLEAN = CameraParams(noise=0.0)
VIEW = View()
EXPOSURE_S = 0.01
Motion = Callable[[float], CableLine]


def columns(line: CableLine | None, rows: NDArray[np.float64]) -> NDArray[np.float64]:
    assert line is not None
    return line.column_px + line.slope * rows


def projected(
    camera: CameraParams, position_m: tuple[float, float, float], angle_rad: float, below_m: float
) -> NDArray[np.float64]:
    """Project the point below_m along the cable to (column, row) with OpenCV.

    OpenCV: x right, y down, z ahead.
    """
    x, y, z = position_m
    point = [
        x + below_m * math.sin(angle_rad),
        -(z + camera.pivot_above_axis_m - below_m * math.cos(angle_rad)),
        y,
    ]
    focal = camera.pixels_per_m * camera.distance_m
    matrix = np.array([[focal, 0.0, 320.0], [0.0, focal, 240.0], [0.0, 0.0, 1.0]])
    # a camera that looks down sees points ahead higher
    pitch = np.array([math.radians(camera.pitch_deg), 0.0, 0.0])
    away, _ = cv2.Rodrigues(pitch)
    pixels, _ = cv2.projectPoints(
        np.array([point]), pitch, away @ [0.0, 0.0, camera.distance_m], matrix, np.zeros(4)
    )
    return np.asarray(pixels, dtype=float).reshape(2)


@pytest.mark.parametrize("pitch_deg", [-3.0, 0.0, 1.0, 12.0])
@pytest.mark.parametrize("position_m", [(0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (-0.15, 0.1, 0.07)])
@pytest.mark.parametrize("angle_rad", [0.0, 0.3, -0.02])
def test_the_line_of_the_cable_agrees_with_projective_geometry(
    pitch_deg: float, position_m: tuple[float, float, float], angle_rad: float
) -> None:
    camera = CameraParams(pitch_deg=pitch_deg, distance_m=1.4, pixels_per_m=700.0)
    line = Pinhole(camera, VIEW, (0.0, 0.0, 0.0)).line(position_m, angle_rad)
    assert line is not None
    for below_m in (0.0, 0.2, 0.9):
        column, row = projected(camera, position_m, angle_rad, below_m)
        assert line.column_px + line.slope * row == pytest.approx(column, abs=1e-8)
    assert line.pivot_row_px == pytest.approx(
        projected(camera, position_m, angle_rad, 0.0)[1], abs=1e-8
    )


@pytest.mark.parametrize("pitch_deg", [0.0, 12.0])
@pytest.mark.parametrize("y_rad", [-0.3, 0.02])
def test_a_cable_that_swings_across_the_picture_is_seen_in_perspective(
    pitch_deg: float, y_rad: float
) -> None:
    camera = CameraParams(pitch_deg=pitch_deg, distance_m=1.4, pixels_per_m=700.0)
    position_m = (0.1, 0.05, -0.02)
    line = Pinhole(camera, VIEW, (0.0, 0.0, 0.0)).line(position_m, 0.1, y_rad)
    assert line is not None
    for down_m in (0.0, 0.2, 0.6):
        end = (down_m * math.tan(0.1), down_m * math.tan(y_rad), -down_m)
        x, y, z = np.add(position_m, end)
        column, row = projected(camera, (x, y, z), 0.0, 0.0)
        assert line.column_px + line.slope * row == pytest.approx(column, abs=1e-8)


@pytest.mark.parametrize("pitch_deg", [0.0, 12.0])
def test_a_curve_passes_through_the_projected_points_and_ends_at_the_last(pitch_deg: float) -> None:
    camera = CameraParams(pitch_deg=pitch_deg, pivot_above_axis_m=0.3)
    pinhole = Pinhole(camera, VIEW, (0.0, 0.0, 0.0))
    position_m = (0.05, 0.02, -0.04)
    points_m = [(0.0, 0.0, 0.0), (0.02, 0.03, -0.2), (-0.01, 0.0, -0.3)]
    curve = pinhole.curve(position_m, points_m)
    assert curve is not None
    pixels = np.array(
        [projected(camera, tuple(np.add(position_m, point)), 0.0, 0.0) for point in points_m]
    )
    rows = np.arange(VIEW.height)
    expected = np.interp(rows, pixels[:, 1], pixels[:, 0])
    assert curve.columns_px == pytest.approx(expected, abs=1e-9)
    shown = np.flatnonzero((rows >= pixels[0, 1]) & (rows <= pixels[-1, 1]))
    assert (curve.first_row, curve.last_row) == (shown[0], shown[-1] + 1)


def test_a_straight_curve_gives_the_picture_of_the_line() -> None:
    pinhole = Pinhole(CLEAN, VIEW, (0.0, 0.0, 0.0))
    renderer = Renderer(CLEAN, VIEW, seed=1)
    lines, curves = [], []
    for x_m in (0.100, 0.101, 0.102):
        lines.append(pinhole.line((x_m, 0.0, 0.0), 0.1))
        down = [(s * math.sin(0.1), 0.0, -s * math.cos(0.1)) for s in (0.0, 0.3, 1.0)]
        curves.append(pinhole.curve((x_m, 0.0, 0.0), down))
    of_line = renderer.picture(0, *lines).astype(int)
    of_curve = renderer.picture(0, *curves).astype(int)
    assert of_line.min() < 0.7 * of_line.max()
    assert np.abs(of_line - of_curve).max() <= 1


def test_the_picture_is_empty_below_the_end_of_a_curve() -> None:
    pinhole = Pinhole(CLEAN, VIEW, (0.0, 0.0, 0.0))
    curve = pinhole.curve((0.0, 0.0, 0.0), [(0.0, 0.0, 0.0), (0.01, 0.0, -0.1), (0.0, 0.0, -0.2)])
    assert curve is not None
    assert 0 < curve.last_row < VIEW.height
    darkest = Renderer(CLEAN, VIEW, seed=1).picture(0, curve, curve, curve).min(axis=1)
    shown = np.flatnonzero(darkest < darkest.max())
    assert (shown[0], shown[-1] + 1) == (curve.first_row, curve.last_row)


def test_a_cable_that_rises_or_reaches_the_camera_has_no_curve() -> None:
    pinhole = Pinhole(CLEAN, VIEW, (0.0, 0.0, 0.0))
    top = (0.0, 0.0, 0.0)
    assert pinhole.curve(top, [top, (0.0, 0.0, -0.2), (0.1, 0.0, -0.1)]) is None
    assert pinhole.curve(top, [top, (0.0, -CLEAN.distance_m, -0.2)]) is None


def test_a_level_camera_sees_the_pivot_at_home_40_px_above_the_middle_of_the_top_row() -> None:
    line = Pinhole(CameraParams(pitch_deg=0.0), VIEW, (0.3, 0.0, 0.1)).line((0.3, 0.0, 0.1), 0.0)
    assert line == pytest.approx((320.0, 0.0, -40.0), abs=1e-9)


def test_a_degree_of_pitch_tilts_a_hanging_cable_by_3_5_mrad_at_0_2_m() -> None:
    line = Pinhole(CameraParams(pitch_deg=1.0), VIEW, (0.0, 0.0, 0.0)).line((0.2, 0.0, 0.0), 0.0)
    assert line is not None
    assert math.atan(line.slope) == pytest.approx(-3.5e-3, abs=0.02e-3)


@pytest.mark.parametrize(
    ("position_m", "angle_rad"),
    [((0.0, -5.0, 0.0), 0.0), ((0.0, 0.0, 0.0), 1.6), ((0.0, 0.0, 0.0), math.pi)],
)
def test_a_cable_behind_the_camera_or_not_hanging_down_is_not_in_the_picture(
    position_m: tuple[float, float, float], angle_rad: float
) -> None:
    assert Pinhole(CLEAN, VIEW, (0.0, 0.0, 0.0)).line(position_m, angle_rad) is None


def swing(x_m: float, speed_m_s: float, angle_rad: float, rate_rad_s: float) -> Motion:
    """Motion of a cable around mid-exposure, with the angular acceleration of a pendulum."""
    pinhole = Pinhole(CLEAN, VIEW, (0.0, 0.0, 0.0))

    def line_at(t_s: float) -> CableLine:
        angle = angle_rad + rate_rad_s * t_s - 0.5 * 9.81 * math.sin(angle_rad) * t_s**2
        line = pinhole.line((x_m + speed_m_s * t_s, 0.0, 0.0), angle)
        assert line is not None
        return line

    return line_at


def brute_force(
    line_at: Motion, row: int, cells: int = 9, instants: int = 40
) -> NDArray[np.float64]:
    """Grey levels (640,) of one row, with lens blur alone.

    Sampled at 9 x 9 points per pixel and 40 times of the exposure.
    """
    inside = (np.arange(cells) + 0.5) / cells - 0.5
    at_column = (np.arange(640)[:, None] + inside)[:, None, :]  # (640, 1, cells)
    at_row = (row + inside)[None, :, None]  # (1, cells, 1)
    dark = np.zeros(640)
    for t_s in ((np.arange(instants) + 0.5) / instants - 0.5) * EXPOSURE_S:
        line = line_at(float(t_s))
        d = (at_column - line.column_px - line.slope * at_row) / math.hypot(1.0, line.slope)
        half = 0.5 * CLEAN.cable_width_px
        profile = ndtr((d + half) / CLEAN.psf_px) - ndtr((d - half) / CLEAN.psf_px)
        dark += profile.mean(axis=(1, 2))
    return CLEAN.background - CLEAN.contrast * dark / instants


@pytest.mark.parametrize(
    "motion",
    [
        pytest.param((0.0, 0.0, 0.0, 0.0), id="hanging still"),
        pytest.param((0.01, 0.0, 0.0004, 0.01), id="barely swinging"),
        pytest.param((0.05, 0.3, -0.1, 0.9), id="moving and swinging"),
        pytest.param((0.1, 0.0, -0.35, -1.1), id="far out"),
        pytest.param((-0.1, 2.5, 0.2, 3.0), id="very fast"),
        pytest.param((0.318, 0.1, 0.002, 0.3), id="on the picture's edge"),
    ],
)
def test_a_picture_is_within_a_grey_level_of_brute_force(
    motion: tuple[float, float, float, float],
) -> None:
    line_at = swing(*motion)
    picture = Renderer(CLEAN, VIEW, 0).picture(
        0, *(line_at(t) for t in (-EXPOSURE_S / 2, 0.0, EXPOSURE_S / 2))
    )
    for row in (0, 3, 160, 333, 479):
        truth = np.rint(brute_force(line_at, row))
        assert np.abs(picture[row] - truth).max() <= 1.0


def fitted_slope(picture: NDArray[np.uint8], start: CableLine) -> float:
    """Slope of the least squares line of an image without noise.

    Gauss-Newton for column and slope of the profile of the cable.
    """
    s, half = math.sqrt(CLEAN.psf_px**2 + 1.0 / 12.0), 0.5 * CLEAN.cable_width_px
    rows = np.arange(480.0)[:, None]
    first = np.rint(columns(start, rows)).astype(int) - 12
    column = first + np.arange(25)  # (480, 25)
    seen = CLEAN.background - np.take_along_axis(picture.astype(float), column, axis=1)
    p = np.array([start.column_px, start.slope])
    for _ in range(4):
        cos = 1.0 / math.hypot(1.0, p[1])
        d = (column - p[0] - p[1] * rows) * cos
        bell = np.exp(-0.5 * ((d + half) / s) ** 2) - np.exp(-0.5 * ((d - half) / s) ** 2)
        model = CLEAN.contrast * (ndtr((d + half) / s) - ndtr((d - half) / s))
        by_column = -CLEAN.contrast * cos * bell / (s * math.sqrt(2.0 * math.pi))
        jacobian = np.stack([by_column.ravel(), (by_column * rows).ravel()], axis=1)
        p = p + np.linalg.lstsq(jacobian, (seen - model).ravel(), rcond=None)[0]
    return float(p[1])


@pytest.mark.parametrize("angle_rad", [0.0007, 0.003, -0.011, 0.1, -0.2, 0.35])
def test_a_fitted_line_has_the_slope_of_the_cable(angle_rad: float) -> None:
    renderer = Renderer(CLEAN, VIEW, 0)
    for x_m in np.linspace(0.01, 0.0132, 9).tolist():
        line = swing(x_m, 0.0, angle_rad, 0.0)(0.0)
        error = fitted_slope(renderer.picture(0, line, line, line), line) - line.slope
        assert abs(error) < 0.005e-3


def test_noisy_pictures_of_a_nearly_upright_cable_reach_the_cramer_rao_bound_without_bias() -> None:
    """All rows have one sub-pixel phase; 8-bit rounding alone would bias the fit by 0.02 mrad."""
    noise = 2.5
    renderer = Renderer(CameraParams(noise=noise), VIEW, 5)
    s, w = math.sqrt(CLEAN.psf_px**2 + 1.0 / 12.0), CLEAN.cable_width_px
    information = (
        CLEAN.contrast**2
        / (math.sqrt(math.pi) * s * noise**2)
        * (1.0 - math.exp(-((w / (2.0 * s)) ** 2)))
    )
    bound = math.sqrt(12.0 / (information * 480.0**3))
    errors = []
    for k, x_m in enumerate(np.linspace(-0.2, 0.2, 96).tolist()):
        line = swing(x_m, 0.0, x_m * math.radians(1.0) + 0.00005, 0.0)(0.0)
        errors.append(fitted_slope(renderer.picture(k, line, line, line), line) - line.slope)
    assert abs(np.mean(errors)) < 3.0 * bound / math.sqrt(96.0)
    assert np.std(errors) == pytest.approx(bound, rel=0.25)


def test_an_exposure_blurs_about_the_mean_position_of_the_cable() -> None:
    renderer = Renderer(CLEAN, VIEW, 0)
    start, middle, end = (
        CableLine(100.0, 0.0, -40.0),
        CableLine(103.0, 0.0, -40.0),
        CableLine(104.0, 0.0, -40.0),
    )
    dark = 200.0 - renderer.picture(0, start, middle, end).astype(float)
    centroid = (dark * np.arange(640)).sum(axis=1) / dark.sum(axis=1)
    assert centroid.mean() == pytest.approx((100.0 + 4.0 * 103.0 + 104.0) / 6.0, abs=0.02)
    assert dark.sum(axis=1).mean() == pytest.approx(CLEAN.contrast * CLEAN.cable_width_px, rel=0.01)


@pytest.mark.parametrize("column_px", [-3000.0, -12.0, 652.0, 9000.0])
def test_a_cable_outside_the_picture_leaves_it_empty(column_px: float) -> None:
    renderer = Renderer(CameraParams(), VIEW, 0)
    line = CableLine(column_px, 0.0, -40.0)
    np.testing.assert_array_equal(
        renderer.picture(3, line, line, line), renderer.picture(3, None, None, None)
    )


@pytest.mark.parametrize("slope", [-9.0, -3.0, 3.0, 9.0])
def test_a_nearly_horizontal_cable_darkens_the_rows_it_crosses(slope: float) -> None:
    line = CableLine(320.0 - slope * 240.0, slope, -40.0)
    dark = 200.0 - Renderer(CLEAN, VIEW, 0).picture(0, line, line, line).astype(float)
    along = dark[230:251, 320].sum()
    assert along == pytest.approx(
        CLEAN.contrast * CLEAN.cable_width_px * math.hypot(1.0, slope) / abs(slope), rel=0.03
    )
    assert dark[:100, 320].max() == 0.0


@pytest.mark.parametrize(("pivot_row_px", "first"), [(-40.0, 0), (99.5, 100), (480.5, 480)])
def test_the_cable_begins_at_its_pivot(pivot_row_px: float, first: int) -> None:
    line = CableLine(300.0, 0.1, pivot_row_px)
    dark = 200 - Renderer(CLEAN, VIEW, 0).picture(0, line, line, line).astype(int)
    np.testing.assert_array_equal(dark.max(axis=1) > 100, np.arange(480) >= first)


def test_a_dark_cable_on_a_dim_screen_stays_black() -> None:
    line = CableLine(300.0, 0.1, -40.0)
    picture = Renderer(CameraParams(background=60.0, contrast=255.0), VIEW, 0).picture(
        0, line, line, line
    )
    assert picture[:, 250:400].min() == 0
    assert picture.max() < 90


def test_equal_seeds_give_equal_pictures_and_others_do_not() -> None:
    first, again, other = (
        Renderer(CameraParams(), VIEW, seed).picture(2, None, None, None) for seed in (7, 7, 8)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.5


def test_screens_have_the_configured_noise_and_are_used_in_turn() -> None:
    renderer = Renderer(CameraParams(noise=3.0), VIEW, 0)
    screens = [renderer.picture(k, None, None, None) for k in range(BACKGROUNDS + 1)]
    assert np.mean(screens[0]) == pytest.approx(200.0, abs=0.05)
    assert np.std(screens[0]) == pytest.approx(math.sqrt(9.0 + 1.0 / 12.0), rel=0.01)
    assert (screens[0] != screens[1]).mean() > 0.5
    np.testing.assert_array_equal(screens[0], screens[BACKGROUNDS])


def test_a_change_of_a_picture_does_not_change_the_next_one() -> None:
    renderer = Renderer(CameraParams(), VIEW, 0)
    line = CableLine(300.0, 0.1, -40.0)
    mine = renderer.picture(0, line, line, line)
    before = mine.copy()
    mine[:] = 0
    np.testing.assert_array_equal(renderer.picture(0, line, line, line), before)


def test_video_shows_the_swing_in_the_red_plane_alone_with_its_time() -> None:
    pendulum = PendulumParams(initial_swing_rad=0.01, damping_ratio=0.0)
    camera = CameraParams(noise=0.0, pitch_deg=0.0)
    params = BenchParams(pendulum=pendulum, cameras=(camera,), seed=1)
    frames = list(swinging_video(params, 0.5))
    assert [frame.number for frame in frames] == list(range(25))
    planes = ColourPlanes(params)
    for frame in frames[::6]:
        image = planes.colour(frame.exposure.pixels, frame.number)
        assert frame.t_s == pytest.approx(0.02 * frame.number + 0.005, abs=1e-12)
        assert frame.angle_rad == pytest.approx(
            0.01 * math.cos(math.sqrt(9.81) * frame.t_s), abs=2e-7
        )
        line = CableLine(320.0 + 40.0 * math.tan(frame.angle_rad), math.tan(frame.angle_rad), -40.0)
        assert fitted_slope(frame.exposure.pixels, line) == pytest.approx(line.slope, abs=0.005e-3)
        np.testing.assert_array_equal(image[..., 2], frame.exposure.pixels)
        assert np.ptp(image[..., :2]) == 0


def test_video_noise_follows_the_seed() -> None:
    images = []
    for seed in (3, 3, 4):
        params = BenchParams(view=View(width=64, height=48), seed=seed)
        frame = next(swinging_video(params, 1.0))
        images.append(ColourPlanes(params).colour(frame.exposure.pixels, frame.number))
    first, again, other = images
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.5
    assert (first[..., 0] != first[..., 1]).mean() > 0.5


def test_video_without_a_frame_rate_is_refused() -> None:
    params = msgspec.convert({"view": {"rate_hz": 0.0}}, BenchParams)
    with pytest.raises(ValueError, match="rate_hz = 0 "):
        next(swinging_video(params, 1.0))
