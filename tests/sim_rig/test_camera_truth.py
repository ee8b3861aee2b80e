"""What is true in a picture: against the picture itself, without noise, and against OpenCV."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from sim_rig.camera_objects import Chessboard, Mark
from sim_rig.camera_params import CameraParams, LensParams, SensorParams
from sim_rig.camera_pose import PosedCamera
from sim_rig.imager import Imager
from sim_rig.load_params import CableParams, LinkParams
from sim_rig.params import BenchParams, PendulumParams, View
from sim_rig.synthetic import RenderedFrame, swinging_video

HOME = (0.0, 0.0, 0.0)
HALF_WIDTH_PX = 14
POSED = {"pitch_deg": 5.0, "roll_deg": 2.0, "yaw_deg": 2.0, "lens": LensParams(k1=-0.1, p1=0.002)}
GREY = SensorParams(kind="grey")


def plant(camera: dict[str, Any], **keys: Any) -> BenchParams:
    """Make a plant with one camera; a swing of 0.3 rad at 0.55 Hz unless keys say otherwise."""
    pendulum = PendulumParams(length_m=0.82, initial_swing_rad=0.3)
    if "links" not in keys:
        keys = {"pendulum": pendulum} | keys
    return BenchParams(cameras=(CameraParams(**({"pitch_deg": 0.0} | camera)),), **keys)


def row_columns(picture: NDArray[np.uint8], near_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Measure the column of the cable in each row as the centroid of its darkness."""
    rows = np.arange(len(near_px))
    first = np.rint(near_px).astype(int) - HALF_WIDTH_PX
    columns = first[:, None] + np.arange(2 * HALF_WIDTH_PX + 1)
    dark = 200.0 - picture[rows[:, None], columns].astype(float)
    return np.asarray((dark * columns).sum(axis=1) / dark.sum(axis=1))


def picture_angle(picture: NDArray[np.uint8], rows: slice, slope: float, column: float) -> float:
    """Fit a line through the cable in the picture by centroids, and take its angle."""
    numbers = np.arange(rows.start, rows.stop)
    near = column + slope * numbers
    for _ in range(3):
        found = row_columns(picture[rows], near)
        near = np.polyval(np.polyfit(numbers, found, 4), numbers)
    return math.atan(np.polyfit(numbers, found, 1)[0])


def errors_rad(params: BenchParams, frames: int) -> NDArray[np.float64]:
    """Compare the angle in each picture, drawn with all faults, with what is said to be true."""
    imager = Imager(params, 0)
    found = []
    for frame in swinging_video(params, frames / 50.0 - 0.001):
        states, start_s = frame.exposure.states, frame.exposure.true_start_ns * 1e-9
        truth = imager.truth(states, start_s)
        assert truth.angle_rad is not None
        axis = imager.projector.axis(states, start_s)
        assert axis is not None
        link = slice(0, axis.link_rows)
        rows = slice(axis.first_row, axis.first_row + axis.link_rows)
        slope = math.tan(truth.angle_rad)
        column = float(axis.mean_px[link].mean() - slope * axis.rows[link].mean())
        picture = imager.picture(states, start_s, frame.number)
        found.append(picture_angle(picture, rows, slope, column) - truth.angle_rad)
    return np.array(found)


@pytest.mark.parametrize(
    ("camera", "frames"),
    [
        pytest.param({}, 300, id="plain"),
        pytest.param({"exposure_ms": 20.0}, 60, id="long exposure"),
        pytest.param(POSED, 300, id="pose and lens"),
        pytest.param({"row_us": 33.3}, 60, id="rolling shutter"),
        pytest.param(POSED | {"row_us": 33.3}, 60, id="pose, lens and rolling shutter"),
        pytest.param({"cable_width_px": 8.0}, 60, id="wide cable"),
        pytest.param(
            POSED | {"row_us": 33.3, "gain_drift_rel": 0.05}, 60, id="drift of all of this"
        ),
    ],
)
def test_without_noise_the_picture_shows_its_true_angle(
    camera: dict[str, Any], frames: int
) -> None:
    params = plant({"noise": 0.0, "sensor": GREY} | camera, view=View(width=800))
    errors = errors_rad(params, frames)
    assert abs(errors.mean()) <= 1e-6
    assert np.abs(errors).max() <= 1e-5


def test_without_noise_the_picture_shows_the_true_line_through_a_bent_cable() -> None:
    cable = CableParams(linear_density_kg_m=0.02, damping_ratio=0.001)
    params = plant({"noise": 0.0, "sensor": GREY}, cable=cable)
    errors = errors_rad(params, 60)
    assert abs(errors.mean()) <= 1e-6
    assert np.abs(errors).max() <= 1e-5


