"""Camera model: projection, pivot and true angle, against projections by OpenCV."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from rig.analysis.both_planes import in_one_plane
from rig.analysis.seen_swing import SeenSwing
from vision.cable_geometry import ModelGeometry
from vision.camera_model import CameraModel, CameraParameters, SeenLine
from vision.errors import VisionError

FloatArray = NDArray[np.float64]
WIDTH, HEIGHT = 640, 480
ALONG_M = np.linspace(0.0, 1.5, 3000)  # points of the cable
# right, down and ahead of a camera that is not turned: before the plane x, and right of it
AXES = (
    np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]),
)
LENS = (-0.1, 0.02, 1e-3, -5e-4, 0.01)


def parameters(
    pitch: float = 5.0,
    roll: float = 2.0,
    yaw: float = 2.0,
    lens: tuple[float, float, float, float, float] = LENS,
    plane: int = 0,
) -> CameraParameters:
    """Camera 1 m before the pivot and 0.28 m below it, turned by degrees."""
    p, r, y = map(math.radians, (pitch, roll, yaw))
    by_yaw = np.array([[math.cos(y), 0, -math.sin(y)], [0, 1, 0], [math.sin(y), 0, math.cos(y)]])
    by_pitch = np.array([[1, 0, 0], [0, math.cos(p), -math.sin(p)], [0, math.sin(p), math.cos(p)]])
    by_roll = np.array([[math.cos(r), math.sin(r), 0], [-math.sin(r), math.cos(r), 0], [0, 0, 1]])
    turn = by_roll @ by_pitch @ by_yaw @ AXES[plane]
    centre_m = np.array([0.0, 0.28, -1.0]) @ AXES[plane]
    rotation = cv2.Rodrigues(turn)[0].ravel().tolist()
    translation_m = (-turn @ centre_m).tolist()
    return CameraParameters(
        focal_px=(1000.0, 1003.0),
        centre_px=(322.0, 237.0),
        distortion=lens,
        rotation=tuple(rotation),
        translation_m=tuple(translation_m),
    )


def project(camera: CameraParameters, points_m: FloatArray) -> FloatArray:
    """Project points (N, 3) to pixels (N, 2) by OpenCV."""
    (fx, fy), (cx, cy) = camera.focal_px, camera.centre_px
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    rotation, translation = np.array(camera.rotation), np.array(camera.translation_m)
    pixels, _ = cv2.projectPoints(
        points_m, rotation, translation, matrix, np.array(camera.distortion)
    )
    return np.asarray(pixels.reshape(-1, 2), dtype=np.float64)


class SeenCable(NamedTuple):
    """Best straight line over the rows of a projected cable."""

    line: SeenLine
    column_0_px: float

    @classmethod
    def of(
        cls, camera: CameraParameters, place_m: tuple[float, ...], slopes: tuple[float, float]
    ) -> SeenCable:
        """Project a cable that hangs from a place with tangents along x and y."""
        direction = np.array([*slopes, -1.0])
        pixels = project(camera, np.array(place_m) + ALONG_M[:, None] * direction)
        rows = np.arange(max(0, math.ceil(pixels[0, 1]) + 2), HEIGHT, dtype=np.float64)
        columns = np.interp(rows, pixels[:, 1], pixels[:, 0])
        inside = (columns > 0) & (columns < WIDTH)
        rows, columns = rows[inside], columns[inside]
        slope, column = np.polyfit(rows, columns, 1)
        return cls(SeenLine(column, 0.0, math.atan(slope), rows[0], rows[-1]), column)


@given(
    point=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    turns=st.tuples(*[st.floats(-10.0, 10.0)] * 3),
    lens=st.tuples(*[st.floats(-0.1, 0.1)] * 2, *[st.floats(-0.01, 0.01)] * 2, st.just(0.0)),
)
@settings(max_examples=40)
def test_points_are_projected_and_their_rays_found_as_by_opencv(
    point: tuple[float, float, float],
    turns: tuple[float, float, float],
    lens: tuple[float, float, float, float, float],
) -> None:
    camera = parameters(*turns, lens=lens)
    model = CameraModel(camera)
    pixels = model.project(np.array([point]))
    np.testing.assert_allclose(pixels, project(camera, np.array([point])), atol=1e-9)
    own = model.turn @ np.array(point) + model.translation_m
    np.testing.assert_allclose(model.rays(pixels)[0], own / own[2], atol=1e-8)


@pytest.mark.parametrize("plane", [0, 1])
def test_the_angle_is_true_wherever_the_platform_is(plane: int) -> None:
    camera = parameters(plane=plane)
    model = CameraModel(camera)
    rng = np.random.default_rng(3)
    errors = []
    for _ in range(60):
        place_m = tuple(rng.uniform(-0.1, 0.1, 3))
        angle = rng.uniform(-0.2, 0.2)
        slopes = (math.tan(angle), 0.0) if plane == 0 else (0.0, math.tan(angle))
        seen = SeenCable.of(camera, place_m, slopes)
        errors.append(model.true_angle(seen.line, plane).angle_rad - angle)
    assert np.abs(errors).max() < 0.02e-3


def test_the_gain_is_the_change_of_the_angle_by_that_of_the_line() -> None:
    camera = parameters(lens=(0.0,) * 5)
    model = CameraModel(camera)
    line = SeenCable.of(camera, (0.1, 0.0, 0.0), (0.15, 0.0)).line
    column_px = line.column_px + math.tan(line.slope_rad) * 240.0
    line = line._replace(column_px=column_px, row_px=240.0, first_row=40.0, last_row=440.0)
    step = 1e-5
    ends = [
        model.true_angle(line._replace(slope_rad=line.slope_rad + d), 0).angle_rad
        for d in (-step, step)
    ]
    gain = model.true_angle(line, 0).gain
    assert gain == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-3)


@pytest.mark.parametrize("height_m", [-0.1, 0.0, 0.1])
def test_the_pivot_is_where_the_line_through_a_bent_picture_passes_its_row(
    height_m: float,
) -> None:
    camera = parameters()
    geometry = ModelGeometry(camera, HEIGHT, 0)
    for x_m, angle in ((-0.1, -0.15), (0.05, 0.1), (0.1, 0.2)):
        seen = SeenCable.of(camera, (x_m, 0.1, height_m), (math.tan(angle), 0.0))
        geometry.true_angle(seen.line, 0.0, (x_m, 0.1, height_m))  # the newest angle
        column, row = geometry.pivot_px((x_m, 0.1, height_m))
        expected = project(camera, np.array([[x_m, 0.1, height_m]]))[0]
        assert row == pytest.approx(expected[1], abs=1e-6)
        line_px = seen.column_0_px + math.tan(seen.line.slope_rad) * row
        assert column == pytest.approx(line_px, abs=0.3)


def test_the_offset_is_subtracted_from_the_angle() -> None:
    camera = parameters()
    line = SeenCable.of(camera, (0.0, 0.0, 0.0), (0.1, 0.0)).line
    geometry = ModelGeometry(camera, HEIGHT, 0)
    angles = [geometry.true_angle(line, offset, (0, 0, 0)).angle_rad for offset in (0.0, 0.003)]
    assert angles[0] - angles[1] == pytest.approx(0.003, abs=1e-12)


def test_a_pivot_behind_the_camera_has_no_place_in_the_picture() -> None:
    geometry = ModelGeometry(parameters(), HEIGHT, 0)
    assert np.isnan(geometry.pivot_px((0.0, -1.5, 0.0))).all()


def test_two_cameras_give_both_angles_though_their_stamps_differ() -> None:
    cameras = (parameters(), parameters(plane=1))
    models = [CameraModel(camera) for camera in cameras]
    stamps = [np.arange(0.0, 2.0, 0.02), np.arange(0.007, 2.0, 0.033)]
    place_m = (0.09, -0.06, 0.05)
    seen = []
    for plane, t_s in enumerate(stamps):
        angles = []
        for t in t_s:
            slopes = true_slopes(t)
            line = SeenCable.of(cameras[plane], place_m, slopes).line
            angles.append(models[plane].true_angle(line, plane).angle_rad)
        seen.append(SeenSwing(t_s, np.array(angles), np.full(t_s.size, 1e-5)))
    own = true_angles(stamps[0], 0)
    assert np.abs(seen[0].angle_rad - own).max() > 1e-3  # the swing across in perspective
    centres_m = (models[0].centre_m, models[1].centre_m)
    for plane in (0, 1):
        mine, other = seen[plane], seen[1 - plane]
        pivots_m = np.tile(place_m, (mine.t_s.size, 1))
        both = centres_m if plane == 0 else centres_m[::-1]
        solved = in_one_plane(mine, other, pivots_m, both, plane)
        assert solved.t_s.size > 0.9 * mine.t_s.size
        assert np.abs(solved.angle_rad - true_angles(solved.t_s, plane)).max() < 0.02e-3


def true_angles(t_s: FloatArray, plane: int) -> FloatArray:
    """Angles of a swing in space."""
    amplitude, phase = ((0.1, 0.0), (0.05, 1.0))[plane]
    return np.asarray(amplitude * np.cos(3.2 * t_s + phase))


def true_slopes(t_s: float) -> tuple[float, float]:
    """Tangents of a swing in space."""
    x, y = (math.tan(true_angles(np.array([t_s]), plane)[0]) for plane in (0, 1))
    return x, y


def test_instants_without_an_angle_of_the_other_camera_are_left_out() -> None:
    t_s = np.arange(0.0, 1.0, 0.02)
    mine = SeenSwing(t_s, 0.0 * t_s, 0.0 * t_s)
    gap = (t_s > 0.4) & (t_s < 0.6)
    other = SeenSwing(t_s[~gap], 0.0 * t_s[~gap], 0.0 * t_s[~gap])
    centres_m = (np.array([0.0, -1.0, -0.3]), np.array([1.0, 0.0, -0.3]))
    solved = in_one_plane(mine, other, np.zeros((t_s.size, 3)), centres_m, 0)
    assert not np.any((solved.t_s > 0.41) & (solved.t_s < 0.59))
    assert solved.t_s.size >= t_s.size - np.count_nonzero(gap) - 1


@pytest.mark.parametrize("change", [{"focal_px": (0.0, 1.0)}, {"rotation": (math.nan, 0.0, 0.0)}])
def test_what_is_no_camera_is_refused(change: dict[str, tuple[float, ...]]) -> None:
    tables = msgspec.to_builtins(parameters()) | change
    with pytest.raises((ValueError, msgspec.ValidationError), match="calibrate the camera again"):
        CameraParameters(**tables)


def test_a_camera_with_its_back_to_the_home_position_is_refused() -> None:
    camera = msgspec.structs.replace(parameters(), translation_m=(0.0, 0.0, -1.0))
    with pytest.raises(VisionError, match="behind the camera"):
        CameraModel(camera)
