"""Offset table and pivot model over platform position, compared with numpy's interpolation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from vision.errors import VisionError
from vision.geometry import PivotModel
from vision.offset_table import TOLERANCE_M, LightOffsets, OffsetTable

X_M = [-0.1, 0.0, 0.15, 0.2]
OFFSET_RAD = [0.001, 0.0, -0.002, -0.0035]


@given(x_m=st.floats(-0.1, 0.2))
def test_between_its_points_the_table_is_piecewise_linear(x_m: float) -> None:
    offset = OffsetTable(X_M, OFFSET_RAD).at(x_m)
    assert offset.within
    assert offset.offset_rad == pytest.approx(np.interp(x_m, X_M, OFFSET_RAD), abs=1e-15)


@given(x_m=st.floats(-10.0, 10.0))
def test_the_offset_never_leaves_the_range_of_the_table(x_m: float) -> None:
    assert min(OFFSET_RAD) <= OffsetTable(X_M, OFFSET_RAD).at(x_m).offset_rad <= max(OFFSET_RAD)


@pytest.mark.parametrize(("x_m", "offset_rad"), [(-0.1, 0.001), (0.2, -0.0035)])
def test_the_end_value_holds_outside_the_table_and_within_is_false_beyond_the_tolerance(
    x_m: float, offset_rad: float
) -> None:
    table, out = OffsetTable(X_M, OFFSET_RAD), np.sign(x_m)
    assert table.at(x_m + 0.9 * TOLERANCE_M * out) == (offset_rad, True)
    assert table.at(x_m + 1.1 * TOLERANCE_M * out) == (offset_rad, False)


def test_a_table_of_one_point_holds_near_that_point_only() -> None:
    table = OffsetTable([0.1], [0.002])
    assert table.at(0.1) == (0.002, True)
    assert table.at(0.2) == (0.002, False)


@pytest.mark.parametrize(
    ("x_m", "offset_rad", "said"),
    [
        ([], [], "0 positions"),
        ([0.0, 0.1], [0.0], "2 positions and 1 offsets"),
        ([0.0, 0.1, 0.1], [0.0, 0.0, 0.0], "0.1 follows 0.1"),
        ([0.1, 0.0], [0.0, 0.0], "0.0 follows 0.1"),
        ([0.0, float("nan")], [0.0, 0.0], "nan"),
    ],
)
def test_a_table_that_is_no_function_of_position_is_refused(
    x_m: list[float], offset_rad: list[float], said: str
) -> None:
    with pytest.raises(VisionError, match=said):
        OffsetTable(x_m, offset_rad)


LIGHTS = [LightOffsets(60.0, [0.004, 0.003, 0.002, 0.001]), LightOffsets(180.0, OFFSET_RAD)]
OVER_LIGHT = OffsetTable(X_M, [0.0] * 4, 100.0, LIGHTS)


@given(x_m=st.floats(-0.1, 0.2), background=st.floats(60.0, 180.0))
def test_between_lights_the_table_is_bilinear(x_m: float, background: float) -> None:
    grid = np.array([LIGHTS[0].offset_rad, [0.0] * 4, OFFSET_RAD])
    expected = RegularGridInterpolator(([60.0, 100.0, 180.0], X_M), grid)([background, x_m])
    found = OVER_LIGHT.at(x_m, background)
    assert found.within
    assert found.offset_rad == pytest.approx(float(expected[0]), abs=1e-15)


@pytest.mark.parametrize(
    ("background", "within"), [(54.5, True), (53.5, False), (197.0, True), (199.0, False)]
)
def test_a_light_that_was_not_calibrated_is_beyond_the_table(
    background: float, within: bool
) -> None:
    assert OVER_LIGHT.at(0.0, background).within is within


def test_a_table_of_one_light_holds_in_every_light() -> None:
    table = OffsetTable(X_M, OFFSET_RAD, 100.0)
    assert table.at(0.05, 3.0) == table.at(0.05, 250.0) == table.at(0.05)


@pytest.mark.parametrize(
    ("background", "lights", "said"),
    [
        (None, LIGHTS, "first without its level"),
        (100.0, [LightOffsets(100.5, OFFSET_RAD)], "100.0 and 100.5 grey levels; must be 1 apart"),
        (100.0, [LightOffsets(50.0, [0.0])], "4 positions and 1 offsets"),
    ],
)
def test_lights_that_cannot_be_told_apart_are_refused(
    background: float | None, lights: list[LightOffsets], said: str
) -> None:
    with pytest.raises(VisionError, match=said):
        OffsetTable(X_M, OFFSET_RAD, background, lights)


def test_the_pivot_moves_right_with_the_platform_and_stays_in_its_row() -> None:
    pivot = PivotModel(home_px=(320.0, -40.0), pixels_per_m=520.0)
    assert pivot.pivot_px(0.0) == (320.0, -40.0)
    assert pivot.pivot_px(0.1) == pytest.approx((372.0, -40.0))


@pytest.mark.parametrize(
    ("home_px", "pixels_per_m"), [((320.0, -40.0), 0.0), ((float("inf"), 0.0), 500.0)]
)
def test_an_impossible_pivot_model_is_refused(
    home_px: tuple[float, float], pixels_per_m: float
) -> None:
    with pytest.raises(VisionError, match="calibrate"):
        PivotModel(home_px=home_px, pixels_per_m=pixels_per_m)
