"""Offset table and pivot model over platform position, compared with numpy's interpolation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vision.errors import VisionError
from vision.geometry import PivotModel
from vision.offset_table import TOLERANCE_M, OffsetTable

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
