"""`rig track` on a video: what it finds by itself, what it writes, and what it advises."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest
from mcap.reader import make_reader

from comms.mcap_log import read_log
from comms.messages import AngleSample
from comms.records import CompressedImage
from rig.run.calibration import camera_file
from rig.run.calibration.camera_file import CameraFile, PoseTable
from rig.run.calibration.file import Calibration, save

WIDTH, HEIGHT = 240, 180
PIVOT_PX = (118.0, -25.0)
RATE_HZ = 50.0
PERIOD_S = 0.8
AMPLITUDE_RAD = 0.15
FRAMES = 60
Drawing = Callable[[float], np.ndarray[Any, np.dtype[np.float64]]]


def angle_at(t_s: float) -> float:
    return AMPLITUDE_RAD * math.cos(math.tau * t_s / PERIOD_S)


def darkness(angle_rad: float, pivot_px: tuple[float, float] = PIVOT_PX) -> np.ndarray:
    """Darkness 0..1 of a Gaussian cable, 2.5 px wide, in each pixel."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    distance_px = (u - pivot_px[0]) * math.cos(angle_rad) - (v - pivot_px[1]) * math.sin(angle_rad)
    return np.exp(-0.5 * np.square(distance_px / 1.2))


def swinging(t_s: float) -> np.ndarray:
    return 200.0 - 150.0 * darkness(angle_at(t_s))


def written(path: Path, drawing: Drawing, frames: int = FRAMES, colour: bool = False) -> Path:
    """Write a lossless video of pictures with noise, or several planes of one."""
    random = np.random.default_rng(5)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FFV1"), RATE_HZ, (WIDTH, HEIGHT))
    for frame in range(frames):
        levels = drawing(frame / RATE_HZ)
        shape = levels.shape if colour else (HEIGHT, WIDTH, 1)
        noisy = levels.reshape(shape) + random.normal(0.0, 2.0, shape)
        grey = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
        writer.write(np.ascontiguousarray(np.broadcast_to(grey, (HEIGHT, WIDTH, 3))))
    writer.release()
    return path


@pytest.fixture(scope="module")
def video(tmp_path_factory) -> Path:
    return written(tmp_path_factory.mktemp("video") / "swing.avi", swinging)


def rows_of(path: str) -> list[dict[str, str]]:
    with Path(path).open(newline="") as file:
        return list(csv.DictReader(file))


def calibration_file(path: Path, **changes: Any) -> Path:
    values: dict[str, Any] = {
        "made": "2026-11-30T00:00:00+00:00",
        "camera": "test",
        "seed": 1,
        "width": WIDTH,
        "height": HEIGHT,
        "pivot_home_px": PIVOT_PX,
        "pixels_per_m": 400.0,
        "x_m": [-0.2, 0.0, 0.2],
        "offset_rad": [0.012, 0.012, 0.012],
        "sigma_offset_rad": [1e-6] * 3,
    }
    save(Calibration(**(values | changes)), path)
    return path


def test_a_video_needs_no_option(rig, video) -> None:
    code, said, _ = rig("track", video, "--csv", "a.csv", "--json")
    document = json.loads(said)
    assert (code, document["verdict"], document["valid"]) == (0, "good", FRAMES)
    assert document["look"]["subject"] == "cable"
    assert document["look"]["polarity"] == "dark"
    assert document["look"]["pivot_px"] == pytest.approx(PIVOT_PX, abs=0.3)
    rows = rows_of("a.csv")
    errors = [float(row["angle_rad"]) - angle_at(float(row["t_s"])) for row in rows]
    sigmas = [float(row["sigma_rad"]) for row in rows]
    assert max(map(abs, errors)) < 0.3e-3
    assert 0.6 < np.std(np.divide(errors, sigmas)) < 1.6
    assert {row["stamp"] for row in rows} == {"container"}
    assert {row["plane"] for row in rows} == {"grey"}


def test_a_first_look_says_what_it_found_and_draws_it(rig, video) -> None:
    code, said, _ = rig("track", video, "--look", "--plot", "look.png")
    assert code == 0
    assert "a cable that swings, dark in the grey plane" in said
    assert "pivot: 118." in said
    assert cv2.imread("look.png") is not None


