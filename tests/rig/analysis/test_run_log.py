"""Swing and truth of a log whose load has several links, or none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from comms.messages import AngleSample, InvalidReason, LinkAngle, LinkMotion, SwingPlane, Truth
from rig.analysis.run_log import RunLog
from rig.run.config import read_experiment
from rig.run.job import plan_move, prepare
from rig.run.recorder import Recorder
from rig.run.runtime import bench

START = {
    "run_id": "r",
    "mode": "virtual",
    "experiment": "move",
    "kind": "move",
    "angle_scale": "corrected",
}
HOME = (0.0, 0.0, 0.0)


def truth(t_ns: int, links: int) -> Truth:
    """Truth of a chain; the angles and rates name the link and the plane."""
    chain = [
        LinkMotion(
            angle_x_rad=0.1 + k, angle_y_rad=0.2 + k, rate_x_rad_s=0.3 + k, rate_y_rad_s=0.4 + k
        )
        for k in range(links)
    ]
    return Truth(
        seq=t_ns, t_ns=t_ns, position_m=(0.5, 0.6, 0.7), velocity_m_s=HOME, links=tuple(chain)
    )


def angle(t_ns: int, links: int) -> AngleSample:
    """Angle sample of a chain; the angles name the link."""
    chain = [
        LinkAngle(
            angle_rad=0.1 + 0.3 * k,
            sigma_rad=0.01 + 0.3 * k,
            raw_rad=0.15 + 0.3 * k,
            offset_rad=0.05,
            joint_px=(320.0, 100.0 * k),
        )
        for k in range(links)
    ]
    return AngleSample(
        seq=t_ns,
        t_ns=t_ns,
        t_valid_ns=t_ns,
        swing_plane=SwingPlane.X,
        valid=links > 0,
        reason=InvalidReason.NONE if links else InvalidReason.NO_CABLE,
        platform_m=0.0,
        rows=400,
        residual_px=0.1,
        pivot_miss_px=0.0,
        background=200.0,
        saturation=0.0,
        links=tuple(chain),
    )


@pytest.fixture
def run(tmp_path: Path) -> RunLog:
    """Log of messages of one link, of three and of none."""
    chosen = read_experiment("move", [])
    attachments = prepare(chosen, plan_move(chosen), bench.plant(chosen)).attachments()
    recorder = Recorder(tmp_path / "run.mcap", START, attachments, 0)
    for t_ns, links in ((10, 1), (20, 3), (30, 0)):
        recorder.message("truth", truth(t_ns, links), t_ns)
        recorder.message("angle_1", angle(t_ns, links), t_ns)
    recorder.close({}, {"exit_status": "ok", "exit_code": "0"}, 40)
    return RunLog.open(tmp_path / "run.mcap")


def test_the_truth_is_that_of_the_link_at_the_platform_along_x(run: RunLog) -> None:
    expected = [[10e-9, 0.1, 0.3, 0.5], [20e-9, 0.1, 0.3, 0.5]]
    assert run.truth == pytest.approx(np.array(expected))


def test_the_swing_is_that_of_the_link_at_the_platform(run: RunLog) -> None:
    assert [sample.valid for sample in run.angles] == [True, True, False]
    for t_s, angle_rad, sigma_rad in (run.swing, run.single_frames):
        assert t_s == pytest.approx([10e-9, 20e-9])
        assert angle_rad == pytest.approx([0.1, 0.1])
        assert sigma_rad[0] == sigma_rad[1] > 0.0
