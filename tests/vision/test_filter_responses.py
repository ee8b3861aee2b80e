"""Filters of recorded angles: response, what is undone, and parts between gaps."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from vision.filters import (
    FilteredAngles,
    FilterResponse,
    average_response,
    averaged,
    notch_coefficients,
    notch_response,
    notched,
    segments,
    undone,
)

PERIOD_S = 0.02
GAP_S = 0.03
NYQUIST_HZ = 0.5 / PERIOD_S
RATE_HZ = 1.0 / PERIOD_S


@given(frames=st.integers(1, 12), frequency_hz=st.floats(0.01, 0.97 * NYQUIST_HZ))
def test_an_average_has_the_response_of_its_coefficients(frames: int, frequency_hz: float) -> None:
    response = average_response(frames, PERIOD_S, frequency_hz)
    _, value = signal.freqz(np.ones(frames) / frames, worN=[frequency_hz], fs=RATE_HZ)
    # the gain is negative where the average turns the sine over
    lag = np.exp(-1j * math.tau * frequency_hz * response.delay_s)
    assert response.gain * lag == pytest.approx(complex(value[0]), abs=1e-9)


def test_an_average_of_a_constant_is_the_constant() -> None:
    assert average_response(5, PERIOD_S, 0.0) == FilterResponse(1.0, 2.0 * PERIOD_S)


@given(notch_hz=st.floats(0.5, 0.9 * NYQUIST_HZ), quality=st.floats(0.3, 30.0))
def test_a_notch_is_the_bilinear_transform_of_its_analogue_filter(
    notch_hz: float, quality: float
) -> None:
    found = notch_coefficients(notch_hz, quality, PERIOD_S)
    # s = (z - 1) / (z + 1)
    w = math.tan(math.pi * notch_hz * PERIOD_S)
    expected = signal.bilinear([1.0, 0.0, w * w], [1.0, w / quality, w * w], 0.5)
    assert found == pytest.approx(np.array(expected), abs=1e-9)


@given(frequency_hz=st.floats(0.05, 0.9 * NYQUIST_HZ), quality=st.floats(0.3, 10.0))
def test_the_response_of_a_notch_is_that_of_its_coefficients(
    frequency_hz: float, quality: float
) -> None:
    coefficients = notch_coefficients(6.0, quality, PERIOD_S)
    response = notch_response(coefficients, PERIOD_S, frequency_hz)
    _, value = signal.freqz(*coefficients, worN=[frequency_hz], fs=RATE_HZ)
    lag = np.exp(-1j * math.tau * frequency_hz * response.delay_s)
    assert response.gain * lag == pytest.approx(complex(value[0]), abs=1e-9)


def test_a_notch_stops_its_frequency_and_keeps_a_constant() -> None:
    coefficients = notch_coefficients(6.0, 1.0, PERIOD_S)
    assert notch_response(coefficients, PERIOD_S, 6.0).gain == pytest.approx(0.0, abs=1e-12)
    assert notch_response(coefficients, PERIOD_S, 1e-6).gain == pytest.approx(1.0, abs=1e-9)
    # half of the power is left at s^2 - s w / Q - w^2 = 0
    w = math.tau * 6.0 * PERIOD_S
    for sign in (-1.0, 1.0):
        edge = math.tan(0.5 * w) * (math.sqrt(1.25) + 0.5 * sign)  # prewarped, Q = 1
        edge_hz = 2.0 * math.atan(edge) / (math.tau * PERIOD_S)
        gain = notch_response(coefficients, PERIOD_S, edge_hz).gain
        assert gain == pytest.approx(math.sqrt(0.5), abs=1e-9)


def sine(frequency_hz: float, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    t_s = PERIOD_S * np.arange(count)
    return t_s, 0.03 + 0.1 * np.sin(math.tau * frequency_hz * t_s)


def test_a_filtered_sine_has_the_amplitude_and_the_delay_of_the_response() -> None:
    frequency_hz = 1.3
    t_s, angle_rad = sine(frequency_hz)
    coefficients = notch_coefficients(6.0, 0.7, PERIOD_S)
    response = notch_response(coefficients, PERIOD_S, frequency_hz)
    filtered = notched(t_s, angle_rad, coefficients, GAP_S)
    settled = t_s > 2.0
    late = filtered.t_s[settled] - response.delay_s
    expected = 0.03 + response.gain * 0.1 * np.sin(math.tau * frequency_hz * late)
    assert filtered.angle_rad[settled] == pytest.approx(expected, abs=1e-6)
    assert response.gain < 0.99
    assert response.delay_s > 0.1 * PERIOD_S


def test_an_average_keeps_the_phase_at_its_time_and_loses_what_the_response_says() -> None:
    frequency_hz = 2.1
    t_s, angle_rad = sine(frequency_hz)
    response = average_response(5, PERIOD_S, frequency_hz)
    found = averaged(t_s, angle_rad, 5, GAP_S)
    known = np.isfinite(found.angle_rad)
    assert np.flatnonzero(~known).tolist() == [0, 1, 2, 3]
    wave = np.sin(math.tau * frequency_hz * found.t_s[known])
    assert found.angle_rad[known] == pytest.approx(0.03 + response.gain * 0.1 * wave, abs=1e-12)


def test_what_a_filter_does_to_a_sine_is_undone() -> None:
    frequency_hz, count = 2.0, 404  # 16 whole periods are left by an average of five
    t_s, angle_rad = sine(frequency_hz, count)
    average = undone(
        averaged(t_s, angle_rad, 5, GAP_S), average_response(5, PERIOD_S, frequency_hz), 0.0
    )
    true = 0.03 + 0.1 * np.sin(math.tau * frequency_hz * average.t_s)
    known = np.isfinite(average.angle_rad)
    assert average.angle_rad[known] == pytest.approx(true[known], abs=1e-9)

    coefficients = notch_coefficients(6.0, 0.7, PERIOD_S)
    response = notch_response(coefficients, PERIOD_S, frequency_hz)
    filtered = notched(t_s, angle_rad, coefficients, GAP_S)
    settled = FilteredAngles(filtered.t_s[104:], filtered.angle_rad[104:])
    back = undone(settled, response, response.delay_s)
    true = 0.03 + 0.1 * np.sin(math.tau * frequency_hz * back.t_s)
    assert back.angle_rad == pytest.approx(true, abs=1e-6)


def test_nothing_is_undone_where_nothing_is_known() -> None:
    empty = FilteredAngles(np.arange(3.0), np.full(3, math.nan))
    assert undone(empty, FilterResponse(0.5, 0.1), 0.1) is empty


def test_a_notch_starts_from_rest_at_its_first_angle() -> None:
    t_s = PERIOD_S * np.arange(50)
    found = notched(t_s, np.full(50, 0.2), notch_coefficients(6.0, 1.0, PERIOD_S), GAP_S)
    assert found.angle_rad == pytest.approx(np.full(50, 0.2), abs=1e-12)
    assert (found.t_s == t_s).all()


def test_a_gap_or_a_missing_angle_starts_a_filter_again() -> None:
    t_s, angle_rad = sine(1.3, 60)
    t_s[40:] += 0.5  # frames that were lost
    angle_rad[20] = math.nan
    parts = [slice(0, 20), slice(21, 40), slice(40, 60)]
    assert segments(t_s, angle_rad, GAP_S) == parts
    coefficients = notch_coefficients(6.0, 1.0, PERIOD_S)
    filtered = notched(t_s, angle_rad, coefficients, GAP_S)
    mean = averaged(t_s, angle_rad, 5, GAP_S)
    assert math.isnan(filtered.angle_rad[20])
    for part in parts:
        alone = notched(t_s[part], angle_rad[part], coefficients, GAP_S)
        assert filtered.angle_rad[part] == pytest.approx(alone.angle_rad, abs=0.0)
        unknown = np.flatnonzero(np.isnan(mean.angle_rad[part])).tolist()
        assert unknown == [0, 1, 2, 3]


@given(
    steps=st.lists(st.sampled_from([0.02, 0.03, 0.031, 0.5, 0.0, -0.1]), min_size=1, max_size=30),
    known=st.lists(st.booleans(), min_size=30, max_size=30),
)
def test_parts_hold_every_angle_once_and_no_gap(steps: list[float], known: list[bool]) -> None:
    t_s = np.cumsum(steps)
    angle_rad = np.where(known[: len(t_s)], 0.1, math.nan)
    parts = segments(t_s, angle_rad, GAP_S)
    held = [index for part in parts for index in range(part.start, part.stop)]
    assert held == np.flatnonzero(np.isfinite(angle_rad)).tolist()
    for part in parts:
        intervals = np.diff(t_s[part])
        assert ((intervals > 0.0) & (intervals <= GAP_S)).all()
    for before, after in pairwise(parts):
        interval = t_s[after.start] - t_s[before.stop - 1]
        is_apart = after.start > before.stop
        assert is_apart or not 0.0 < interval <= GAP_S  # parts are not cut without a reason
