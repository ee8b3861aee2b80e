"""Drift of the horizontal magnification, measured in pictures without noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sim_rig.cable_state import CableState
from sim_rig.camera_objects import Dust, Knots
from sim_rig.camera_params import CameraParams, LensParams, SensorParams
from sim_rig.camera_pose import PosedCamera
from sim_rig.imager import Imager
from sim_rig.link_angles import LinkState
from sim_rig.params import BenchParams, PendulumParams, View
from sim_rig.plain_imager import PlainImager, is_plain
from sim_rig.shutter import CameraImager
from sim_rig.synthetic import swinging_video
from sim_rig.vectors import Vector

DRIFT_REL = 0.04
GREY = SensorParams(kind="grey")
HALF_WIDTH_PX = 14
IMAGERS = [PlainImager, Imager]
ANGLE_RAD = 0.2


def plant(**camera: Any) -> BenchParams:
    quiet = {"noise": 0.0, "gain_drift_rel": DRIFT_REL, "exposure_ms": 0.0, "pitch_deg": 0.0}
    pendulum = PendulumParams(length_m=0.82, initial_swing_rad=0.3)
    view = View(width=800)
    return BenchParams(cameras=(CameraParams(**quiet | camera),), pendulum=pendulum, view=view)


def columns_px(picture: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Measure the column of the cable in each row as the centroid of its darkness."""
    rows = np.arange(len(picture))
    near = picture.argmin(axis=1)
    for _ in range(3):
        columns = near[:, None] + np.arange(-HALF_WIDTH_PX, HALF_WIDTH_PX + 1)
        dark = 200.0 - picture[rows[:, None], columns].astype(float)
        found = (dark * columns).sum(axis=1) / dark.sum(axis=1)
        near = np.rint(np.polyval(np.polyfit(rows, found, 2), rows)).astype(int)
    return np.asarray(found)


def askew(points_m: list[Vector] | None = None) -> CableState:
    """Make a cable that stands askew; with points, as one that vibrates."""
    link = LinkState(ANGLE_RAD, 0.0, 0.0, 0.0)
    return CableState((0.1, 0.0, 0.0), [link], [0.82], points_m or [])


def line_at(
    imager: CameraImager, t_s: float, state: CableState | None = None
) -> NDArray[np.float64]:
    """Measure slope, and column in the middle row, of a cable that stands still at t_s."""
    states = [state or askew()] * len(imager.instants_ns)
    picture = imager.picture(states, t_s, 0)
    found = columns_px(picture)
    rows = np.arange(found.size) - 240.0
    return np.asarray(np.polyfit(rows, found, 1))


@pytest.mark.parametrize("imager", IMAGERS)
@pytest.mark.parametrize("t_s", [6.0, 24.0, 60.0])
def test_the_tangent_in_a_picture_grows_by_the_drift_in_24_s(imager: Any, t_s: float) -> None:
    gain = 1.0 + DRIFT_REL * t_s / 24.0
    slope, column = line_at(imager(plant(), 0), t_s)
    assert slope == pytest.approx(gain * math.tan(ANGLE_RAD), abs=1e-5)
    # 1000 px/m; the middle row is 0.28 m below the pivot, at 0.1 m
    expected_px = 400.0 + gain * (100.0 + 280.0 * math.tan(ANGLE_RAD))
    assert column == pytest.approx(expected_px, abs=0.01)


@pytest.mark.parametrize("imager", IMAGERS)
def test_a_camera_that_looks_down_scales_its_whole_picture_about_the_middle_column(
    imager: Any,
) -> None:
    turned = imager(plant(pitch_deg=3.0), 0)
    slope, column = line_at(turned, 0.0)
    late_slope, late_column = line_at(turned, 24.0)
    assert late_slope / slope == pytest.approx(1.0 + DRIFT_REL, abs=5e-5)
    assert (late_column - 400.0) / (column - 400.0) == pytest.approx(1.0 + DRIFT_REL, abs=5e-5)