def test_the_angle_of_the_first_of_two_links_is_that_above_their_joint() -> None:
    links = (
        LinkParams(length_m=0.3, mass_kg=0.2, initial_x_rad=0.1),
        LinkParams(length_m=0.5, mass_kg=0.5, initial_x_rad=-0.2),
    )
    params = plant({"noise": 0.0, "sensor": GREY, "exposure_ms": 0.0}, links=links)
    imager = Imager(params, 0)
    frame = next(swinging_video(params, 0.01))
    truth = imager.truth(frame.exposure.states, 0.0)
    assert truth.angle_rad == pytest.approx(0.1, abs=1e-9)
    # the joint is 0.3 m cos(0.1) below a pivot 40 px above the picture, at 1000 px/m
    assert truth.rows == math.floor(300.0 * math.cos(0.1) - 40.0) + 1


def test_a_rolling_shutter_bends_the_cable_by_the_way_it_goes_meanwhile() -> None:
    params = plant({"row_us": 33.3, "exposure_ms": 0.0}, pendulum=PendulumParams())
    imager = Imager(params, 0)
    rate_rad_s = 1.0
    states = []
    frame = next(swinging_video(params, 0.01))
    for instant_s in imager.projector.instants_s:
        angle = 0.1 + rate_rad_s * instant_s
        end = (math.sin(angle), 0.0, -math.cos(angle))
        state = frame.exposure.states[0]
        states.append(state._replace(bent_m=[(0.0, 0.0, 0.0), end]))
    axis = imager.projector.axis(states)
    assert axis is not None
    seen_s = axis.rows * 33.3e-6
    expected = 320.0 + (axis.rows + 40.0) * np.tan(0.1 + rate_rad_s * seen_s)
    np.testing.assert_allclose(axis.mean_px, expected, atol=1e-6)


def test_a_second_camera_sees_the_swing_across_the_plane_positive_to_the_right() -> None:
    links = (LinkParams(length_m=0.82, mass_kg=0.7, initial_x_rad=0.1, initial_y_rad=0.05),)
    cameras = (CameraParams(pitch_deg=0.0), CameraParams(plane="y", pitch_deg=0.0))
    params = BenchParams(links=links, cameras=cameras)
    frame = next(swinging_video(params, 0.01, number=1))
    truth = Imager(params, 1).truth(frame.exposure.states, 0.0)
    assert frame.angle_y_rad == pytest.approx(0.05, abs=1e-4)
    assert truth.pivot_px == pytest.approx((320.0, -40.0))
    assert truth.angle_rad is not None
    # the cable comes towards this camera, so that it is seen steeper by the depth of its lower end
    assert truth.angle_rad == pytest.approx(frame.angle_y_rad, rel=0.1)
    assert truth.angle_rad > 0.0


@pytest.mark.parametrize("seed", range(4))
def test_points_are_projected_as_by_opencv_with_turns_about_the_axes_of_the_camera(
    seed: int,
) -> None:
    random = np.random.default_rng(seed)
    pitch, yaw, roll = random.uniform(-20.0, 20.0, 3)
    shift = random.uniform(-0.1, 0.1, 3)
    lens = LensParams(k1=-0.2, k2=0.05, p1=0.001, p2=-0.002, centre_px=(5.0, -3.0), aspect=1.02)
    camera = CameraParams(
        pitch_deg=pitch, yaw_deg=yaw, roll_deg=roll, shift_m=tuple(shift), lens=lens
    )
    pose = PosedCamera(camera, View(), HOME)
    points = random.uniform(-0.2, 0.2, (20, 3)) - (0.0, 0.0, 0.28)
    turns = [
        np.array(axis) * math.radians(angle)
        for axis, angle in (
            ((0.0, -1.0, 0.0), yaw),
            ((1.0, 0.0, 0.0), pitch),
            ((0.0, 0.0, -1.0), roll),
        )
    ]
    turn = np.eye(3)
    for rotation in turns:
        turn = cv2.Rodrigues(rotation)[0] @ turn
    centre = np.array([0.0, -1.0, -0.28]) + shift
    level = np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)
    own_centre = np.array([centre[0], -centre[2], centre[1]])
    matrix = np.array([[1000.0, 0.0, 325.0], [0.0, 1020.0, 237.0], [0.0, 0.0, 1.0]])
    distortion = np.array([-0.2, 0.05, 0.001, -0.002, 0.0])
    expected, _ = cv2.projectPoints(
        level, cv2.Rodrigues(turn)[0], -turn @ own_centre, matrix, distortion
    )
    found = pose.project(points)
    assert found is not None
    np.testing.assert_allclose(found, expected.reshape(-1, 2), atol=1e-6)


