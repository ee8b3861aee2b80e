"""Moving average: mean, time stamp, standard deviation, and gaps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vision.errors import VisionError
from vision.filters import Angle, MovingAverage

PERIOD_NS = 20_000_000
GAP_NS = 30_000_000


@given(angles=st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=12), frames=st.integers(1, 5))
def test_the_average_is_the_mean_of_the_newest_frames(angles: list[float], frames: int) -> None:
    average = MovingAverage(frames, GAP_NS)
    out = [average.add(k * PERIOD_NS, angle, 1e-5) for k, angle in enumerate(angles)][-1]
    assert out.angle_rad == pytest.approx(np.mean(angles[-frames:]), abs=1e-12)


def test_a_steady_turn_is_reported_without_lag_at_its_stamp() -> None:
    average = MovingAverage(3, GAP_NS)
    for k in range(10):
        out = average.add(k * PERIOD_NS, 0.5 * k * 0.02, 1e-5)
        # also while the window fills
        assert out.angle_rad == pytest.approx(0.5 * out.t_ns * 1e-9, abs=1e-12)
    assert out.t_ns == 8 * PERIOD_NS  # one period behind the newest of three


def test_a_sine_is_attenuated_and_delayed_by_the_closed_form() -> None:
    average, w = MovingAverage(5, GAP_NS), 2.0 * math.pi * 1.5
    gain = math.sin(5 * w * 0.01) / (5 * math.sin(w * 0.01))
    for k in range(40):
        out = average.add(k * PERIOD_NS, math.sin(w * k * 0.02), 1e-5)
        if k >= 4:
            assert out.angle_rad == pytest.approx(gain * math.sin(w * out.t_ns * 1e-9), abs=1e-12)


def test_the_combined_sigma_is_the_scatter_of_the_average() -> None:
    rng = np.random.default_rng(5)
    sigma = np.array([1e-5, 2e-5, 4e-5])
    means = []
    for errors in rng.normal(size=(4000, 3)) * sigma:
        average = MovingAverage(3, GAP_NS)
        for k in range(3):
            out = average.add(k * PERIOD_NS, float(errors[k]), float(sigma[k]))
        means.append(out.angle_rad)
    assert np.std(means) == pytest.approx(out.sigma_rad, rel=0.05)


@pytest.mark.parametrize("t_ns", [3 * PERIOD_NS, PERIOD_NS, 0])
def test_a_missing_frame_or_a_stamp_that_does_not_advance_starts_the_window_again(
    t_ns: int,
) -> None:
    average = MovingAverage(3, GAP_NS)
    for k in range(2):
        average.add(k * PERIOD_NS, 0.3, 1e-5)
    assert average.add(t_ns, 0.1, 1e-5) == Angle(t_ns, 0.1, 1e-5)


def test_an_invalid_frame_starts_the_window_again() -> None:
    average = MovingAverage(3, GAP_NS)
    average.add(0, 0.3, 1e-5)
    average.restart()
    assert average.add(PERIOD_NS, 0.1, 1e-5) == Angle(PERIOD_NS, 0.1, 1e-5)


@pytest.mark.parametrize(("frames", "gap_ns"), [(0, GAP_NS), (3, 0)])
def test_an_empty_window_is_refused(frames: int, gap_ns: int) -> None:
    with pytest.raises(VisionError, match="at least 1"):
        MovingAverage(frames, gap_ns)
