"""Meeting point of lines: exact, with noise, with outliers, and with a pivot that moves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vision.line_fit import ImageLine
from vision.pivot_fit import MeasuredLine, MeetingPoint, meeting_point

MIDDLE_ROW = 80.0
PIVOT_PX = (100.0, -16.0)
SLOPES = 0.25 * np.sin(0.9 * np.arange(15))


def through(x: float, y: float, slope: float, shift_px: float = 0.0) -> MeasuredLine:
    """Line through a point."""
    line = ImageLine(x + shift_px - slope * y, slope)
    return MeasuredLine(line, 1e-5, MIDDLE_ROW, shift_px)


def found(lines: list[MeasuredLine]) -> MeetingPoint:
    pivot = meeting_point(lines)
    assert pivot is not None
    return pivot


@given(
    x=st.floats(-400.0, 1000.0),
    y=st.floats(-3000.0, 60.0),
    amplitude=st.floats(0.02, 0.4),
    middle=st.floats(-0.3, 0.3),
)
def test_lines_through_a_point_meet_in_it(
    x: float, y: float, amplitude: float, middle: float
) -> None:
    slopes = middle + amplitude * np.sin(0.9 * np.arange(9))
    pivot = found([through(x, y, float(slope)) for slope in slopes])
    # the noise that the lines state is taken off: 1e-5 against a spread of 0.014 or more
    reach = abs(y - MIDDLE_ROW)
    assert pivot.at_px == pytest.approx((x, y), abs=1e-6 * reach + 1e-6)
    assert pivot.outliers == 0
    assert pivot.lines == 9


def noisy(random: np.random.Generator, slopes: np.ndarray, sigma: float) -> MeetingPoint:
    """Meeting point of lines through PIVOT_PX with an error of the slope and of the column."""
    lines = []
    for slope in slopes:
        column = PIVOT_PX[0] + slope * (MIDDLE_ROW - PIVOT_PX[1]) + random.normal(0.0, 0.02)
        seen = slope + random.normal(0.0, sigma)
        lines.append(MeasuredLine(ImageLine(column - seen * MIDDLE_ROW, seen), sigma, MIDDLE_ROW))
    return found(lines)


@pytest.mark.parametrize("amplitude", [0.25, 0.02])
def test_the_errors_of_the_pivot_are_those_that_it_states(amplitude: float) -> None:
    random = np.random.default_rng(1)
    scores = []
    for _ in range(300):
        phases = 0.9 * np.arange(20) + random.uniform(0.0, 6.0)
        pivot = noisy(random, amplitude * np.sin(phases), 1e-3)
        errors = np.subtract(pivot.at_px, PIVOT_PX)
        scores.append(errors / pivot.sigma_px)
    rms = np.sqrt(np.mean(np.square(scores), axis=0))
    assert ((rms > 0.85) & (rms < 1.4)).all()


def test_the_noise_of_the_slopes_does_not_bring_the_pivot_nearer() -> None:
    random = np.random.default_rng(2)
    slopes = 0.01 * np.sin(0.9 * np.arange(20))
    sigma = 3e-3
    rows = [noisy(random, slopes, sigma).at_px[1] for _ in range(400)]
    reach = MIDDLE_ROW - PIVOT_PX[1]
    # plain least squares would lose this part of the distance
    lost = reach * sigma**2 / (sigma**2 + float(np.var(slopes)))
    assert lost > 10.0
    assert np.median(rows) == pytest.approx(PIVOT_PX[1], abs=0.4 * lost)


def test_lines_that_miss_the_point_are_left_out_and_counted() -> None:
    lines = [through(*PIVOT_PX, float(slope)) for slope in SLOPES]
    lines[2:9:3] = [through(140.0, 30.0, 0.1), through(60.0, 0.0, 0.2), through(90.0, 90.0, 0.0)]
    pivot = found(lines)
    assert pivot.at_px == pytest.approx(PIVOT_PX, abs=1e-4)
    assert (pivot.lines, pivot.outliers) == (12, 3)


def test_the_known_motion_of_the_pivot_is_taken_off() -> None:
    lines = [through(*PIVOT_PX, float(slope), 2.5 * k) for k, slope in enumerate(SLOPES)]
    pivot = found(lines)
    assert pivot.at_px == pytest.approx(PIVOT_PX, abs=1e-4)
    assert pivot.drift_px == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("drift_px", [-4.0, 3.0])
def test_a_camera_that_moves_shows_as_the_drift_from_the_first_to_the_last_third(
    drift_px: float,
) -> None:
    columns = PIVOT_PX[0] + np.repeat([0.0, 0.5 * drift_px, drift_px], 5)
    # each third has the same slopes: the motion is not taken for another row of the pivot
    slopes = np.tile([-0.2, -0.1, 0.0, 0.1, 0.2], 3)
    pairs = zip(columns, slopes, strict=True)
    pivot = found([through(float(x), PIVOT_PX[1], float(slope)) for x, slope in pairs])
    assert pivot.drift_px == pytest.approx(drift_px, abs=1e-6)
    assert pivot.at_px == pytest.approx((PIVOT_PX[0] + 0.5 * drift_px, PIVOT_PX[1]), abs=1e-3)
    # rms distance, two degrees of freedom spent
    assert pivot.scatter_px == pytest.approx(abs(drift_px) * np.sqrt(2.5 / 13.0), rel=1e-3)


def test_three_lines_give_no_pivot() -> None:
    lines = [through(*PIVOT_PX, float(slope)) for slope in SLOPES[:4]]
    assert meeting_point(lines) is not None
    assert meeting_point(lines[:3]) is None


def test_parallel_lines_do_not_tell_the_row() -> None:
    pivot = found([through(100.0 + k, 0.0, 0.1) for k in range(8)])
    assert pivot.sigma_px[1] > 1e4
