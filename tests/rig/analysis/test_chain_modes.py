"""Modes of a chain in the log of a run, against the eigenvalues of the simulated load."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rig.analysis.analyze import RunAnalysis
from rig.run import config, experiment
from rig.run.runs import LOG

LENGTH_M, G = 0.392, 9.81
CHANGES = [
    "camera.rate_hz=50",
    "vision.rows=150",
    "safety.initial_swing_rad=1",
    "experiment.watch_s=12",
    "bench.robot.kind=cartesian",
]


def test_both_modes_of_two_equal_masses_are_found(tmp_path: Path) -> None:
    chosen = config.read_experiment("source004_ch4_free_decay", CHANGES)
    ran = experiment.run(
        chosen, "virtual", tmp_path, lambda t_ns, operator: None, lambda job, plan: None
    )
    modes = RunAnalysis(ran.folder / LOG).summary.modes
    # two equal masses on two equal cables: w^2 = g / L (2 -+ sqrt 2)
    expected = np.sqrt(G / LENGTH_M * (2.0 + np.array([-1.0, 1.0]) * math.sqrt(2.0))) / math.tau
    assert [mode.frequency_hz for mode in modes] == pytest.approx(expected, rel=5e-4)
    for mode, true_hz in zip(modes, expected, strict=True):
        assert abs(mode.frequency_hz - true_hz) < 2.5 * mode.sigma_frequency_hz
        assert mode.amplitude_rad == pytest.approx(0.01, rel=0.02)
