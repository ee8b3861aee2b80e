"""The picture without the cable: taken from the tour, kept beside the file, used in a run."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import cv2
import msgspec
import numpy as np
import pytest

from rig.analysis.identify.swing import truth_at
from rig.analysis.run_log import RunLog
from rig.analysis.true_load import true_motion
from rig.errors import ConfigError
from rig.run import experiment
from rig.run.calibration import file as calibration_file
from rig.run.calibration import static_scene
from rig.run.calibration import tour as calibration_run
from rig.run.config import Experiment, read_experiment
from rig.run.runs import LOG

SMALL = (
    *("bench.camera.pitch_deg=0", "camera.width=320", "camera.height=240"),
    *("bench.camera.pixels_per_m=500", "camera.rate_hz=20", "bench.robot.kind=cartesian"),
    *("vision.rough_pivot_px=[160,-20]", "vision.rough_pixels_per_m=500"),
)
RUN = (
    "experiment.quiet_s=0.5",
    "experiment.watch_s=2.5",
    "vision.average_frames=1",
    "bench.pendulum.initial_swing_rad=0.2",
)
POINT_M, POINT_PX = 0.1, 50.0  # of the tour, from home
BESIDE_PX = 12.0


def with_lines(*places_px: float) -> str:
    """Key of upright static lines beside the pivot at home."""
    items = ",".join(f'{{kind="line",at_px=[{place},0]}}' for place in places_px)
    return f"bench.camera.objects=[{items}]"


def ran(chosen: Experiment, folder: Path, motion=None) -> RunLog:
    done = experiment.run(chosen, "virtual", folder, _quiet, _quiet, motion)
    assert done.outcome.exit_code == 0, done.outcome.reasons
    return RunLog.open(done.folder / LOG)


def _quiet(*_: object) -> None:
    return None


class Toured(NamedTuple):
    """Calibration from a tour before two static lines."""

    path: Path
    calibration: calibration_file.Calibration

    def settings(self, **changed: object) -> str:
        """Key that uses it, with other keys, from another file in the same folder."""
        other = self.path.with_name("other.toml")
        calibration_file.save(msgspec.structs.replace(self.calibration, **changed), other)
        return f"vision.calibration={other}"


@pytest.fixture(scope="module")
def toured(tmp_path_factory: pytest.TempPathFactory) -> Toured:
    folder = tmp_path_factory.mktemp("tour")
    base = read_experiment(
        "move", [*SMALL, with_lines(BESIDE_PX, POINT_PX), "record.pictures_hz=0"]
    )
    chosen = calibration_run.experiment_for(base)
    tour = calibration_run.tour(chosen, (-POINT_M, 0.0, POINT_M))
    log = ran(chosen, folder, tour.motion)
    scene = static_scene.scene_of_tour(log.log.path)
    assert scene is not None
    _, calibration = calibration_run.fit(log, chosen, tour.dwells_s, scene)
    path = folder / "cal.toml"
    name = static_scene.save(scene, path)
    calibration = msgspec.structs.replace(calibration, static_scene=name)
    calibration_file.save(calibration, path)
    return Toured(path, calibration)


def seen(toured_key: str, *changes: str, folder: Path) -> tuple[RunLog, np.ndarray, Counter[str]]:
    """Run a free swing; return its log, the errors [rad] and the reasons of all angles."""
    log = ran(read_experiment("free_decay", [*SMALL, *RUN, toured_key, *changes]), folder)
    motion = true_motion(log)
    start_s = log.t_start_s or 0.0
    samples = [a for a in log.angles if start_s < a.t_valid_ns * 1e-9 < motion.t_s[-1]]
    valid = [a for a in samples if a.cable is not None]
    t_s = np.array([a.t_valid_ns * 1e-9 for a in valid])
    true = truth_at(t_s, motion.t_s, motion.angles_rad[:, 0, 0], motion.rates_rad_s[:, 0, 0])
    found = np.array([a.cable.angle_rad for a in valid if a.cable is not None])
    return log, found - true, Counter(a.reason.value for a in samples)


def test_the_picture_of_the_tour_has_the_lines_and_not_the_cable(toured: Toured) -> None:
    picture = cv2.imread(str(toured.path.with_name("cal_static.png")), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    # the simulated screen has the level 200, a line is darker by 0.825 of it
    column = np.arange(320)
    places = 160.0 + np.array([BESIDE_PX, POINT_PX])
    apart = np.abs(column[:, None] - places).min(axis=1)
    assert np.abs(picture[:, apart > 6.0].astype(float) - 200.0).max() < 6.0
    assert picture[:, apart < 1.0].mean() < 80.0


def test_a_position_at_which_the_cable_hangs_before_a_static_line_is_left_out(
    toured: Toured,
) -> None:
    assert toured.calibration.x_m == pytest.approx([-POINT_M, 0.0], abs=1e-4)
    # a camera without pitch has no offset
    assert np.abs(toured.calibration.offset_rad).max() < 20e-6


def test_a_run_beside_the_lines_has_right_angles_and_says_that_they_are_removed(
    toured: Toured, tmp_path: Path
) -> None:
    lines = with_lines(BESIDE_PX, POINT_PX)
    log, error_rad, reasons = seen(f"vision.calibration={toured.path}", lines, folder=tmp_path)
    assert log.log.metadata["run.start"]["static_scene"] == "removed"
    assert reasons["none"] > 0.7 * reasons.total()
    assert np.abs(error_rad).max() < 2e-3


def test_a_camera_that_was_moved_since_gives_no_angle(toured: Toured, tmp_path: Path) -> None:
    moved = with_lines(BESIDE_PX - 4.0, POINT_PX - 4.0)
    used = f"vision.calibration={toured.path}"
    free = "safety.angle_stale_ms=9999"
    _, error_rad, reasons = seen(used, moved, free, folder=tmp_path)
    assert not error_rad.size
    assert reasons["scene_moved"] > 10


def refusal(toured: Toured, **changed: object) -> str:
    _, _, path = toured.settings(**changed).partition("=")
    with pytest.raises(ConfigError) as error:
        static_scene.find(path, calibration_file.read(Path(path)))
    return str(error.value)


def test_a_picture_that_is_not_there_is_named_with_the_next_step(toured: Toured) -> None:
    said = refusal(toured, static_scene="no.png")
    assert "no.png' of calibration '" in said
    assert "No such file or directory; must be the picture that `rig calibrate offsets`" in said
    assert "remove the key static_scene" in said


def test_a_picture_of_another_size_is_refused_with_both(toured: Toured) -> None:
    said = refusal(toured, width=640, height=480)
    assert "is a picture of (320, 240); must be (640, 480) as the calibration: calibrate" in said


@pytest.mark.parametrize("data", [b"", b"no picture", None])
def test_a_file_that_is_no_grey_picture_is_refused(data: bytes | None, toured: Toured) -> None:
    if data is None:  # colours
        data = cv2.imencode(".png", np.zeros((240, 320, 3), np.uint8))[1].tobytes()
    toured.path.with_name("bad.png").write_bytes(data)
    assert "is not a grey picture of 8 bits; must be a whole PNG" in refusal(
        toured, static_scene="bad.png"
    )


@pytest.mark.parametrize("name", ["../cal.png", "/cal.png", "cal.jpg"])
def test_the_picture_is_a_png_in_the_folder_of_the_file(name: str, toured: Toured) -> None:
    _, _, path = toured.settings(static_scene=name).partition("=")
    with pytest.raises(ConfigError, match="static_scene"):
        calibration_file.read(Path(path))


def test_a_file_without_a_picture_uses_none(toured: Toured) -> None:
    bare = msgspec.structs.replace(toured.calibration, static_scene=None)
    assert static_scene.find("cal.toml", bare) is None
    assert static_scene.find("none", None) is None
    assert "static_scene" not in calibration_file.text(bare)
