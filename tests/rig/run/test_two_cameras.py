"""A run with two cameras in virtual time: the swing along the move and the swing across it."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from comms.messages import SwingPlane
from comms.records import CompressedImage
from rig.analysis.analyze import RunAnalysis
from rig.analysis.identify.swing import truth_at
from rig.analysis.seen_swing import averaged
from rig.analysis.true_load import true_motion
from rig.run import experiment
from rig.run.config import read_experiment
from rig.run.runs import LOG
from rig.ui.report import write

BRIEF = ["experiment.watch_s=6", "record.pictures_hz=1"]
SLOW = ["vision.cameras.1.rate_hz=25", "bench.cameras.1.rate_hz=25"]
BLIND = ["bench.cameras.1.contrast=0"]  # a cable that is not seen


def run_of(folder: Path, *changes: str) -> tuple[experiment.FinishedRun, RunAnalysis]:
    chosen = read_experiment("two_cameras", [*BRIEF, *changes])
    ran = experiment.run(chosen, "virtual", folder, _quiet, _quiet)
    return ran, RunAnalysis(ran.folder / LOG)


def _quiet(*_: object) -> None:
    return None


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> RunAnalysis:
    return run_of(tmp_path_factory.mktemp("runs"))[1]


def rms_error_rad(analysis: RunAnalysis, camera: int, plane: int) -> float:
    """Rms of measured minus true angle after the move; the bound on both is that of a verdict."""
    run = analysis.run
    seen = averaged(run.angles_of(camera))
    motion = true_motion(run)
    angle_rad, rate_rad_s = motion.angles_rad[:, 0, plane], motion.rates_rad_s[:, 0, plane]
    after = (seen.t_s > run.t_settled_s) & (seen.t_s < motion.t_s[-1])
    expected_rad = truth_at(seen.t_s[after], motion.t_s, angle_rad, rate_rad_s)
    assert np.abs(expected_rad).max() > 0.3e-3
    return float(np.sqrt(np.mean((seen.angle_rad[after] - expected_rad) ** 2)))


def test_both_cameras_measure_the_swing_in_their_plane(whole: RunAnalysis) -> None:
    assert rms_error_rad(whole, 1, 0) < 0.02e-3
    assert rms_error_rad(whole, 2, 1) < 0.05e-3


def test_every_frame_of_both_cameras_gives_an_angle_of_its_plane_during_the_whole_move(
    whole: RunAnalysis,
) -> None:
    for camera, plane in ((1, SwingPlane.X), (2, SwingPlane.Y)):
        samples = [
            a for a in whole.run.angles_of(camera) if a.t_valid_ns * 1e-9 > whole.run.t_start_s
        ]
        assert len(samples) > 500
        assert {sample.swing_plane for sample in samples} == {plane}
        assert all(sample.valid for sample in samples)


def test_the_run_is_good_and_every_packet_of_both_cameras_is_accounted_for(
    whole: RunAnalysis,
) -> None:
    s = whole.summary
    assert (s.exit_status, s.verdict, s.reasons) == ("ok", "good", [])
    links = {name: row for name, row in s.links.items() if name[-1] in "12"}
    assert set(links) == {f"{kind}_{k}" for kind in ("platform", "frame", "angle") for k in (1, 2)}
    assert {row.unexplained for row in links.values()} == {0}
    assert links["frame_2"].delivered == links["angle_2"].sent > 500


def test_the_swing_across_is_that_of_the_push(whole: RunAnalysis) -> None:
    """An impulse F t on a mass m gives the amplitude F t / (m omega L)."""
    across = whole.summary.across
    assert across is not None
    amplitude_rad = 0.44 * 0.1 / (0.7 * np.sqrt(9.81))
    assert across.residual_rad == pytest.approx(amplitude_rad, rel=0.02)
    assert across.residual_rad == pytest.approx(across.true_residual_rad, rel=2e-3)
    assert across.peak_rad == pytest.approx(across.true_peak_rad, rel=0.02)
    assert (across.camera, across.frames) == (2, across.angles_valid)


def test_the_true_swing_beside_the_first_camera_is_that_along_the_move(whole: RunAnalysis) -> None:
    s = whole.summary
    assert s.truth is not None
    assert s.truth.residual_swing_rad == pytest.approx(s.planned.residual_swing_rad, rel=0.1)
    assert s.measured.residual_swing_rad == pytest.approx(s.truth.residual_swing_rad, rel=0.05)


def test_the_report_has_one_row_of_the_swing_across(whole: RunAnalysis, tmp_path: Path) -> None:
    page = write(tmp_path, whole).read_text(encoding="utf-8")
    across = whole.summary.across
    assert across is not None
    title, measured, true = across.row
    assert title == "across (camera 2): peak / residual, mrad"
    assert page.count(title) == 1
    assert measured in page
    assert true in page


def test_the_log_has_pictures_and_settings_of_both_cameras(whole: RunAnalysis) -> None:
    log = whole.run.log
    for topic in ("/camera/image", "/camera_2/image"):
        assert len(log.read(topic, CompressedImage)) >= 10
    second = msgspec.json.decode(log.attachments["vision_2.json"])
    assert (second["camera"], second["swing_plane"]) == (2, "y")


def test_a_camera_with_its_own_rate_gives_as_many_angles_and_the_same_swing(
    whole: RunAnalysis, tmp_path: Path
) -> None:
    _, slow = run_of(tmp_path, *SLOW)
    of_all, of_slow = whole.summary.across, slow.summary.across
    assert of_all is not None
    assert of_slow is not None
    assert slow.summary.verdict == "good"
    assert slow.summary.frames == whole.summary.frames
    assert of_slow.frames == pytest.approx(of_all.frames / 2, abs=2)
    assert of_slow.angles_valid == of_slow.frames
    assert of_slow.residual_rad == pytest.approx(of_all.residual_rad, rel=1e-3)


def test_equal_seeds_give_equal_digests(tmp_path: Path) -> None:
    brief = ["experiment.quiet_s=0.6", "experiment.watch_s=0.2"]
    digests = {run_of(tmp_path, *brief)[0].outcome.digest for _ in range(2)}
    assert len(digests) == 1


def test_a_run_stops_when_the_second_camera_sees_no_cable(tmp_path: Path) -> None:
    ran, _ = run_of(tmp_path, *BLIND)
    (reason,) = ran.outcome.reasons
    assert ran.outcome.exit_code == 5
    assert reason.startswith("streamer: no valid cable angle of camera 2 for 3")
    assert "(last reason: no_cable)" in reason


def test_a_run_with_more_swing_across_than_allowed_does_not_start(tmp_path: Path) -> None:
    ran, _ = run_of(tmp_path, "bench.pushes.0.at_s=0.1")
    (reason,) = ran.outcome.reasons
    assert ran.outcome.exit_code == 3
    assert " mrad in the plane y before the start; must be <= 10.00 mrad" in reason