def test_opencv_finds_the_camera_from_pictures_of_a_chessboard() -> None:
    boards = tuple(
        Chessboard(
            square_m=0.025,
            place_m=(0.035 + 0.08 * (k % 3 - 1), 0.1 - 0.03 * k, -0.365 + 0.06 * (k // 3 - 1)),
            turn_deg=(-32.0 + 8.0 * k, 28.0 - 7.0 * k, 12.0 - 3.0 * k),
            from_s=float(k),
            to_s=float(k + 1),
        )
        for k in range(9)
    )
    camera = POSED | {"contrast": 0.0, "noise": 1.0, "sensor": GREY, "objects": boards}
    params = plant(camera, view=View(rate_hz=1.0))
    places = np.zeros((54, 3), np.float32)
    places[:, :2] = 0.025 * np.mgrid[0:9, 0:6].T.reshape(-1, 2)
    found = []
    for frame in swinging_video(params, 9.0):
        ok, corners = cv2.findChessboardCorners(frame.exposure.pixels, (9, 6))
        if ok:
            stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 1e-3)
            found.append(cv2.cornerSubPix(frame.exposure.pixels, corners, (5, 5), (-1, -1), stop))
    assert len(found) >= 8
    rms_px, matrix, distortion, _, _ = cv2.calibrateCamera(
        [places] * len(found), found, (640, 480), None, None, flags=cv2.CALIB_FIX_K3
    )
    assert rms_px < 0.1
    assert matrix[0, 0] == pytest.approx(1000.0, rel=3e-3)
    assert matrix[:2, 2] == pytest.approx((320.0, 240.0), abs=4.0)
    assert distortion.ravel()[0] == pytest.approx(-0.1, abs=0.02)


def test_marks_are_where_their_places_are_projected() -> None:
    places = [(-0.2, 0.05, -0.15), (0.1, -0.1, -0.4)]
    marks = tuple(Mark(place_m=place) for place in places)
    camera = POSED | {"contrast": 0.0, "noise": 0.0, "sensor": GREY, "objects": marks}
    params = plant(camera)
    frame = next(swinging_video(params, 0.01))
    expected = PosedCamera(params.cameras[0], params.view, HOME).project(np.array(places))
    assert expected is not None
    dark = 200.0 - frame.exposure.pixels.astype(float)
    for column, row in expected:
        rows, columns = (slice(int(at) - 15, int(at) + 17) for at in (row, column))
        part = dark[rows, columns]
        centre = (part * np.arange(columns.start, columns.stop)).sum() / part.sum()
        assert centre == pytest.approx(column, abs=0.01)


def test_a_camera_that_looks_away_is_refused() -> None:
    params = plant({"shift_m": (0.0, 1.5, 0.0)})
    with pytest.raises(ValueError, match="turned away from the home position or behind it"):
        Imager(params, 0)


def noisy_variance(imager: Imager, frame: RenderedFrame, count: int) -> NDArray[np.float64]:
    """Measure mean and variance of each pixel over pictures of the same state."""
    states = frame.exposure.states
    pictures = np.stack([imager.picture(states, 0.0, k).astype(float) for k in range(count)])
    return np.asarray(pictures.var(axis=0, ddof=1))


@pytest.mark.parametrize(
    "camera",
    [
        pytest.param({}, id="plain"),
        pytest.param({"cable_width_px": 8.0}, id="wide"),
        pytest.param({"sensor": SensorParams(kind="grey", shot=0.05, gain=1.1)}, id="shot noise"),
        pytest.param({"background": 40.0, "contrast": -160.0, "sensor": GREY}, id="bright cable"),
        pytest.param(POSED | {"sensor": GREY}, id="pose and lens"),
        pytest.param({"psf_px": 3.0, "sensor": GREY}, id="defocus"),
    ],
)
def test_the_bound_is_the_numerical_cramer_rao_bound_of_the_picture(
    camera: dict[str, Any],
) -> None:
    """Finite differences of pictures without noise, and the noise of pictures with it."""
    params = plant(camera, view=View(width=400, height=300))
    frame = next(swinging_video(params, 0.01))
    imager = Imager(params, 0)
    truth = imager.truth(frame.exposure.states, 0.0)
    axis = imager.projector.axis(frame.exposure.states)
    assert axis is not None
    assert truth.bound_rad is not None
    quiet_camera = {"noise": 0.0, "sensor": SensorParams(kind="grey", gain=imager.gain)}
    quiet = Imager(plant(camera | quiet_camera, view=params.view), 0)
    rows = axis.rows - axis.rows.mean()

    def shifted(column_px: float, slope: float) -> NDArray[np.float64]:
        move = column_px + slope * rows
        moved = axis._replace(
            start_px=axis.start_px + move, mean_px=axis.mean_px + move, end_px=axis.end_px + move
        )
        return np.asarray(quiet.levels(moved, frame.exposure.states[1], 0.0)[0], np.float64)

    step = 0.01
    by_column = (shifted(step, 0.0) - shifted(-step, 0.0)) / (2.0 * step)
    by_slope = (shifted(0.0, step / 100.0) - shifted(0.0, -step / 100.0)) / (2.0 * step / 100.0)
    variance = noisy_variance(imager, frame, 200) / imager.gain**2
    strong = np.abs(by_column) > 1e-3 * np.abs(by_column).max()
    jacobian = np.stack([by_column[strong], by_slope[strong]])
    information = (jacobian / variance[strong]) @ jacobian.T
    slope_bound = math.sqrt(np.linalg.inv(information)[1, 1])
    assert truth.angle_rad is not None
    numerical = slope_bound * math.cos(truth.angle_rad) ** 2
    assert truth.bound_rad == pytest.approx(numerical, rel=0.05)