def test_a_cable_of_another_colour_and_polarity_is_found(rig, tmp_path) -> None:
    def bright_in_blue(t_s: float) -> np.ndarray:
        blue = 60.0 + 120.0 * darkness(angle_at(t_s))
        return np.stack([blue, np.full_like(blue, 90.0), np.full_like(blue, 90.0)], axis=2)

    path = written(tmp_path / "blue.avi", bright_in_blue, colour=True)
    code, said, _ = rig("track", path, "--json")
    look = json.loads(said)["look"]
    assert code == 0
    assert (look["plane"], look["polarity"]) == ("blue", "bright")


def test_a_wrong_polarity_is_named(rig, video) -> None:
    code, said, _ = rig("track", video, "--polarity", "bright")
    assert code == 6
    assert "a dark cable swings in the grey plane: try --polarity dark" in said.replace("\n", " ")


def test_a_wrong_pivot_is_named_with_the_right_one(rig, video) -> None:
    code, said, _ = rig("track", video, "--pivot", "160,-25")
    assert code == 6
    assert "the lines found meet at 118." in said
    assert "try --pivot 118." in said.replace("\n", " ")


def test_a_still_line_is_static_unless_the_cable_is_said_to_hang(rig, tmp_path) -> None:
    path = written(tmp_path / "still.avi", lambda _: 200.0 - 150.0 * darkness(0.02), 20)
    code, said, _ = rig("track", path)
    assert code == 6
    assert "static 20" in said
    assert "--at-rest" in said
    code, said, _ = rig("track", path, "--at-rest", "--json")
    document = json.loads(said)
    angles = [row["angle_rad"] for row in document["rows"]]
    assert (code, document["valid"]) == (0, 20)
    assert np.mean(angles) == pytest.approx(0.02, abs=0.1e-3)


def test_equal_pictures_of_a_cable_at_rest_are_measured(rig, tmp_path) -> None:
    picture = np.rint(200.0 - 150.0 * darkness(0.02)).astype(np.uint8)
    for number in range(8):
        cv2.imwrite(str(tmp_path / f"p{number}.png"), picture)
    code, said, _ = rig("track", tmp_path / "p%d.png", "--rate", "10", "--at-rest", "--json")
    document = json.loads(said)
    assert (code, document["valid"]) == (0, 8)
    assert document["rows"][3]["t_s"] == pytest.approx(0.3)


def test_an_empty_picture_and_a_dark_one_are_told_apart(rig, tmp_path) -> None:
    empty = written(tmp_path / "e.avi", lambda _: np.full((HEIGHT, WIDTH), 180.0), 10)
    dark = written(tmp_path / "d.avi", lambda _: np.full((HEIGHT, WIDTH), 5.0), 10)
    code, said, _ = rig("track", empty)
    assert code == 6
    assert "no line stands out: median grey level 180" in said
    code, said, _ = rig("track", dark)
    assert code == 6
    assert "underexposed" in said


def test_a_swing_of_which_one_side_is_missing_is_doubtful(rig, video) -> None:
    code, said, _ = rig("track", video, "--roi", f"{118},0,{WIDTH - 118},{HEIGHT}", "--json")
    document = json.loads(said)
    assert (code, document["verdict"]) == (6, "doubtful")
    assert min(row["angle_rad"] for row in document["rows"] if row["valid"]) > -0.05


def test_a_part_is_measured_at_the_times_of_the_whole(rig, video) -> None:
    code, said, _ = rig("track", video, "--from", "0.3", "--to", "1", "--json")
    rows = json.loads(said)["rows"]
    assert code == 0
    assert (rows[0]["t_s"], rows[-1]["t_s"]) == pytest.approx((0.3, 1.0))
    assert rows[0]["angle_rad"] == pytest.approx(angle_at(0.3), abs=0.3e-3)


