"""Whole uncertainty of a run: what is known of the camera is removed, the rest is in the budget."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rig.analysis.angle_scale import CALIBRATED_REL, UNCALIBRATED_REL, angle_scale
from rig.analysis.facts import AnalysisFacts
from rig.analysis.identify.decay import DecayFit, fit_decay
from rig.analysis.summary import Quantities
from rig.analysis.uncertainty import budget_of, total

G = 9.81
X_M = [-0.2, -0.1, 0.0, 0.1, 0.2]
PITCH_RAD = math.radians(1.0)


def settings(**changes: Any) -> bytes:
    """Settings of a camera at 1 m with a pitch, as its task gets them."""
    slope_1_m = -math.sin(PITCH_RAD)
    values: dict[str, Any] = {
        "height": 480,
        "width": 640,
        "pivot_home_px": [320.0, -58.85],
        "pixels_per_m": 1005.06,
        "x_m": X_M,
        "offset_rad": [math.atan(slope_1_m * x) for x in X_M],
        "camera_distance_m": None,
        "model": None,
    }
    return json.dumps(values | changes).encode()


def test_a_corrected_camera_keeps_its_angles_and_doubts_what_the_distance_would_say() -> None:
    scale = angle_scale(settings(), is_corrected=True)
    assert scale.factor == 1.0
    assert scale.sigma_rel == pytest.approx(CALIBRATED_REL + 1.0 - math.cos(PITCH_RAD), rel=1e-3)
    known = angle_scale(settings(camera_distance_m=1.0), is_corrected=True)
    assert known.sigma_rel == CALIBRATED_REL


def test_the_perspective_of_an_uncorrected_camera_follows_from_its_table() -> None:
    # published figure of this calibration: (240 + 58.85) / 1005.06 x 0.017453 = 0.00519
    scale = angle_scale(settings(), is_corrected=False)
    assert scale.factor == pytest.approx(1.0 / (1.0 - 0.00519), abs=1e-5)
    known = angle_scale(settings(camera_distance_m=1.0), is_corrected=False)
    assert known.factor == pytest.approx(scale.factor * math.cos(PITCH_RAD), rel=1e-6)


@pytest.mark.parametrize("damaged", [b"{", b'{"x_m": 3}', settings(x_m=[], offset_rad=[])])
def test_a_camera_of_which_nothing_is_known_is_off_by_half_a_percent(damaged: bytes) -> None:
    scale = angle_scale(damaged, is_corrected=False)
    assert (scale.factor, scale.sigma_rel) == (1.0, UNCALIBRATED_REL)


def test_a_camera_file_leaves_the_scale_of_a_calibration() -> None:
    scale = angle_scale(settings(model={"focal_px": [1000.0, 1000.0]}), is_corrected=True)
    assert (scale.factor, scale.sigma_rel) == (1.0, CALIBRATED_REL)


@pytest.fixture(scope="module")
def fit() -> DecayFit:
    """Fit of a swing of 60 mrad, 24 s at 50 Hz."""
    t_s = np.arange(1200) * 0.02
    decay = np.exp(-0.000237 * 3.1927 * t_s)
    noise = np.random.default_rng(3).normal(0.0, 1e-5, t_s.size)
    return fit_decay(t_s, 0.06 * decay * np.cos(3.1927 * t_s) + noise)


MEASURED = Quantities(
    peak_swing_rad=0.06,
    residual_swing_rad=0.06,
    natural_frequency_hz=0.50813,
    damping_ratio=0.000237,
    cable_length_m=0.9624,
)
NOISE = Quantities(
    peak_swing_rad=6e-6,
    residual_swing_rad=6e-7,
    natural_frequency_hz=1e-7,
    damping_ratio=2e-7,
    cable_length_m=4e-7,
)


def whole(fit: DecayFit, terms: AnalysisFacts, scale_rel: float = 3e-4) -> Quantities:
    return total(budget_of(MEASURED, NOISE, fit, None, terms, G, scale_rel))


def test_the_defaults_give_the_digits_of_a_free_decay(fit: DecayFit) -> None:
    found = whole(fit, AnalysisFacts())
    assert found.residual_swing_rad == pytest.approx(1.8e-5, rel=0.01)  # 0.03 % of 60 mrad
    assert found.natural_frequency_hz == pytest.approx(20e-6 * 0.50813, rel=0.01)
    assert found.damping_ratio == pytest.approx(1.31e-5, rel=0.05)  # 0.1 % over omega T
    assert found.cable_length_m == pytest.approx(0.9624 * 0.01 / G, rel=0.01)


NOTHING = AnalysisFacts(clock_ppm=0.0, gain_drift_rel=0.0, gravity_sigma_m_s2=0.0)


@pytest.mark.parametrize(
    ("terms", "name", "expected"),
    [
        (replace_clock := {"clock_ppm": 100.0}, "natural_frequency_hz", 1e-4 * 0.50813),
        (replace_clock, "cable_length_m", 2e-4 * 0.9624),
        ({"gravity_sigma_m_s2": 0.1}, "cable_length_m", 0.1 / G * 0.9624),
        ({"gain_drift_rel": 0.01}, "damping_ratio", 0.01 / (2.0 * math.pi * 0.50813 * 23.98)),
    ],
)
def test_each_cause_enters_as_its_equation_says(
    fit: DecayFit, terms: dict[str, float], name: str, expected: float
) -> None:
    values = {field: getattr(NOTHING, field) for field in AnalysisFacts.__struct_fields__}
    found = whole(fit, AnalysisFacts(**(values | terms)), scale_rel=0.0)
    assert getattr(found, name) == pytest.approx(expected, rel=2e-3)


def test_without_causes_the_noise_is_all(fit: DecayFit) -> None:
    found = whole(fit, NOTHING, scale_rel=0.0)
    for name in Quantities.__struct_fields__:
        assert getattr(found, name) == pytest.approx(getattr(NOISE, name))


def test_halves_that_differ_beyond_their_noise_widen_the_result(fit: DecayFit) -> None:
    other = replace(fit, natural_frequency_hz=fit.natural_frequency_hz + 1e-3)
    rows = budget_of(MEASURED, NOISE, fit, (fit, other), NOTHING, G, 0.0)
    assert total(rows).natural_frequency_hz == pytest.approx(0.5e-3, rel=1e-3)
    near = replace(fit, natural_frequency_hz=fit.natural_frequency_hz + 1e-9)
    rows = budget_of(MEASURED, NOISE, fit, (fit, near), NOTHING, G, 0.0)
    assert total(rows).natural_frequency_hz == NOISE.natural_frequency_hz
