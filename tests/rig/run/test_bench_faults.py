"""Runs in virtual time on a bench with a wrong clock, and with a camera whose gain drifts."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from rig.analysis.analyze import RunAnalysis
from rig.analysis.summary import Quantities
from rig.errors import ConfigError
from rig.run import config, experiment
from rig.run.runs import LOG
from rig.run.runtime import bench

BRIEF = ["experiment.watch_s=10", "bench.robot={kind='cartesian'}", "record.pictures_hz=0"]


def measured_and_true(folder: Path, fault: str) -> tuple[Quantities, Quantities]:
    chosen = config.read_experiment("free_decay", [*BRIEF, fault])
    ran = experiment.run(chosen, "virtual", folder, _quiet, _quiet)
    summary = RunAnalysis(ran.folder / LOG).summary
    assert summary.truth is not None
    return summary.measured, summary.truth


def _quiet(*_: object) -> None:
    return None


def test_a_fast_clock_shows_in_frequency_and_length_against_the_truth(tmp_path: Path) -> None:
    measured, true = measured_and_true(tmp_path, "bench.clock_ppm=500")
    assert true.cable_length_m == 0.9624
    assert true.natural_frequency_hz == pytest.approx(math.sqrt(9.81 / 0.9624) / math.tau)
    assert measured.natural_frequency_hz is not None
    assert measured.natural_frequency_hz * 1.0005 == pytest.approx(
        true.natural_frequency_hz, rel=5e-6
    )
    assert measured.cable_length_m == pytest.approx(0.9624 * 1.0005**2, rel=1e-5)
    assert measured.damping_ratio == pytest.approx(0.000237, rel=0.02)
    assert true.residual_swing_rad is not None
    assert measured.residual_swing_rad == pytest.approx(true.residual_swing_rad, rel=5e-4)


def test_a_gain_that_grows_takes_its_rate_from_the_damping(tmp_path: Path) -> None:
    measured, true = measured_and_true(tmp_path, "bench.camera.gain_drift_rel=-0.02")
    assert true.damping_ratio == 0.000237
    assert true.natural_frequency_hz is not None
    per_24_s = math.tau * true.natural_frequency_hz * 24.0
    assert measured.damping_ratio == pytest.approx(0.000237 + 0.02 / per_24_s, rel=0.02)


@pytest.mark.parametrize(
    ("override", "found"),
    [
        ("bench.clock_ppm=-1001", r"\[bench\] clock_ppm = -1001"),
        ("bench.camera.gain_drift_rel=0.06", r"\[bench.camera\] gain_drift_rel = 0.06"),
    ],
)
def test_a_fault_beyond_its_bound_is_named(override: str, found: str) -> None:
    with pytest.raises(ConfigError, match=found):
        bench.params(config.read_experiment("move", [override]))