def test_a_region_gives_the_same_angles_as_the_whole_picture(rig, video) -> None:
    rig("track", video, "--csv", "whole.csv")
    rig("track", video, "--roi", "60,10,120,160", "--csv", "part.csv")
    whole, part = rows_of("whole.csv"), rows_of("part.csv")
    for one, other in zip(whole, part, strict=True):
        sigma = math.hypot(float(one["sigma_rad"]), float(other["sigma_rad"]))
        assert abs(float(one["angle_rad"]) - float(other["angle_rad"])) < 5.0 * sigma


def test_a_log_of_the_angles_opens_in_another_reader(rig, video) -> None:
    code, _, _ = rig("track", video, "--mcap", "a.mcap", "--csv", "a.csv")
    assert code == 0
    samples = read_log(Path("a.mcap")).read("/angle_1", AngleSample)
    rows = rows_of("a.csv")
    assert [sample.links[0].angle_rad for sample in samples] == pytest.approx(
        [float(row["angle_rad"]) for row in rows], abs=1e-9
    )
    assert [sample.t_valid_ns for sample in samples] == [
        round(1e9 * float(row["t_s"])) for row in rows
    ]
    assert samples[0].links[0].joint_px == pytest.approx(PIVOT_PX, abs=0.3)
    with Path("a.mcap").open("rb") as file:
        assert sum(1 for _ in make_reader(file).iter_messages()) >= FRAMES


def test_an_overlay_has_every_picture_with_a_line_in_it(rig, video) -> None:
    code, _, _ = rig("track", video, "--overlay", "o.avi")
    assert code == 0
    capture = cv2.VideoCapture("o.avi")
    pictures = []
    while capture.grab():
        pictures.append(capture.retrieve()[1].astype(int))
    assert len(pictures) == FRAMES
    greener = pictures[0][:, :, 1] - pictures[0][:, :, 2]
    v, u = np.nonzero(greener[30:] > 50)
    true_u = PIVOT_PX[0] + np.tan(angle_at(0.0)) * (v + 30 - PIVOT_PX[1])
    assert len(v) > 100
    assert np.abs(u - true_u).max() < 4.0


def test_an_average_is_written_beside_the_angles_with_its_loss_undone(rig, video) -> None:
    code, said, _ = rig("track", video, "--filter", "average:5", "--csv", "a.csv", "--json")
    told = json.loads(said)["filter"]
    assert code == 0
    assert told["swing_hz"] == pytest.approx(1.0 / PERIOD_S, abs=0.01)
    phase = math.pi / PERIOD_S / RATE_HZ
    assert told["gain"] == pytest.approx(math.sin(5 * phase) / (5 * math.sin(phase)), abs=1e-3)
    for row in rows_of("a.csv")[4:]:
        expected = angle_at(float(row["filtered_t_s"]))
        assert float(row["filtered_rad"]) == pytest.approx(expected, abs=0.6e-3)


def test_a_table_of_offsets_gives_the_angle_of_the_cable(rig, video, tmp_path) -> None:
    path = calibration_file(tmp_path / "cal.toml")
    code, said, _ = rig("track", video, "--calibration", path, "--json")
    rows = json.loads(said)["rows"]
    assert code == 0
    for row in rows:
        assert row["raw_rad"] - row["angle_rad"] == pytest.approx(0.012, abs=1e-12)


def test_a_pivot_beside_that_of_the_table_asks_for_the_position(rig, video, tmp_path) -> None:
    path = calibration_file(tmp_path / "cal.toml", pivot_home_px=(78.0, -25.0))
    code, said, _ = rig("track", video, "--calibration", path)
    assert code == 6
    assert "try --position 0.1" in said.replace("\n", " ")
    code, _, _ = rig("track", video, "--calibration", path, "--position", "0.1")
    assert code == 0


def test_a_pivot_at_another_height_is_one_of_another_camera(rig, video, tmp_path) -> None:
    path = calibration_file(tmp_path / "cal.toml", pivot_home_px=(118.0, -80.0))
    code, said, _ = rig("track", video, "--calibration", path)
    assert code == 6
    assert "it is of another camera, or the camera was moved" in said.replace("\n", " ")


