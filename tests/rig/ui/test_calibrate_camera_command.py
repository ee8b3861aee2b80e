"""`rig calibrate camera`, and runs with the file that it writes."""

from __future__ import annotations

import json
import tomllib
from importlib import resources
from pathlib import Path

import pytest

from rig.analysis.analyze import RunAnalysis
from rig.errors import ConfigError, Refused
from rig.run import experiment
from rig.run.calibration import camera_file
from rig.run.cameras import cameras
from rig.run.config import read_experiment
from rig.run.job import plan_move, prepare
from rig.run.runs import LOG
from rig.run.runtime import bench

SCENES = resources.files("rig.studies.vision") / "scenes"
CAMERA = (
    *("bench.camera.pitch_deg=3", "bench.camera.roll_deg=2", "bench.camera.yaw_deg=2"),
    *("bench.camera.lens.k1=-0.1", "bench.robot.kind=cartesian"),
)
BRIEF = ("experiment.quiet_s=0.6", "experiment.watch_s=2.5")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with videos of chessboard and marks, and the places of the marks."""
    return tmp_path_factory.mktemp("camera")


@pytest.fixture
def calibrated(rig, folder, monkeypatch) -> Path:
    """Camera file of the camera of the scenes, made once."""
    monkeypatch.chdir(folder)
    path = folder / "cam.toml"
    if path.exists():
        return path
    marks = tomllib.loads((SCENES / "marks.toml").read_text())["bench"]["camera"]["objects"]
    places = [",".join(map(str, mark["place_m"])) for mark in marks]
    (folder / "places.csv").write_text("x_m,y_m,z_m\n" + "\n".join(places) + "\n")
    for scene, count in (("chessboard", 16), ("marks", 2)):
        words = f"sim --scene {scene} --frames {count} --video {scene}.avi --truth t.csv"
        assert rig(*words.split())[0] == 0
    words = "calibrate camera chessboard.avi --marks marks.avi --places places.csv --out cam.toml"
    code, said, _ = rig(*words.split())
    assert code == 0
    assert "16 poses of the board, reprojection 0.0" in said
    assert "12 marks, reprojection 0.0" in said
    assert "use it with --set vision.camera=cam.toml" in said
    return path


def prepared(*changes: str, name: str = "move") -> object:
    chosen = read_experiment(name, list(changes))
    return prepare(chosen, plan_move(chosen), bench.plant(chosen))


def test_the_file_has_lens_and_pose(calibrated: Path) -> None:
    file = camera_file.read(calibrated)
    assert (file.width, file.height, file.boards) == (640, 480, 16)
    assert file.focal_px == pytest.approx((1000.0, 1000.0), abs=5.0)
    assert file.distortion[0] == pytest.approx(-0.1, abs=0.01)
    assert file.pose is not None
    assert file.pose.marks == 12
    saved = calibrated.with_name("again.toml")
    camera_file.save(file, saved)
    assert camera_file.read(saved) == file


def test_a_moved_camera_needs_only_the_marks_again(rig, calibrated: Path) -> None:
    words = "calibrate camera --lens cam.toml --marks marks.avi --places places.csv --out b.toml"
    code, said, _ = rig(*words.split(), "--json")
    assert code == 0
    document = json.loads(said)
    before = camera_file.read(calibrated)
    assert document["camera"]["focal_px"] == list(before.focal_px)
    assert before.pose is not None
    expected = pytest.approx(before.pose.translation_m, abs=1e-6)
    assert document["camera"]["pose"]["translation_m"] == expected


def test_a_lens_without_a_pose_cannot_be_used_in_a_run(rig, calibrated: Path) -> None:
    assert rig("calibrate", "camera", "chessboard.avi", "--out", "lens.toml")[0] == 0
    with pytest.raises(ConfigError, match=r"lens.toml' has no \[pose\].*--lens FILE --marks"):
        prepared("vision.camera=lens.toml")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("", "BOARDS and --lens; must be one of the two"),
        ("chessboard.avi --lens cam.toml", "BOARDS and --lens; must be one of the two"),
        ("chessboard.avi --marks marks.avi", "--marks and --places; must be given together"),
        ("--lens cam.toml", "--lens without --marks"),
        ("chessboard.avi --corners nine", "--corners nine; must be two numbers of 3 to 40"),
        ("chessboard.avi --plane z", "--plane z; must be x or y"),
        ("nowhere.png", "'nowhere.png': no picture that OpenCV can read"),
        ("nowhere.avi", "nowhere.avi: no such file"),
        ("marks.avi", "no board of 9 x 6 inner corners in 2 pictures"),
        ("empty", "'empty': a folder without pictures"),
        (
            "--lens cam.toml --marks marks.avi --places head.csv",
            "header x,y,z; must be x_m,y_m,z_m",
        ),
        ("--lens cam.toml --marks marks.avi --places word.csv", "line 3: 0,a,0; must be three"),
        (
            "--lens cam.toml --marks marks.avi --places off.csv",
            "number 2 at [-0.038, 0.0, -0.25] m",
        ),
    ],
)
def test_what_cannot_be_calibrated_is_named(
    rig, calibrated: Path, words: str, expected: str
) -> None:
    lines = (calibrated.parent / "places.csv").read_text().splitlines()
    Path("empty").mkdir(exist_ok=True)
    Path("head.csv").write_text("x,y,z\n0,0,0\n")
    Path("word.csv").write_text("x_m,y_m,z_m\n0,0,0\n0,a,0\n")
    Path("off.csv").write_text("\n".join([*lines[:2], "-0.038,0.0,-0.25", *lines[3:]]))
    code, _, why = rig("calibrate", "camera", *words.split())
    # 6: the pictures themselves cannot be used
    assert code == (6 if "number 2" in expected or "no board" in expected else 2)
    assert expected in " ".join(why.split())


def test_a_free_swing_is_right_through_a_turned_camera_with_a_lens(
    calibrated: Path, tmp_path: Path
) -> None:
    changes = [*CAMERA, f"vision.camera={calibrated}", "bench.pendulum.initial_swing_rad=0.15"]
    chosen = read_experiment("free_decay", [*changes, "experiment.watch_s=6"])
    ran = experiment.run(chosen, "virtual", tmp_path, lambda *_: None, lambda *_: None)
    analysis = RunAnalysis(ran.folder / LOG)
    summary = analysis.summary
    assert summary.angles_valid == summary.frames
    assert summary.truth is not None
    assert summary.measured.residual_swing_rad == pytest.approx(
        summary.truth.residual_swing_rad, rel=1e-3
    )
    assert analysis.run.log.metadata["run.start"]["angle_scale"] == "corrected"
    assert analysis.run.log.attachments["camera.toml"].decode() == calibrated.read_text()


def test_a_vertical_move_is_followed_with_a_camera_file(calibrated: Path, tmp_path: Path) -> None:
    changes = ["move.axis=z", "move.distance_m=0.08", "experiment.planner=law", *CAMERA, *BRIEF]
    with pytest.raises(Refused, match=r"0\.080 m along z, and camera 1 follows the pivot along x"):
        prepared(*changes)
    chosen = read_experiment("move", [*changes, f"vision.camera={calibrated}"])
    ran = experiment.run(chosen, "virtual", tmp_path, lambda *_: None, lambda *_: None)
    assert ran.outcome.exit_code == 0
    summary = RunAnalysis(ran.folder / LOG).summary
    assert summary.angles_valid == summary.frames
    assert summary.swing_error.outside_move_rad is not None
    assert summary.swing_error.outside_move_rad < 0.1e-3


def test_a_move_along_y_needs_a_camera_that_sees_it(calibrated: Path) -> None:
    with pytest.raises(Refused, match="no camera sees the swing along y; must have one"):
        prepared("move.axis=y", f"vision.camera={calibrated}")


def test_the_offsets_that_the_camera_file_leaves_are_measured_with_it(
    rig, calibrated: Path, tmp_path: Path
) -> None:
    out = tmp_path / "rest.toml"
    keys = [*CAMERA, f"vision.camera={calibrated}", "camera.rate_hz=25"]
    changes = [word for key in keys for word in ("--set", key)]
    code, said, _ = rig("calibrate", "offsets", "--virtual", "--out", str(out), "--json", *changes)
    assert code == 0
    made = json.loads(said)["calibration"]
    assert made["camera_made"] == camera_file.read(calibrated).made
    assert max(map(abs, made["offset_rad"])) < 0.3e-3
    use = [*CAMERA, f"vision.calibration={out}"]
    with pytest.raises(ConfigError, match=r"camera file of '2.*must be with.*none"):
        prepared(*use)
    assert prepared(*use, f"vision.camera={calibrated}")


def test_a_move_out_of_the_picture_is_refused_through_the_camera_file(calibrated: Path) -> None:
    far = ["safety.position_max_m=1.5", "limits.speed_m_s=2", "limits.acceleration_m_s2=9"]
    file = f"vision.camera={calibrated}"
    assert prepared(file, *CAMERA)
    with pytest.raises(Refused, match="out of the picture"):
        prepared(file, *CAMERA, *far, "move.distance_m=0.45", "move.time_s=3")
    up = ["move.axis=z", "experiment.planner=law", "safety.height_m=2", "move.time_s=8"]
    with pytest.raises(Refused, match="above, below or behind the picture"):
        prepared(file, *CAMERA, *far, *up, "move.distance_m=1.5")


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (["vision.camera=nowhere.toml"], "camera file 'nowhere.toml': no such file"),
        (["vision.camera=cam.toml", "camera.width=320"], r"for pictures of \(640, 480\)"),
        (["vision.camera=bad.toml"], r"\[camera file\] focal_px"),
        (["vision.camera=y.toml"], "of a camera of the plane y; must be of the plane x"),
        (["vision.camera=back.toml"], "behind the camera"),
    ],
)
def test_a_camera_file_that_does_not_fit_is_refused(
    calibrated: Path, changes: list[str], expected: str
) -> None:
    text = calibrated.read_text()
    Path("bad.toml").write_text(text.replace("focal_px = [", 'focal_px = ["a", ', 1))
    Path("y.toml").write_text(text.replace('plane = "x"', 'plane = "y"'))
    lines = text.splitlines()
    turned = ["translation_m = [0, 0, -1]" if a.startswith("translation_m") else a for a in lines]
    Path("back.toml").write_text("\n".join(turned))
    with pytest.raises(ConfigError, match=expected):
        prepared(*changes)


def test_each_camera_has_its_own_file() -> None:
    changes = ["vision.camera=a.toml", "vision.cameras.1.camera=b.toml"]
    first, second = cameras(read_experiment("two_cameras", changes))
    assert (first.file, second.file) == ("a.toml", "b.toml")
