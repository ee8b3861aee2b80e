"""The offset calibration finds a simulated camera, from swings of any amplitude."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from rig.analysis.identify.errors import AnalysisError
from rig.analysis.identify.offsets import OffsetCalibration, SwingRecord, calibrate_offsets

Array = npt.NDArray[np.float64]

FREQUENCY_HZ = 0.508
POSITIONS_M = np.array([-0.2, -0.1, 0.0, 0.1, 0.2])
TRUE_HOME_PX, TRUE_SCALE_PX_M = (321.3, -38.2), 852.0
PREDICTED_HOME_PX, PREDICTED_SCALE_PX_M = (320.0, -40.0), 850.0
MID_ROW_PX = 240.0  # a line's angle error turns it about the picture's middle
NOISE_RAD = 1.5e-5


def true_offset_rad(x_m: Array) -> Array:
    return np.asarray(0.0012 - 0.0175 * x_m)  # a camera rolled a little and pitched by a degree


def record(
    x_m: float,
    amplitude_rad: float,
    rng: np.random.Generator,
    *,
    periods: float = 2.0,
    damping_ratio: float = 0.000237,
) -> SwingRecord:
    t = 100 + rng.uniform(0, 50) + np.arange(0, periods / FREQUENCY_HZ + 0.02, 0.02)
    w = 2 * math.pi * FREQUENCY_HZ
    swing = (
        amplitude_rad * np.exp(-damping_ratio * w * (t - t[0])) * np.cos(w * t + rng.uniform(0, 6))
    )
    clean = swing + true_offset_rad(np.array(x_m))
    platform_m = x_m + rng.normal(0, 2e-6, t.size)
    line_px = (
        TRUE_HOME_PX[0]
        + TRUE_SCALE_PX_M * platform_m
        + np.tan(clean) * (PREDICTED_HOME_PX[1] - TRUE_HOME_PX[1])
    )
    error_rad = rng.normal(0, NOISE_RAD, t.size)
    line_px += (PREDICTED_HOME_PX[1] - MID_ROW_PX) * error_rad + rng.normal(0, 0.003, t.size)
    miss_px = line_px - PREDICTED_HOME_PX[0] - PREDICTED_SCALE_PX_M * platform_m
    return SwingRecord(
        t_s=t, raw_rad=clean + error_rad, platform_m=platform_m, pivot_miss_px=miss_px
    )


def calibrate(
    records: list[SwingRecord], natural_frequency_hz: float = FREQUENCY_HZ
) -> OffsetCalibration:
    return calibrate_offsets(
        records,
        pivot_home_px=PREDICTED_HOME_PX,
        pixels_per_m=PREDICTED_SCALE_PX_M,
        natural_frequency_hz=natural_frequency_hz,
    )


@pytest.mark.parametrize("amplitude_rad", [0.0, 1e-5, 3e-4, 0.003, 0.02])
@pytest.mark.parametrize("damping_ratio", [0.000237, 0.01])
def test_the_offsets_are_found_at_any_swing(amplitude_rad: float, damping_ratio: float) -> None:
    rng = np.random.default_rng(8)
    table = calibrate(
        [record(x, amplitude_rad, rng, damping_ratio=damping_ratio) for x in POSITIONS_M],
        FREQUENCY_HZ * 0.9,
    )
    np.testing.assert_allclose(table.x_m, POSITIONS_M, atol=1e-6)
    np.testing.assert_allclose(table.offset_rad, true_offset_rad(POSITIONS_M), atol=5e-6)
    assert table.residual_rad == pytest.approx(NOISE_RAD, rel=0.1)
    if amplitude_rad > 1e-4:
        assert table.frequency_hz == pytest.approx(FREQUENCY_HZ, rel=0.01)
        np.testing.assert_allclose(table.amplitude_rad, amplitude_rad, rtol=0.15)


@pytest.mark.parametrize("amplitude_rad", [2e-4, 0.01])
def test_the_reported_sigmas_are_the_spread_over_many_calibrations(amplitude_rad: float) -> None:
    rng = np.random.default_rng(6)
    tables = [
        calibrate([record(x, amplitude_rad, rng) for x in POSITIONS_M[1:4]]) for _ in range(120)
    ]
    error = np.array([t.offset_rad - true_offset_rad(POSITIONS_M[1:4]) for t in tables])
    told = np.array([t.sigma_offset_rad for t in tables])
    assert np.sqrt(np.mean(error**2)) == pytest.approx(np.sqrt(np.mean(told**2)), rel=0.15)
    u_error = np.array([t.pivot_home_px[0] - TRUE_HOME_PX[0] for t in tables])
    scale_error = np.array([t.pixels_per_m - TRUE_SCALE_PX_M for t in tables])
    if tables[0].row_observed:
        v_error = np.array([t.pivot_home_px[1] - TRUE_HOME_PX[1] for t in tables])
        assert np.std(v_error) == pytest.approx(
            np.median([t.sigma_pivot_home_px[1] for t in tables]), rel=0.2
        )
        assert np.std(u_error) == pytest.approx(
            np.median([t.sigma_pivot_home_px[0] for t in tables]), rel=0.2
        )
        assert np.std(scale_error) == pytest.approx(
            np.median([t.sigma_pixels_per_m for t in tables]), rel=0.2
        )


def test_a_large_swing_gives_the_row_of_the_pivot() -> None:
    rng = np.random.default_rng(1)
    table = calibrate([record(x, 0.01, rng) for x in POSITIONS_M])
    assert table.row_observed
    assert table.pivot_home_px == pytest.approx(TRUE_HOME_PX, abs=0.05)
    assert table.pixels_per_m == pytest.approx(TRUE_SCALE_PX_M, abs=0.05)
    for found, true, sigma in zip(
        table.pivot_home_px, TRUE_HOME_PX, table.sigma_pivot_home_px, strict=True
    ):
        assert abs(found - true) < 4 * sigma
    assert abs(table.pixels_per_m - TRUE_SCALE_PX_M) < 4 * table.sigma_pixels_per_m
    assert table.residual_px == pytest.approx(math.hypot(0.003, 280 * NOISE_RAD), rel=0.1)


def test_a_load_near_rest_keeps_the_predicted_row_and_says_so() -> None:
    rng = np.random.default_rng(1)
    table = calibrate([record(x, 1e-6, rng) for x in POSITIONS_M])
    assert not table.row_observed
    assert table.pivot_home_px[1] == PREDICTED_HOME_PX[1]
    assert table.sigma_pivot_home_px[1] == math.inf
    # u and scale contain the effect of the true row on the line at rest, which the tracker predicts
    x, row_error = POSITIONS_M, PREDICTED_HOME_PX[1] - TRUE_HOME_PX[1]
    line_px = TRUE_HOME_PX[0] + TRUE_SCALE_PX_M * x + np.tan(true_offset_rad(x)) * row_error
    np.testing.assert_allclose(table.pivot_home_px[0] + table.pixels_per_m * x, line_px, atol=2e-3)


def test_noise_common_to_angle_and_pivot_miss_does_not_bias_the_pivot() -> None:
    rng = np.random.default_rng(3)
    noisy = []
    for x in POSITIONS_M:
        quiet = record(x, 3e-3, rng, periods=8.0)
        error_rad = rng.normal(0, 4e-4, quiet.t_s.size)
        miss_px = quiet.pivot_miss_px + (PREDICTED_HOME_PX[1] - MID_ROW_PX) * error_rad
        noisy.append(replace(quiet, raw_rad=quiet.raw_rad + error_rad, pivot_miss_px=miss_px))
    table = calibrate(noisy)
    raw, miss = (
        np.concatenate([getattr(w, name) for w in noisy]) for name in ("raw_rad", "pivot_miss_px")
    )
    x_m = np.concatenate([w.platform_m for w in noisy])
    naive = np.linalg.lstsq(np.stack([np.ones_like(x_m), x_m, raw], axis=-1), miss)[0][2]
    assert abs(PREDICTED_HOME_PX[1] - naive - TRUE_HOME_PX[1]) > 5
    assert table.row_observed
    assert abs(table.pivot_home_px[1] - TRUE_HOME_PX[1]) < 3 * table.sigma_pivot_home_px[1]
    assert abs(table.pivot_home_px[0] - TRUE_HOME_PX[0]) < 0.05


def test_frames_without_an_angle_are_left_out_and_the_order_of_positions_does_not_matter() -> None:
    rng = np.random.default_rng(2)
    records = [record(x, 0.004, rng) for x in POSITIONS_M[[3, 0, 4, 1, 2]]]
    lost = rng.random(records[0].t_s.size) < 0.3
    records[0] = replace(records[0], raw_rad=np.where(lost, np.nan, records[0].raw_rad))
    table = calibrate(records)
    np.testing.assert_allclose(table.x_m, POSITIONS_M, atol=1e-6)
    np.testing.assert_allclose(table.offset_rad, true_offset_rad(POSITIONS_M), atol=5e-6)


def test_a_record_too_short_or_with_too_few_frames_is_refused_with_its_position() -> None:
    rng = np.random.default_rng(2)
    good = [record(x, 0.004, rng) for x in (0.0, 0.1)]
    with pytest.raises(AnalysisError, match=r"0\.\d\d periods watched at 0\.200 m"):
        calibrate([*good, record(0.2, 0.004, rng, periods=0.9)])
    half_blind = record(0.2, 0.004, rng)
    for kept, where in ((0, "at an unknown position"), (19, r"at 0\.200 m")):
        raw_rad = np.where(np.arange(half_blind.t_s.size) < kept, half_blind.raw_rad, np.nan)
        with pytest.raises(AnalysisError, match=f"{kept} valid samples {where}; need 20"):
            calibrate([*good, replace(half_blind, raw_rad=raw_rad)])


@pytest.mark.parametrize("positions_m", [(), (0.1,), (0.1, 0.1002)])
def test_a_table_needs_positions_apart(positions_m: tuple[float, ...]) -> None:
    rng = np.random.default_rng(2)
    with pytest.raises(AnalysisError, match=r"need 2, 0\.001 m apart"):
        calibrate([record(x, 0.004, rng) for x in positions_m])