def test_a_camera_file_gives_the_angle_of_the_cable(rig, tmp_path) -> None:
    # a camera at 1 m that is rolled by 0.05 rad about its axis and has no other fault
    roll_rad, focal_px = 0.05, 300.0

    def seen(t_s: float) -> np.ndarray:
        return 200.0 - 150.0 * darkness(angle_at(t_s) - roll_rad)

    down_m = (PIVOT_PX[1] - 90.0) / focal_px
    right_m = (PIVOT_PX[0] - 120.0) / focal_px
    turn, _ = cv2.Rodrigues(np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]))
    upright = cv2.Rodrigues(turn)[0]
    rolled, _ = cv2.Rodrigues(cv2.Rodrigues(np.array([0.0, 0.0, roll_rad]))[0] @ upright)
    file = CameraFile(
        made="2026-11-30T00:00:00+00:00",
        camera="test",
        plane="x",
        width=WIDTH,
        height=HEIGHT,
        focal_px=(focal_px, focal_px),
        centre_px=(120.0, 90.0),
        distortion=(0.0, 0.0, 0.0, 0.0, 0.0),
        sigma_focal_px=(0.1, 0.1),
        sigma_centre_px=(0.1, 0.1),
        sigma_distortion=(0.0,) * 5,
        boards=10,
        rms_px=0.1,
        pose=PoseTable(
            rotation=tuple(rolled.ravel().tolist()),
            translation_m=(right_m, down_m, 1.0),
            sigma_rotation=(1e-4,) * 3,
            sigma_translation_m=(1e-4,) * 3,
            marks=6,
            rms_px=0.1,
        ),
    )
    camera_file.save(file, tmp_path / "camera.toml")
    path = written(tmp_path / "rolled.avi", seen)
    code, said, _ = rig("track", path, "--calibration", tmp_path / "camera.toml", "--json")
    rows = json.loads(said)["rows"]
    assert code == 0
    errors = [row["angle_rad"] - angle_at(row["t_s"]) for row in rows]
    assert max(map(abs, errors)) < 0.4e-3


def test_a_rolling_shutter_is_told_from_a_bent_cable(rig, tmp_path) -> None:
    row_s = 60e-6
    v = np.arange(HEIGHT)[:, None]

    def rolling(t_s: float) -> np.ndarray:
        slope = np.tan([angle_at(t) for t in (t_s + row_s * v).ravel()])[:, None]
        across = np.arange(WIDTH) - PIVOT_PX[0] - slope * (v - PIVOT_PX[1])
        return 200.0 - 150.0 * np.exp(-0.5 * np.square(across / np.hypot(1.0, slope) / 1.2))

    path = written(tmp_path / "rolling.avi", rolling)
    code, said, _ = rig("track", path)
    assert code == 0
    assert "Give the time of a row with --row-time" in said.replace("\n", " ")
    code, said, _ = rig("track", path, "--row-time", "60", "--json")
    document = json.loads(said)
    rows = document["rows"]
    assert not any("bent" in text for text in document["remarks"])
    errors = [row["angle_rad"] - angle_at(row["t_s"]) for row in rows if row["valid"]]
    assert max(map(abs, errors)) < 0.3e-3
    assert max(abs(row["bend_px"]) for row in rows[1:-1]) < 0.25


def test_joined_recordings_are_doubtful_with_the_place(rig, tmp_path) -> None:
    rig("sim", "--scene", "joined", "--video", "j.mkv", "--truth", "t.csv", "--frames", "60")
    code, said, _ = rig("track", "j.mkv")
    assert code == 6
    assert "the time stamps step back" in said


def test_the_log_of_a_run_is_tracked_with_the_pivot_that_moves(rig) -> None:
    rig("run", "move", "--virtual", "--seed", "7", "--no-report", "--set", "experiment.watch_s=3")
    run = next(Path("runs").iterdir())
    code, said, _ = rig("track", run, "--json")
    document = json.loads(said)
    assert (code, document["valid"]) == (0, document["frames"])
    log = read_log(run / "run.mcap")
    samples = [one for one in log.read("/angle_1", AngleSample) if one.valid]
    first_ns = log.read("/camera/image", CompressedImage)[0].timestamp
    start_s = first_ns.sec + 1e-9 * first_ns.nsec
    for row in document["rows"]:
        near = min(samples, key=lambda one: abs(1e-9 * one.t_valid_ns - start_s - row["t_s"]))
        # compressed pictures, and an average of three frames in the log
        assert row["angle_rad"] == pytest.approx(near.links[0].raw_rad, abs=12e-3)


