"""Cameras of an experiment: beliefs, their check against the bench, and the settings of tasks."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from comms.messages import SwingPlane
from rig.errors import ConfigError
from rig.run import experiment
from rig.run.calibration import file as calibration_file
from rig.run.calibration.tour import experiment_for
from rig.run.cameras import cameras
from rig.run.config import read_experiment
from rig.run.job import Job, plan_move, prepare
from rig.run.joint_job import prepare_joint
from rig.run.run_metadata import start_metadata
from rig.run.runtime import bench

MS = 1_000_000
THREE = "[{plane='x'}, {plane='y'}, {plane='x'}]"


def prepared(*changes: str, name: str = "two_cameras") -> Job:
    """Job of an experiment with changes."""
    chosen = read_experiment(name, list(changes))
    return prepare(chosen, plan_move(chosen), bench.plant(chosen))


def refusal(*changes: str, name: str = "two_cameras") -> str:
    """Error text of a refused experiment."""
    with pytest.raises(ConfigError) as error:
        prepared(*changes, name=name)
    return str(error.value)


def test_without_a_list_there_is_one_camera_with_the_values_of_vision() -> None:
    (camera,) = cameras(read_experiment("move", ["camera.rate_hz=40"]))
    assert (camera.number, camera.plane, camera.calibration) == (1, SwingPlane.X, "shipped")
    assert (camera.rough_pivot_px, camera.rough_pixels_per_m) == ((321.0, -38.0), 1005.0)
    assert camera.rate_hz == 40.0


def test_a_camera_has_its_own_values_and_those_of_vision_for_the_rest() -> None:
    changes = ["vision.rough_pixels_per_m=900", "vision.cameras.0.rate_hz=25"]
    first, second = cameras(read_experiment("two_cameras", changes))
    assert (first.plane, second.plane) == (SwingPlane.X, SwingPlane.Y)
    assert (first.calibration, second.calibration) == ("shipped", "none")
    assert (first.rough_pivot_px, second.rough_pivot_px) == ((321.0, -38.0), (320.0, -40.0))
    assert (first.rough_pixels_per_m, second.rough_pixels_per_m) == (900.0, 1000.0)
    assert (first.rate_hz, second.rate_hz) == (25.0, 50.0)


def test_a_run_without_a_camera_has_none_with_a_rate() -> None:
    chosen = read_experiment("two_cameras", ["camera.rate_hz=0", "vision.cameras.1.rate_hz=25"])
    assert [camera.rate_hz for camera in cameras(chosen)] == [0.0, 0.0]
    job = prepared("camera.rate_hz=0")
    assert job.settings["streamer"].cameras == []
    assert {"vision", "vision_2"} <= job.settings.keys()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (["vision.cameras=[]"], "[bench] has 2 cameras, [vision] has 1; they must be equal"),
        (["bench.cameras=[]"], "[bench] has 1 cameras, [vision] has 2; they must be equal"),
        ([f"vision.cameras={THREE}"], "[bench] has 2 cameras, [vision] has 3"),
        (
            ["vision.cameras.1.plane=x"],
            "[[vision.cameras]] number 2: plane = 'x'; must be 'y', that of camera 2 of [bench]",
        ),
        (
            ["bench.cameras.0.plane=y"],
            "[[vision.cameras]] number 1: plane = 'x'; must be 'y', that of camera 1 of [bench]",
        ),
        (
            ["vision.cameras.0.plane=y", "bench.cameras.0.plane=y"],
            "[[vision.cameras]] number 1: plane = 'y'; must be 'x' for the first camera",
        ),
        (
            ["vision.cameras.1.plane=z"],
            "[vision.cameras.1] plane = 'z': must be one of 'x', 'y'; correct the value",
        ),
        (
            ["vision.cameras=[{}, {}, {}, {}]"],
            "[vision] cameras = [{}, {}, {}, {}]: expected `array` of length <= 3",
        ),
        (["bench.cameras=[{}, {}, {}, {}]"], "4 of [[bench.cameras]]; must be at most 3"),
    ],
)
def test_cameras_that_do_not_agree_are_refused(changes: list[str], expected: str) -> None:
    assert refusal(*changes).startswith(expected)


def test_a_camera_that_looks_at_another_plane_than_believed_is_refused() -> None:
    said = refusal("bench.camera.plane=y", name="move")
    assert said.startswith("[vision]: plane = 'x'; must be 'y', that of camera 1 of [bench]")


def test_nothing_is_left_behind_by_cameras_that_do_not_agree(tmp_path: Path) -> None:
    chosen = read_experiment("two_cameras", ["vision.cameras.1.plane=x"])
    with pytest.raises(ConfigError):
        experiment.run(chosen, "virtual", tmp_path, lambda *_: None, lambda *_: None)
    assert not list(tmp_path.iterdir())


def test_each_camera_has_a_task_with_its_number_plane_pivot_and_period() -> None:
    job = prepared("vision.cameras.1.rate_hz=25", "bench.cameras.1.rate_hz=25")
    assert list(job.settings) == ["bench", "controller", "vision", "vision_2", "streamer"]
    first, second = job.settings["vision"], job.settings["vision_2"]
    assert (first.camera, first.swing_plane, first.period_ns) == (1, SwingPlane.X, 20 * MS)
    assert (second.camera, second.swing_plane, second.period_ns) == (2, SwingPlane.Y, 40 * MS)
    assert (second.pivot_home_px, second.pixels_per_m, second.x_m) == ((320.0, -40.0), 1000.0, [])
    assert len(first.x_m) == 5
    assert job.settings["controller"].cameras == 2


def test_three_cameras_have_three_tasks() -> None:
    beliefs = THREE.replace("}, {plane='y'}", "}, {plane='y', calibration='none'}")
    beliefs = beliefs.replace(", {plane='x'}]", ", {plane='x', calibration='none'}]")
    job = prepared(f"vision.cameras={beliefs}", f"bench.cameras={THREE}")
    assert [name for name in job.settings if name.startswith("vision")] == [
        "vision",
        "vision_2",
        "vision_3",
    ]
    assert [camera.number for camera in job.settings["streamer"].cameras] == [1, 2, 3]


def test_an_angle_is_stale_after_the_bound_or_after_three_periods_of_a_slow_camera() -> None:
    slow = ["vision.cameras.1.rate_hz=5", "bench.cameras.1.rate_hz=5"]
    for changes, expected_ms in (([], 300), (slow, 600)):
        first, second = prepared(*changes).settings["streamer"].cameras
        assert (first.number, first.plane, first.stale_ns) == (1, SwingPlane.X, 300 * MS)
        assert (second.number, second.plane, second.stale_ns) == (
            2,
            SwingPlane.Y,
            expected_ms * MS,
        )


def test_the_log_gets_settings_and_calibration_of_every_camera(tmp_path: Path) -> None:
    chosen = read_experiment("two_cameras", [])
    first, second = cameras(chosen)
    _, shipped = calibration_file.find(chosen, first)
    assert shipped is not None
    assert calibration_file.find(chosen, second) == ("none", None)
    across = msgspec.structs.replace(shipped, number=2, plane="y", pixels_per_m=1000.0)
    calibration_file.save(across, tmp_path / "across.toml")
    job = prepared(f"vision.cameras.1.calibration={tmp_path}/across.toml")
    files = job.attachments()
    assert job.calibration_name == f"2026-11-22_red_plane.toml, {tmp_path}/across.toml"
    assert files["calibration_2.toml"] == (tmp_path / "across.toml").read_bytes()
    assert msgspec.json.decode(files["vision_2.json"])["swing_plane"] == "y"
    assert "calibration_2.toml" not in prepared().attachments()


def test_the_calibration_of_another_camera_is_refused() -> None:
    said = refusal("vision.cameras.1.calibration=shipped")
    assert said.startswith(
        "calibration '2026-11-22_red_plane.toml' is of camera 1 in the plane x; "
        "must be of camera 2 in the plane y: give [[vision.cameras]] number 2 its own file"
    )


def test_a_missing_calibration_names_the_camera() -> None:
    said = refusal("vision.cameras.1.calibration=nowhere.toml")
    assert said.startswith("[[vision.cameras]] number 2 calibration = 'nowhere.toml': no such")


def test_the_calibration_tour_uses_no_calibration_of_any_camera() -> None:
    chosen = experiment_for(read_experiment("two_cameras", []))
    assert [camera.calibration for camera in cameras(chosen)] == ["none", "none"]


def test_a_camera_in_an_experiment_of_a_joint_is_refused() -> None:
    chosen = read_experiment("joint_1", ["bench.cameras=[{}]"])
    with pytest.raises(ConfigError, match=r"\[bench\.cameras\] .* has no effect there"):
        prepare_joint(chosen, bench.plant(chosen))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ([], "corrected, uncorrected"),
        (["vision.calibration=none"], "uncorrected, uncorrected"),
        (["camera.rate_hz=0"], "no camera"),
    ],
)
def test_the_metadata_say_which_angles_are_corrected_for_the_pitch(
    changes: list[str], expected: str
) -> None:
    assert start_metadata(prepared(*changes), "virtual", "r")["angle_scale"] == expected


def test_each_camera_has_its_own_distance() -> None:
    changes = ["vision.camera_distance_m=1.2", "vision.cameras.1.camera_distance_m=0.8"]
    job = prepared(*changes)
    distances = [job.settings[name].camera_distance_m for name in ("vision", "vision_2")]
    assert distances == [1.2, 0.8]


def test_a_calibration_steeper_than_any_pitch_is_refused(tmp_path: Path) -> None:
    move = read_experiment("move", [])
    _, shipped = calibration_file.find(move, cameras(move)[0])
    assert shipped is not None
    steep = msgspec.structs.replace(shipped, offset_rad=[x_m * 4.0 for x_m in shipped.x_m])
    calibration_file.save(steep, tmp_path / "steep.toml")
    said = refusal(f"vision.calibration={tmp_path / 'steep.toml'}", name="move")
    assert "steep.toml': offset table with a slope of 4 rad/m" in said