@pytest.mark.parametrize("imager", IMAGERS)
def test_a_cable_of_points_is_scaled_as_a_straight_one(imager: Any) -> None:
    camera = imager(plant(), 0)
    lower_end = (0.82 * math.sin(ANGLE_RAD), 0.0, -0.82 * math.cos(ANGLE_RAD))
    found = line_at(camera, 24.0, askew([(0.0, 0.0, 0.0), lower_end]))
    np.testing.assert_allclose(found, line_at(camera, 24.0), rtol=0.0, atol=1e-4)


@pytest.mark.parametrize("imager", IMAGERS)
def test_a_long_exposure_shows_the_gain_of_its_middle(imager: Any) -> None:
    slope, _ = line_at(imager(plant(exposure_ms=20.0), 0), 24.0)
    long, _ = line_at(imager(plant(exposure_ms=1000.0, rate_hz=1.0), 0), 24.0)
    gain = (1.0 + DRIFT_REL * 24.5 / 24.0) / (1.0 + DRIFT_REL * 24.01 / 24.0)
    assert long / slope == pytest.approx(gain, abs=1e-4)


def test_the_true_pivot_moves_with_the_picture() -> None:
    imager = Imager(plant(), 0)
    column, row = imager.truth([askew()] * 3, 24.0).pivot_px
    assert column == pytest.approx(400.0 + 100.0 * (1.0 + DRIFT_REL), abs=1e-9)
    assert row == pytest.approx(240.0 - 280.0, abs=1e-9)


def test_a_lens_scales_columns_about_its_axis_and_leaves_rows() -> None:
    lens = LensParams(k1=-0.1, p1=0.002, centre_px=(30.0, -10.0))
    camera = CameraParams(gain_drift_rel=-0.03, yaw_deg=2.0, roll_deg=1.0, lens=lens)
    pose = PosedCamera(camera, View(), (0.0, 0.0, 0.0))
    points_m = np.array([[0.1, 0.0, -0.1], [-0.2, 0.1, -0.3], [0.02, 0.0, -0.6]])
    early, late = pose.project(points_m), pose.project(points_m, 12.0)
    assert early is not None
    assert late is not None
    axis_px = 320.0 + 30.0
    np.testing.assert_allclose(late[:, 0] - axis_px, 0.985 * (early[:, 0] - axis_px), atol=1e-9)
    np.testing.assert_allclose(late[:, 1], early[:, 1], atol=1e-9)


def test_the_pictures_of_a_video_show_what_is_true_in_them() -> None:
    params = plant(exposure_ms=10.0, gain_drift_rel=0.05)
    assert is_plain(params.cameras[0])
    imager = Imager(params, 0)
    *_, frame = swinging_video(params, 3.0)
    truth = imager.truth(frame.exposure.states, frame.exposure.true_start_ns * 1e-9)
    slope = np.polyfit(np.arange(480), columns_px(frame.exposure.pixels), 1)[0]
    gain = 1.0 + 0.05 * frame.t_s / 24.0
    assert truth.angle_rad == pytest.approx(math.atan(gain * math.tan(frame.angle_rad)), abs=1e-5)
    assert math.atan(slope) == pytest.approx(truth.angle_rad, abs=2e-5)


def test_a_long_run_ends_at_a_narrow_picture_and_not_at_a_mirrored_one() -> None:
    imager = Imager(plant(gain_drift_rel=-0.05), 0)
    assert line_at(imager, 1e4)[0] == pytest.approx(0.1 * math.tan(ANGLE_RAD), abs=1e-5)


def test_objects_that_stay_where_they_are_are_refused_with_a_drift() -> None:
    CameraParams(gain_drift_rel=0.01, objects=(Knots(),))
    with pytest.raises(ValueError, match="do not follow the cable"):
        CameraParams(gain_drift_rel=0.01, objects=(Knots(), Dust()))