MISTAKES: dict[str, tuple[list[str], str]] = {
    "no video": ([], "VIDEO: missing"),
    "a pivot of one number": (["--pivot", "3"], "must be X,Y in pixels, or auto"),
    "a plane that is none": (["--plane", "violet"], "must be one of red, green, blue, grey"),
    "a polarity that is none": (["--polarity", "pale"], "must be one of dark, bright"),
    "a width of a rope": (["--width", "90"], "must be 0.5 to 40 px"),
    "a region outside": (["--roi", "0,0,999,20"], "must lie in the picture of 240 x 180 px"),
    "a region of three": (["--roi", "1,2,3"], "must be X,Y,W,H in pixels"),
    "an end before the start": (["--from", "2", "--to", "1"], "must be later"),
    "a part without frames": (["--from", "99"], "leaves no frame of"),
    "a filter that is none": (["--filter", "median:3"], "average:N or notch:HZ"),
    "a place without a calibration": (["--position", "0.1"], "without --calibration"),
    "a calibration that is not there": (["--calibration", "no.toml"], "no such file"),
    "a row of a second": (["--row-time", "1e6"], "must be 0 to 1000 us"),
    "a log with another ending": (["--mcap", "a.log"], "must end in .mcap"),
    "an overlay with another ending": (["--overlay", "a.gif"], "must end in one of .avi"),
    "options of the benchmark": (["--scenes", "clean"], "add --benchmark"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_with_its_bound(rig, video, mistake: str) -> None:
    words, hint = MISTAKES[mistake]
    name = [] if mistake == "no video" else [video]
    code, _, said = rig("track", *name, *words)
    assert code == 2, said
    assert hint in said.replace("\n", " ")


def test_a_calibration_of_another_picture_size_is_refused(rig, video, tmp_path) -> None:
    path = calibration_file(tmp_path / "cal.toml", width=640, height=480)
    code, _, said = rig("track", video, "--calibration", path)
    assert code == 2
    assert "is for pictures of 640 x 480 px; must be 240 x 180 px" in said.replace("\n", " ")


def test_a_calibration_that_is_none_is_refused(rig, video, tmp_path) -> None:
    (tmp_path / "x.toml").write_text("colour = 'red'\n")
    code, _, said = rig("track", video, "--calibration", "x.toml")
    assert code == 2
    assert "calibration" in said
    assert msgspec.__name__ not in said


def test_a_folder_without_pictures_and_a_text_are_refused(rig, tmp_path) -> None:
    (tmp_path / "text.avi").write_text("not a video\n" * 50)
    code, _, said = rig("track", "text.avi")
    assert code == 2
    assert "text.avi" in said
    (tmp_path / "empty").mkdir()
    code, _, said = rig("track", "empty")
    assert code == 2
    assert "empty" in said


@pytest.mark.parametrize("option", ["--csv", "--overlay", "--mcap", "--plot"])
def test_what_is_read_is_never_written(rig, video, tmp_path, option: str) -> None:
    copy = tmp_path / {"--csv": "v.csv.avi", "--mcap": "v.mcap"}.get(option, "v.avi")
    copy.write_bytes(video.read_bytes())
    before = copy.read_bytes()
    code, _, said = rig("track", copy, option, copy)
    assert code == 2
    assert "is what is read" in said.replace("\n", " ")
    assert copy.read_bytes() == before


def test_the_last_run_is_tracked_by_its_name(rig) -> None:
    rig("run", "free_decay", "--virtual", "--no-report", "--set", "experiment.watch_s=4")
    code, said, _ = rig("track", "last", "--json")
    document = json.loads(said)
    assert document["frames"] == document["valid"] > 5
    code, said, _ = rig("track", "last", "--mcap", "again.mcap")
    assert code == 0
    code, said, why = rig("identify", "again.mcap", "--json")
    assert "experiment.json" not in said + why
