"""The policy `buffer`: the plan a playout delay later, with gaps bridged."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from comms.messages import Reference
from rig.analysis.analyze import RunAnalysis
from rig.run import config, experiment
from rig.run.runs import LOG
from rig.run.tasks.controller.interpolator import POLICIES, PolicySettings
from rig.run.tasks.safety import Envelope

MS = 1_000_000
TICK_NS = 5 * MS
T_START_NS = 600 * MS
HOME = (0.0, 0.0, 0.0)
ENVELOPE = Envelope(position_min_m=-10, position_max_m=10, speed_m_s=1.1, acceleration_m_s2=5.5)
PLAYOUT_MS = 100
TICKS = 400
FloatArray = npt.NDArray[np.float64]


def ramp(time_s: float) -> float:
    """Smooth move of 0.2 m in 1 s, from rest to rest."""
    s = min(max(time_s, 0.0), 1.0)
    return 0.2 * (s - math.sin(2 * math.pi * s) / (2 * math.pi))


def play(policy: str, lost: range = range(0)) -> FloatArray:
    """X of the setpoints [m]; reference k is for 10 k ms and arrives 1 ms later."""
    settings = PolicySettings(ENVELOPE, PLAYOUT_MS * MS)
    interpolator = POLICIES[policy](T_START_NS, HOME, settings)
    sent, newest = [], None
    for tick in range(TICKS):
        k = (tick - 1) // 2
        if tick % 2 and k not in lost:
            target_ns = T_START_NS + k * 10 * MS
            place = (ramp(k * 0.01), 0.0, 0.0)
            newest = Reference(seq=k, t_ns=0, t_target_ns=target_ns, position_m=place)
        sent.append(interpolator.setpoint(T_START_NS + tick * TICK_NS, newest)[0])
    return np.array(sent)


def test_without_losses_it_is_bounded_90_ms_later_to_the_last_digit() -> None:
    """Bounded itself plays references that are 10 ms old."""
    later = 18  # ticks
    assert play("buffer")[later:].tolist() == play("bounded")[:-later].tolist()


@pytest.mark.parametrize("first", range(10, 90, 9))
@pytest.mark.parametrize("length", [1, 2, 5, 7])
def test_a_gap_shorter_than_the_playout_delay_is_bridged(first: int, length: int) -> None:
    got, whole = play("buffer", range(first, first + length)), play("buffer")
    np.testing.assert_allclose(got, whole, rtol=0, atol=2e-5)


@pytest.mark.parametrize("first", [20, 50, 80])
def test_a_longer_gap_is_braked_in_and_rejoined_inside_the_envelope(first: int) -> None:
    got, whole = play("buffer", range(first, first + 40)), play("buffer")
    speed = np.diff(got, prepend=[0.0] * 8) / 0.005
    assert np.abs(speed[6:] - speed[:-6]).max() / 0.03 <= 5.5 + 1e-3
    held = 2 * (first + 39)  # the last tick before a newer reference
    assert got[held] == got[held - 6]
    np.testing.assert_allclose(got[-1], whole[-1], rtol=0, atol=1e-9)


def residual_mrad(folder: Path, planner: str, time_s: float, *changes: str) -> float:
    """True residual swing of the shipped move with the right cable length, without a camera."""
    common = [
        f"experiment.planner={planner}",
        f"move.time_s={time_s}",
        "bench.pendulum.length_m=1.0",
        "experiment.watch_s=1",
        "experiment.quiet_s=0.3",
        "camera.rate_hz=0",
        "safety.reference_stale_ms=1000",
    ]
    chosen = config.read_experiment("move", [*common, *changes])
    folder.mkdir()
    ran = experiment.run(chosen, "virtual", folder, lambda *_: None, lambda *_: None)
    truth = RunAnalysis(ran.folder / LOG).summary.truth
    assert truth is not None
    residual_rad = truth.residual_swing_rad
    assert residual_rad is not None
    return residual_rad * 1e3


@pytest.mark.parametrize(
    ("planner", "time_s"),
    [
        ("matrix_exponential", 1.5),
        ("convolution", 1.5),
        ("collocation", 1.5),
        ("zv", 2.0),
        ("zvd", 3.0),
    ],
)
def test_losses_in_bursts_of_five_leave_the_swing_of_the_loss_free_run(
    tmp_path: Path, planner: str, time_s: float
) -> None:
    lossy = ["links.reference.loss=0.1", "links.reference.burst=5"]
    buffer = "controller.policy=buffer"
    bounded = residual_mrad(tmp_path / "a", planner, time_s)
    whole = residual_mrad(tmp_path / "b", planner, time_s, buffer)
    got = residual_mrad(tmp_path / "c", planner, time_s, buffer, *lossy)
    assert whole == pytest.approx(bounded, abs=0.05)
    assert got == pytest.approx(whole, abs=max(0.05, 0.1 * whole))
