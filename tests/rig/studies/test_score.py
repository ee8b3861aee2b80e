"""Figures of a tracker against closed forms, and the bounds that they must meet."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rig.errors import ConfigError
from rig.run.toml_file import convert
from rig.studies.vision.score import Angles, Bars, Score, failures, score

NAN = math.nan
TRUTH = 0.1


def angles(errors, *, truth=TRUTH, sigma=NAN, bound=NAN) -> Angles:
    """Angles with these errors about one truth; an error of NaN is a refusal."""
    errors = np.asarray(errors, float)
    truths = np.broadcast_to(truth, errors.shape).astype(float)
    sigmas = np.where(np.isnan(errors), NAN, sigma)
    return Angles(truths, truths + errors, sigmas, np.broadcast_to(bound, errors.shape))


def test_errors_of_two_values_have_the_figures_of_their_mean_and_distance() -> None:
    found = score(angles([1e-3, 3e-3] * 50, sigma=5e-4, bound=2e-4), seconds=0.25)
    assert found.bias_rad == pytest.approx(2e-3)
    assert found.std_rad == pytest.approx(1e-3)
    assert found.worst_rad == pytest.approx(3e-3)
    assert found.std_over_bound == pytest.approx(5.0)
    assert found.error_over_sigma == pytest.approx(math.sqrt((4.0 + 36.0) / 2.0))
    assert found.frames_per_s == pytest.approx(400.0)
    assert (found.frames, found.refused, found.wrong) == (100, 0, 0)


def test_a_negative_error_can_be_the_worst() -> None:
    assert score(angles([1e-3, -4e-3]), seconds=1.0).worst_rad == pytest.approx(4e-3)


def test_a_refused_picture_counts_as_refused_and_in_no_other_figure() -> None:
    found = score(angles([1e-3, NAN, 1e-3, NAN], sigma=1e-3), seconds=1.0)
    assert (found.refused, found.refused_share, found.wrong) == (2, 0.5, 0)
    assert found.bias_rad == pytest.approx(1e-3)
    assert found.error_over_sigma == pytest.approx(1.0)


@pytest.mark.parametrize(("error_rad", "wrong"), [(4.9e-3, 0), (-4.9e-3, 0), (5.1e-3, 1)])
def test_an_angle_more_than_five_mrad_off_is_wrong(error_rad, wrong) -> None:
    assert score(angles([0.0, error_rad]), seconds=1.0).wrong == wrong


def test_an_angle_of_a_cable_that_is_not_visible_is_wrong_and_has_no_error() -> None:
    given = Angles(np.array([0.1, NAN]), np.array([0.101, 0.1]), np.full(2, NAN), np.full(2, NAN))
    found = score(given, seconds=1.0)
    assert (found.wrong, found.wrong_share) == (1, 0.5)
    assert found.bias_rad == pytest.approx(1e-3)


def test_a_right_angle_is_wrong_where_a_refusal_is_expected() -> None:
    found = score(angles([0.0, NAN, NAN]), seconds=1.0, expect="refuse")
    assert (found.wrong, found.refused) == (1, 2)


def test_a_picture_without_bound_or_sigma_is_left_out_of_that_ratio_only() -> None:
    given = angles([1e-3, -1e-3, 3e-3, -3e-3])
    given = given._replace(
        bound_rad=np.array([1e-3, 1e-3, NAN, NAN]), sigma_rad=np.array([NAN, NAN, 1e-3, 1e-3])
    )
    found = score(given, seconds=1.0)
    assert found.std_over_bound == pytest.approx(1.0)
    assert found.error_over_sigma == pytest.approx(3.0)
    assert found.std_rad == pytest.approx(math.sqrt(5.0) * 1e-3)


def test_figures_without_a_picture_are_not_numbers() -> None:
    found = score(angles([NAN, NAN]), seconds=0.0)
    none = (found.bias_rad, found.std_rad, found.worst_rad, found.std_over_bound)
    assert all(map(math.isnan, (*none, found.error_over_sigma, found.frames_per_s)))


def test_white_noise_as_large_as_the_bound_has_the_ratio_one() -> None:
    errors = 1e-5 * np.random.default_rng(3).standard_normal(20_000)
    found = score(angles(errors, bound=1e-5, sigma=1e-5), seconds=1.0)
    assert found.std_over_bound == pytest.approx(1.0, abs=0.02)
    assert found.error_over_sigma == pytest.approx(1.0, abs=0.02)


def some_score() -> Score:
    return score(angles([2e-3, 8e-3, NAN, NAN], sigma=1e-3, bound=1e-3), seconds=1.0)


@pytest.mark.parametrize(
    ("bars", "text"),
    [
        (Bars(), "silently wrong pictures 1; must be <= 0"),
        (Bars(max_wrong=1, max_refused_share=0.1), "refused 50 %; must be <= 10 %"),
        (Bars(max_wrong=1, max_bias_rad=1e-3), "bias 5 mrad; must be <= 1 mrad"),
        (Bars(max_wrong=1, max_std_rad=1e-3), "std 3 mrad; must be <= 2.5 mrad with 2 pictures"),
        (Bars(max_wrong=1, max_worst_rad=7e-3), "worst error 8 mrad; must be <= 7 mrad"),
        (
            Bars(max_wrong=1, max_std_over_bound=1),
            "std over bound 3; must be <= 2.5 with 2 pictures",
        ),
        (
            Bars(max_wrong=1, max_error_over_sigma=2),
            "error over sigma 5.831; must be <= 5 with 2 pictures",
        ),
    ],
)
def test_a_figure_beyond_its_bar_is_named_with_value_and_bound(bars, text) -> None:
    assert failures(some_score(), bars) == [text]


def test_bars_that_are_met_give_no_failure() -> None:
    bars = Bars(max_wrong=1, max_refused_share=0.5, max_worst_rad=9e-3, max_std_over_bound=3.1)
    assert failures(some_score(), bars) == []


def test_a_negative_bias_is_judged_by_its_size() -> None:
    found = score(angles([-2e-3, -2e-3]), seconds=1.0)
    assert failures(found, Bars(max_bias_rad=1e-3)) == ["bias 2 mrad; must be <= 1 mrad"]


def test_a_figure_without_value_fails_its_bar() -> None:
    found = score(angles([NAN]), seconds=1.0)
    expected = ["std over bound not defined; must be <= 6.243 with 1 pictures"]
    assert failures(found, Bars(max_std_over_bound=2.0)) == expected


def test_a_table_of_bars_names_an_unknown_key_and_a_negative_bar() -> None:
    assert convert({"max_bias_rad": 1e-3}, Bars) == Bars(max_bias_rad=1e-3)
    with pytest.raises(ConfigError, match=r"max_bias_mrad.*did you mean 'max_bias_rad'"):
        convert({"max_bias_mrad": 1.0}, Bars, "scene.bars")
    with pytest.raises(ConfigError, match="max_wrong = -1"):
        convert({"max_wrong": -1}, Bars, "scene.bars")
