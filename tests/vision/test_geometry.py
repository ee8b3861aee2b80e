"""Angle of a pitched camera from its offset table, against projections by OpenCV."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from vision.errors import VisionError
from vision.geometry import PitchedCamera, PivotModel, pitched_camera

FloatArray = NDArray[np.float64]
WIDTH, HEIGHT, FOCAL_PX = 640, 480, 1000.0
DISTANCE_M, BELOW_PIVOT_M = 1.0, 0.28
POINTS_M = (-0.2, -0.1, 0.0, 0.1, 0.2)
ALONG_M = np.linspace(0.05, 0.55, 60)  # points of the cable
UNTURNED = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


class Lens(NamedTuple):
    """Camera that looks along y at the pivot: turns in radians, place along x in metres."""

    pitch: float = 0.0
    roll: float = 0.0
    x_m: float = 0.0

    def project(self, points_m: FloatArray) -> FloatArray:
        """Project points (N, 3) to pixels (N, 2)."""
        c, s = math.cos(self.pitch), math.sin(self.pitch)
        by_pitch = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        c, s = math.cos(self.roll), math.sin(self.roll)
        by_roll = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        turn = by_roll @ by_pitch @ UNTURNED
        moved = -turn @ np.array([self.x_m, -DISTANCE_M, -BELOW_PIVOT_M])
        matrix = np.array(
            [[FOCAL_PX, 0.0, WIDTH / 2], [0.0, FOCAL_PX, HEIGHT / 2], [0.0, 0.0, 1.0]]
        )
        pixels, _ = cv2.projectPoints(points_m, cv2.Rodrigues(turn)[0], moved, matrix, np.zeros(5))
        return np.asarray(pixels.reshape(-1, 2), dtype=np.float64)

    def slope_rad(self, x_m: float, angle_rad: float) -> float:
        """Slope angle in the picture of a cable that hangs from x_m."""
        across_m = x_m + ALONG_M * math.tan(angle_rad)
        seen = self.project(np.stack([across_m, 0.0 * ALONG_M, -ALONG_M], axis=1))
        return math.atan(np.polyfit(seen[:, 1], seen[:, 0], 1)[0])

    def calibrated(self, distance_m: float | None) -> tuple[PitchedCamera, list[float]]:
        """Pitch from a table measured without error, and the offsets of the table."""
        left, home, right = self.project(np.array([[-0.1, 0, 0], [0, 0, 0], [0.1, 0, 0.0]]))
        pivot = PivotModel(home_px=(home[0], home[1]), pixels_per_m=(right[0] - left[0]) / 0.2)
        offsets = [self.slope_rad(x_m, 0.0) for x_m in POINTS_M]
        return pitched_camera(POINTS_M, offsets, pivot, (WIDTH, HEIGHT), distance_m), offsets

    def errors_rad(self, distance_m: float | None = None) -> FloatArray:
        """Errors of the angle over the table and 0.2 rad to both sides."""
        pitched, offsets = self.calibrated(distance_m)
        errors = []
        for x_m in np.linspace(-0.2, 0.2, 9):
            offset = float(np.interp(x_m, POINTS_M, offsets))
            for angle in np.linspace(-0.2, 0.2, 9):
                true = pitched.true_angle(self.slope_rad(x_m, angle), offset, x_m)
                errors.append(true.angle_rad - angle)
        return np.array(errors)


@pytest.mark.parametrize("degrees", [1.0, 3.0, 5.0])
def test_the_table_and_the_distance_give_the_angle_of_a_pitched_camera_exactly(
    degrees: float,
) -> None:
    assert np.abs(Lens(pitch=math.radians(degrees)).errors_rad(DISTANCE_M)).max() < 1e-6


def test_the_distance_to_5_percent_leaves_less_than_0_15_mrad_at_3_degrees() -> None:
    lens = Lens(pitch=math.radians(3.0))
    for distance_m in (0.95 * DISTANCE_M, 1.05 * DISTANCE_M):
        assert np.abs(lens.errors_rad(distance_m)).max() < 0.05e-3


def test_the_table_alone_leaves_one_minus_the_cosine_of_the_pitch() -> None:
    errors = Lens(pitch=math.radians(3.0)).errors_rad()
    assert math.sqrt(np.mean(errors**2)) < 0.2e-3
    assert np.abs(errors).max() == pytest.approx(0.2 * (1.0 - math.cos(math.radians(3.0))), rel=0.1)


@pytest.mark.parametrize("lens", [Lens(roll=0.05), Lens(x_m=0.08), Lens()])
def test_a_roll_or_a_camera_beside_the_home_position_costs_nothing(lens: Lens) -> None:
    assert np.abs(lens.errors_rad()).max() < 1e-6


def test_roll_and_place_beside_a_pitch_leave_less_than_0_1_mrad() -> None:
    lens = Lens(pitch=math.radians(3.0), roll=math.radians(2.0), x_m=0.08)
    assert np.abs(lens.errors_rad(DISTANCE_M)).max() < 0.1e-3


def test_the_gain_is_the_derivative_of_the_true_angle() -> None:
    pitched, _ = Lens(pitch=math.radians(3.0)).calibrated(None)
    step = 1e-6
    for slope in (-0.2, 0.0, 0.15):
        ends = [pitched.true_angle(slope + d, -0.01, 0.1).angle_rad for d in (-step, step)]
        gain = pitched.true_angle(slope, -0.01, 0.1).gain
        assert (ends[1] - ends[0]) / (2 * step) == pytest.approx(gain, rel=1e-6)


def test_a_table_of_one_position_shows_no_pitch() -> None:
    pivot = PivotModel(home_px=(320.0, -40.0), pixels_per_m=1000.0)
    pitched = pitched_camera([0.0], [0.01], pivot, (WIDTH, HEIGHT))
    assert pitched == PitchedCamera()
    assert pitched.true_angle(0.11, 0.01, 0.3).angle_rad == pytest.approx(0.1, abs=1e-15)


@pytest.mark.parametrize(("slope_1_m", "distance_m"), [(2.5, None), (-2.5, None), (0.3, 4.0)])
def test_a_table_steeper_than_any_pitch_is_refused(
    slope_1_m: float, distance_m: float | None
) -> None:
    pivot = PivotModel(home_px=(320.0, -40.0), pixels_per_m=1000.0)
    offsets = [slope_1_m * x_m for x_m in POINTS_M]
    with pytest.raises(VisionError, match=f"slope of {slope_1_m} rad/m"):
        pitched_camera(POINTS_M, offsets, pivot, (WIDTH, HEIGHT), distance_m)
