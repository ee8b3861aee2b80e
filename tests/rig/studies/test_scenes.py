"""Scenes: those that are shipped, what their files may say, and the videos made of them."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from rig.errors import ConfigError
from rig.studies.vision import scene_page
from rig.studies.vision.scene import (
    make_scene,
    picture_size,
    read_scene,
    scene_frames,
    shipped_scenes,
)
from rig.studies.vision.stamps import is_kept, stamp_s
from rig.studies.vision.synthetic_video import COLUMNS, VideoFiles, write_video

ROOT = Path(__file__).parents[3]


def scene(text: str, tmp_path: Path, name: str = "mine"):
    path = tmp_path / f"{name}.toml"
    path.write_text(text)
    return read_scene(str(path))


def ignore(done: int) -> None:
    """Take the progress of a video."""


def test_at_least_forty_scenes_are_shipped_and_each_says_what_is_special() -> None:
    scenes = [read_scene(name) for name in shipped_scenes()]
    assert len(scenes) >= 40
    assert len({one.about for one in scenes}) == len(scenes)
    assert {one.expect for one in scenes} == {"angle", "refuse"}


@pytest.mark.parametrize("name", shipped_scenes())
def test_a_shipped_scene_gives_pictures_of_its_size_with_what_is_true(name: str) -> None:
    chosen = read_scene(name)
    frames = list(scene_frames(chosen, 3))
    assert 1 <= len(frames) <= 3
    for frame in frames:
        assert frame.picture.shape[:2] == picture_size(chosen)[::-1]
        assert frame.picture.dtype == np.uint8
        assert np.isfinite(frame.pivot_px).all()
        assert frame.bound_rad is None or 1e-7 < frame.bound_rad < 0.02
        if chosen.expect == "angle":
            assert frame.angle_rad is not None
            assert abs(frame.angle_rad) < 1.0


def test_equal_scenes_give_equal_pictures_and_the_seed_another_noise(tmp_path: Path) -> None:
    first, again = (next(scene_frames(read_scene("bayer"), 1)).picture for _ in range(2))
    np.testing.assert_array_equal(first, again)
    seeds = [
        next(scene_frames(read_scene("bayer", [f"scene.seed={seed}"]), 1)).picture
        for seed in (1, 2)
    ]
    assert (seeds[0] != seeds[1]).mean() > 0.3


def test_a_tracker_is_told_a_wrong_pivot_where_the_scene_says_so() -> None:
    right, wrong = (
        next(scene_frames(read_scene(name), 1)).pivot_px for name in ("clean", "pivot_4px_off")
    )
    assert np.subtract(wrong, right) == pytest.approx((4.5, 0.0))


def test_the_platform_of_a_scene_moves_the_pivot() -> None:
    columns = [frame.pivot_px[0] for frame in scene_frames(read_scene("moving_platform"), 100)]
    # the servo follows 0.4 Hz with 5 cm, 1000 px a metre
    assert max(columns) - 320.0 == pytest.approx(50.0, abs=1.0)


def test_links_of_a_scene_replace_the_pendulum_and_cameras_the_camera(tmp_path: Path) -> None:
    plant = read_scene("across").plant
    assert len(plant.links) == 1
    assert [camera.plane for camera in plant.cameras] == ["x", "y"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", r"section \[scene\] about: missing|about: missing"),
        ("[scene]\nabout = 'a'\nexpects = 'angle'", "expects: unknown key, did you mean 'expect'"),
        ("[scene]\nabout = 'a'\nexpect = 'guess'", "must be one of 'angle', 'refuse'"),
        ("[scene]\nabout = 'a'\n[scene.bars]\nmax_wrogn = 1", "did you mean 'max_wrong'"),
        (
            "[scene]\nabout = 'a'\n[model]\nlength_m = 1",
            r"\[model\] in scene 'mine'.*scene, camera",
        ),
        ("[scene]\nabout = 'a'\ncamera = 2", "camera 2 of 1; must be 1 to 1"),
        ("[scene]\nabout = 'a'\n[camera]\nrate_hz = 0", "rate_hz = 0: no pictures"),
        (
            "[scene]\nabout = 'a'\n[bench.camera]\npich_deg = 1",
            r"\[bench.camera\] pich_deg: unknown key, did you mean 'pitch_deg'",
        ),
        (
            "[scene]\nabout = 'a'\n[bench.camera]\nlens = { k9 = 1 }",
            r"\[bench.camera.lens\] k9: unknown key",
        ),
        (
            "[scene]\nabout = 'a'\n[bench.camera]\nshift_m = [0, 3, 0]",
            "behind the screen; the second value must be < 2 m",
        ),
        (
            "[scene]\nabout = 'a'\n[bench.camera]\nrow_us = 100",
            "480 rows take 48 ms; must be <= 20 ms",
        ),
        (
            "[scene]\nabout = 'a'\n[bench.camera]\nshift_m = [0, 1.5, 0]",
            "turned away from the home position or behind it",
        ),
        (
            "[scene]\nabout = 'a'\n[[bench.camera.objects]]\nkind = 'ghost'",
            r"kind = 'ghost'.*line, shadow, load, knots",
        ),
        (
            "[scene]\nabout = 'a'\n[[bench.camera.objects]]\nkind = 'line'\nwidth = 3",
            "width: unknown key, did you mean 'width_px'",
        ),
        (
            "[scene]\nabout = 'a'\n[[bench.camera.objects]]\nkind = 'line'\nwidth_px = -3",
            r"width_px = -3: expected `float` > 0",
        ),
    ],
)
def test_a_scene_that_cannot_be_is_refused_with_key_bound_and_next_step(
    text: str, told: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=told):
        scene(text, tmp_path)


def test_an_unknown_scene_is_named_with_the_nearest() -> None:
    with pytest.raises(ConfigError, match=r"'claen'.*did you mean 'clean'.*--list-scenes"):
        read_scene("claen")


@pytest.mark.parametrize("stamps", ["cfr", "vfr", "holes", "joined"])
def test_a_video_has_the_time_stamps_of_its_truth(stamps, tmp_path: Path) -> None:
    files = VideoFiles(tmp_path / "v.mkv", tmp_path / "t.csv", stamps)
    small = make_scene(
        "small",
        {"scene": {"about": "a"}, "camera": {"width": 160, "height": 120}},
    )
    written = write_video(small, 120, files, ignore)
    with files.truth.open() as file:
        rows = list(csv.DictReader(file))
    capture = cv2.VideoCapture(str(files.video))
    seen_s = []
    while capture.read()[0]:
        seen_s.append(capture.get(cv2.CAP_PROP_POS_MSEC) * 1e-3)
    told_s = [float(row["t_s"]) for row in rows]
    assert tuple(rows[0]) == COLUMNS
    assert len(seen_s) == len(rows) == written
    # a file of constant rate by OpenCV has stamps of whole milliseconds
    np.testing.assert_allclose(seen_s, told_s, atol=1e-4 if stamps != "cfr" else 1.1e-3)
    steps = np.diff(told_s)
    expected = {
        "cfr": {0.02},
        "vfr": {0.02, 0.04},
        "holes": {0.02, 0.22},
        "joined": {0.02, round(0.02 - 0.8, 9)},
    }
    assert set(np.round(steps, 9)) == expected[stamps]
    true_s = np.array([float(row["true_s"]) for row in rows])
    assert np.all(np.diff(true_s) > 0.0)


def test_frames_that_the_camera_drops_close_up_in_a_video_of_constant_rate(tmp_path: Path) -> None:
    files = VideoFiles(tmp_path / "v.avi", tmp_path / "t.csv", "cfr")
    written = write_video(read_scene("dropped_frames"), 60, files, ignore)
    with files.truth.open() as file:
        rows = list(csv.DictReader(file))
    assert 40 < written < 60
    np.testing.assert_allclose(
        [float(row["t_s"]) for row in rows], 0.02 * np.arange(written), atol=1e-9
    )
    assert float(rows[-1]["true_s"]) > float(rows[-1]["t_s"]) + 0.02


def test_the_truth_of_a_hidden_cable_is_empty(tmp_path: Path) -> None:
    files = VideoFiles(tmp_path / "v.avi", tmp_path / "t.csv", "cfr")
    patch = {"kind": "patch", "corner_px": [-320, 0], "size_px": [640, 600]}
    hidden = make_scene(
        "hidden", {"scene": {"about": "a"}, "bench": {"camera": {"objects": [patch]}}}
    )
    write_video(hidden, 2, files, ignore)
    with files.truth.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["picture_rad"] for row in rows] == ["", ""]
    assert math.isclose(float(rows[0]["angle_rad"]), 0.3, abs_tol=1e-3)


@pytest.mark.parametrize(
    ("video", "stamps", "told"),
    [
        ("v.txt", "cfr", r"ending '.txt' is not known; must be one of .avi, .mkv, .mp4"),
        ("v.avi", "vfr", r"ending '.avi' with stamps 'vfr'; must be one of .mkv"),
        ("no/v.avi", "cfr", r"folder '.*no' does not exist"),
    ],
)
def test_a_video_that_cannot_be_written_is_refused_before_it_is_rendered(
    video: str, stamps, told: str, tmp_path: Path
) -> None:
    files = VideoFiles(tmp_path / video, tmp_path / "t.csv", stamps)
    with pytest.raises(ConfigError, match=told):
        write_video(read_scene("clean"), 1000, files, ignore)
    assert not list(tmp_path.iterdir())


def test_a_codec_that_is_not_there_is_named(tmp_path: Path, monkeypatch) -> None:
    class Closed:
        def __init__(self, *_: object) -> None:
            pass

        def isOpened(self) -> bool:
            return False

        @staticmethod
        def fourcc(*_: str) -> int:
            return 0

    monkeypatch.setattr(cv2, "VideoWriter", Closed)
    files = VideoFiles(tmp_path / "v.avi", tmp_path / "t.csv", "cfr")
    with pytest.raises(ConfigError, match=r"no encoder FFV1 for '.avi'.*\.mp4.*--stamps vfr"):
        write_video(read_scene("clean"), 2, files, ignore)
    assert not list(tmp_path.iterdir())


def test_stamps_count_periods_from_the_first_frame() -> None:
    assert [k for k in range(7) if is_kept("vfr", k)] == [0, 1, 3, 4, 6]
    assert [k for k in range(205) if not is_kept("holes", k)] == [*range(90, 100), *range(190, 200)]
    assert stamp_s("joined", 49, 0.02, 100) == pytest.approx(0.98)
    assert stamp_s("joined", 50, 0.02, 100) == pytest.approx(0.2)


def test_the_page_of_the_scenes_is_the_one_their_files_make() -> None:
    told = (ROOT / "docs/scenes.md").read_text()
    assert told == scene_page.page(), "run: make docs"
    names = {path.stem for path in (ROOT / "docs/scenes").glob("*.jpg")}
    assert names == set(shipped_scenes())
