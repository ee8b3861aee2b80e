"""Notch filter against closed forms, python-control and source 001.

The figures of source 001 are those of its example.
"""

import math
import tomllib
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.drives.servo.errors import BeyondNyquist, ServoError
from rig.drives.servo.loops import PolePair
from rig.drives.servo.notch import Notch

FIGURES = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_loops.toml").read_text())[
    "notch"
]
shares = st.just(0.0) | st.floats(1e-3, 0.99)
notches = st.builds(
    lambda w, share, z2: Notch(
        frequency_rad_s=w, numerator_damping=share * z2, denominator_damping=z2
    ),
    st.floats(1.0, 3000.0),
    shares,
    st.floats(0.05, 3.0),
)


def magnitude(system, omega_rad_s):
    return abs(
        complex(
            system(1j * omega_rad_s)
            if not system.dt
            else system(np.exp(1j * omega_rad_s * system.dt))
        )
    )


def test_band_and_depth_are_those_of_the_reference():
    notch = Notch(
        frequency_rad_s=50.0,
        numerator_damping=FIGURES["numerator_damping"],
        denominator_damping=FIGURES["denominator_damping"],
    )
    assert notch.band_rad_s / 50.0 == pytest.approx(FIGURES["band_per_frequency"], rel=1e-7)
    assert notch.depth_db == pytest.approx(FIGURES["depth_db"], abs=1e-4)


@given(notches)
def test_all_passes_at_zero_and_at_infinity_and_the_depth_at_the_frequency(notch):
    assert magnitude(notch.system, 0.0) == pytest.approx(1.0, rel=1e-12)
    assert magnitude(notch.system, 1e9 * notch.frequency_rad_s) == pytest.approx(1.0, rel=1e-6)
    assert magnitude(notch.system, notch.frequency_rad_s) == pytest.approx(
        notch.depth, rel=1e-9, abs=1e-12
    )


@given(notches)
def test_half_of_the_power_passes_at_both_edges_of_the_band(notch):
    if notch.depth >= math.sqrt(0.5):
        with pytest.raises(ServoError, match="to have a -3 dB band: raise denominator_damping"):
            _ = notch.band_rad_s
        return
    low, high = notch.edges_rad_s
    assert high - low == pytest.approx(notch.band_rad_s, rel=1e-9)
    assert low * high == pytest.approx(notch.frequency_rad_s**2, rel=1e-6)
    assert magnitude(notch.system, high) == pytest.approx(math.sqrt(0.5), rel=1e-9)
    assert magnitude(notch.system, notch.frequency_rad_s**2 / high) == pytest.approx(
        math.sqrt(0.5), rel=1e-9
    )


@given(st.floats(1.0, 3000.0), st.floats(0.01, 3.0), st.floats(0.0, 0.7))
def test_a_notch_designed_by_its_band_has_it(frequency, band_share, depth):
    notch = Notch.of_band(frequency, band_share * frequency, depth)
    assert notch.band_rad_s == pytest.approx(band_share * frequency, rel=1e-9)
    assert notch.depth == pytest.approx(depth, rel=1e-12)


@given(notches, st.floats(0.01, 0.95))
def test_prewarped_sampling_is_exact_at_the_frequency(notch, share):
    period_s = share * math.pi / notch.frequency_rad_s
    sampled = notch.sampled(period_s)
    assert magnitude(sampled, notch.frequency_rad_s) == pytest.approx(
        notch.depth, rel=1e-6, abs=1e-8
    )
    assert magnitude(sampled, 0.0) == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("known", FIGURES["sampled"])
def test_without_prewarp_the_notch_moves_down_as_far_as_the_bilinear_transform_says(known):
    notch = Notch(frequency_rad_s=known["frequency_rad_s"], numerator_damping=0.0)
    moved = notch.digital_frequency_rad_s(known["period_s"])
    assert moved / notch.frequency_rad_s - 1.0 == pytest.approx(known["shift"], rel=2e-6)
    sampled = notch.sampled(known["period_s"], prewarp=False)
    assert magnitude(sampled, moved) < 1e-8 < magnitude(sampled, notch.frequency_rad_s)


def test_tuned_to_a_pair_of_poles_its_zeros_are_that_pair():
    plant = control.tf([1.0], [1.0, 40.0, 80_000.0])
    pair = PolePair(math.sqrt(80_000.0), 20.0 / math.sqrt(80_000.0))
    notch = Notch.tuned_to(pair, 0.9)
    np.testing.assert_allclose(np.sort(notch.system.zeros()), np.sort(plant.poles()), rtol=1e-12)
    assert notch.denominator_damping == 0.9


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: Notch(frequency_rad_s=0.0, numerator_damping=0.1),
            "frequency_rad_s = 0.0; must be",
        ),
        (
            lambda: Notch(frequency_rad_s=math.nan, numerator_damping=0.1),
            "frequency_rad_s = nan; must be",
        ),
        (
            lambda: Notch(frequency_rad_s=9.0, numerator_damping=1.0),
            "must be 0 or more and < denominator_damping = 1.0",
        ),
        (
            lambda: Notch(frequency_rad_s=9.0, numerator_damping=-0.1),
            "numerator_damping = -0.1; must be 0 or more",
        ),
        (
            lambda: Notch(frequency_rad_s=9.0, numerator_damping=0.1, denominator_damping=1e3),
            "denominator_damping = 1000.0",
        ),
        (lambda: Notch.tuned_to(PolePair(100.0, -0.1)), "numerator_damping = -0.1"),
        (lambda: Notch.of_band(9.0, 1.0, 0.71), "depth = 0.71; must be 0 or more and < 0.707107"),
        (lambda: Notch.of_band(9.0, 0.0), "band_rad_s = 0.0"),
        (lambda: Notch(frequency_rad_s=9.0, numerator_damping=0.1).sampled(0.0), "period_s = 0.0"),
    ],
)
def test_what_is_no_notch_is_refused(make, said):
    with pytest.raises(ServoError, match=said):
        make()


@pytest.mark.parametrize(
    "ask", [Notch.sampled, Notch.digital_frequency_rad_s, lambda n, t: n.sampled(t, prewarp=False)]
)
def test_a_notch_beyond_nyquist_is_refused(ask):
    with pytest.raises(
        BeyondNyquist, match=r"frequency_rad_s = 4000 rad/s .* must be < 3141.59 rad/s"
    ):
        ask(Notch(frequency_rad_s=4000.0, numerator_damping=0.1), 1e-3)
