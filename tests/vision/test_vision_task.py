"""Vision task without sockets or clocks: angles with time stamps from frames and positions."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from comms.messages import (
    AngleSample,
    Command,
    Frame,
    InvalidReason,
    LinkAngle,
    Phase,
    Reply,
    RobotState,
    SwingPlane,
    Verb,
)
from comms.task import NO_STEP, Step
from tests.vision.rendered_cable import HEIGHT, PIVOT_PX, WIDTH, Camera, Grey, Scene
from vision import tracker
from vision.errors import VisionError
from vision.sources import open_source, red_plane
from vision.task import VisionSettings, VisionTask, build

MS = 1_000_000
PERIOD_NS = 20 * MS
PIXELS_PER_M = 500.0
SETTINGS: dict[str, Any] = {
    "width": WIDTH,
    "height": HEIGHT,
    "period_ns": PERIOD_NS,
    "pivot_home_px": PIVOT_PX,
    "pixels_per_m": PIXELS_PER_M,
    "x_m": [],
    "offset_rad": [],
}


@pytest.fixture(scope="module")
def camera() -> Camera:
    return Camera(seed=3)


def task(**changed: Any) -> VisionTask:
    vision = VisionTask(VisionSettings(**(SETTINGS | changed)))
    assert vision.start(0) == NO_STEP
    return vision


def platform(t_ns: int, x_m: float, v_m_s: float = 0.0) -> RobotState:
    return RobotState(
        seq=t_ns // (10 * MS),
        t_ns=t_ns + MS,
        t_actual_ns=t_ns,
        commanded_m=(9.0, 0.0, 0.0),
        actual_m=(x_m, 0.0, 0.0),
        actual_velocity_m_s=(v_m_s, 0.0, 0.0),
        phase=Phase.RUNNING,
    )


def frame(pixels: Grey, start_ns: int, row_ns: int = 0, encoding: str = "mono8") -> Frame:
    return Frame(
        seq=start_ns // PERIOD_NS,
        t_ns=start_ns + 10 * MS,
        t_exposure_start_ns=start_ns,
        exposure_ns=10 * MS,
        row_ns=row_ns,
        camera="test",
        encoding=encoding,
        height=pixels.shape[0],
        width=pixels.shape[1],
        pixels=pixels,
    )


def angle_of(step: Step, channel: str = "angle_1") -> AngleSample:
    (send,) = step.sends
    assert send.channel == channel
    assert isinstance(send.message, AngleSample)
    assert send.at_ns == send.message.t_ns
    return send.message


def look(vision: VisionTask, pixels: Grey, start_ns: int, **kind: Any) -> AngleSample:
    picture = frame(pixels, start_ns, **kind)
    return angle_of(vision.on_message("frame_1", picture, start_ns + 18 * MS))


def cable_of(sample: AngleSample) -> LinkAngle:
    (cable,) = sample.links
    assert sample.cable == cable
    return cable


def cable_at(camera: Camera, angle_rad: float, x_m: float = 0.0) -> Grey:
    return camera.expose(
        Scene(angle_rad=angle_rad, pivot_px=(PIVOT_PX[0] + PIXELS_PER_M * x_m, PIVOT_PX[1])).light()
    )


def test_an_angle_leaves_after_the_processing_time_and_is_stamped_at_mid_exposure(
    camera: Camera,
) -> None:
    vision = task(processing_ns=3 * MS)
    vision.on_message("platform_1", platform(100 * MS, 0.05), 102 * MS)
    sample = look(vision, cable_at(camera, 0.1, 0.05), 100 * MS)
    assert sample.valid
    assert sample.reason is InvalidReason.NONE
    assert sample.t_ns == 118 * MS + 3 * MS
    assert sample.t_valid_ns == 105 * MS
    assert sample.swing_plane is SwingPlane.X
    assert cable_of(sample).angle_rad == pytest.approx(0.1, abs=1e-4)
    assert sample.platform_m == 0.05
    assert sample.pivot_miss_px == pytest.approx(0.0, abs=0.1)


def test_the_task_of_another_camera_sends_on_its_own_channel_and_under_its_own_name() -> None:
    vision = task(camera=3)
    assert vision.name == "vision_3"
    (send,) = vision.on_message("frame_3", frame(np.zeros((9, 9), np.uint8), 0), 0).sends
    assert send.channel == "angle_3"
    (reply,) = vision.on_message(
        "command", Command(seq=0, t_ns=1, id=7, to="vision_3", verb=Verb.ARM), 1
    ).sends
    assert isinstance(reply.message, Reply)
    assert reply.message.sender == "vision_3"


def test_a_camera_of_the_plane_y_follows_the_platform_along_y(camera: Camera) -> None:
    vision = task(camera=2, swing_plane=SwingPlane.Y, x_m=[0.0, 0.2], offset_rad=[0.0, -0.004])
    for t_ns in (100 * MS, 110 * MS):
        state = platform(t_ns, 0.9)
        y_m = 0.05 + 0.2 * (t_ns - 105 * MS) * 1e-9
        vision.on_message(
            "platform_2",
            msgspec.structs.replace(
                state, actual_m=(0.9, y_m, 0.0), actual_velocity_m_s=(5.0, 0.2, 0.0)
            ),
            t_ns + MS,
        )
    sample = angle_of(
        vision.on_message("frame_2", frame(cable_at(camera, -0.001, 0.05), 100 * MS), 118 * MS),
        "angle_2",
    )
    assert sample.swing_plane is SwingPlane.Y
    assert sample.platform_m == pytest.approx(0.05, abs=1e-12)
    assert cable_of(sample).offset_rad == pytest.approx(-0.001, abs=5e-6)
    assert cable_of(sample).angle_rad == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("angle_rad", [-0.1, 0.0, 0.2])
def test_the_joint_is_where_the_cable_crosses_the_row_of_the_predicted_pivot(
    camera: Camera, angle_rad: float
) -> None:
    vision = task()
    vision.on_message("platform_1", platform(105 * MS, 0.04), 106 * MS)
    seen_m = 0.042  # 1 px beside the prediction
    sample = look(vision, cable_at(camera, angle_rad, seen_m), 100 * MS)
    joint_px = cable_of(sample).joint_px
    assert joint_px == pytest.approx((PIVOT_PX[0] + PIXELS_PER_M * seen_m, PIVOT_PX[1]), abs=0.1)
    assert sample.pivot_miss_px == pytest.approx(1.0, abs=0.1)


def test_the_average_of_three_frames_holds_at_their_middle(camera: Camera) -> None:
    vision = task()
    for k, angle in enumerate((0.10, 0.11, 0.12)):
        start_ns = k * PERIOD_NS
        vision.on_message("platform_1", platform(start_ns, 0.0), start_ns)
        sample = look(vision, cable_at(camera, angle), start_ns)
    assert cable_of(sample).angle_rad == pytest.approx(0.11, abs=1e-4)
    assert cable_of(sample).raw_rad == pytest.approx(0.12, abs=1e-4)
    assert sample.t_valid_ns == PERIOD_NS + 5 * MS
    assert sample.seq == 2


def test_the_offset_is_subtracted_at_the_platform_position_of_each_frame(camera: Camera) -> None:
    vision = task(x_m=[0.0, 0.2], offset_rad=[0.0, -0.004])
    for k, x_m in enumerate((0.05, 0.10, 0.15)):
        t_ns = k * PERIOD_NS + 5 * MS
        vision.on_message("platform_1", platform(t_ns, x_m), t_ns + MS)
        sample = look(vision, cable_at(camera, -0.02 * x_m, x_m), k * PERIOD_NS)
        assert cable_of(sample).offset_rad == pytest.approx(-0.02 * x_m, abs=5e-6)
        assert cable_of(sample).angle_rad == pytest.approx(0.0, abs=1e-4)


def test_the_slope_of_the_offset_table_scales_the_angle_and_its_sigma(camera: Camera) -> None:
    vision, plain = task(x_m=[0.0, 0.2], offset_rad=[0.0, -0.004]), task()
    for one in (vision, plain):
        one.on_message("platform_1", platform(105 * MS, 0.0), 106 * MS)
    picture = cable_at(camera, 0.05)
    seen = cable_of(look(vision, picture, 100 * MS))
    as_read = cable_of(look(plain, picture, 100 * MS))
    # pitch of 0.02 1/m times the distance; the pivot is 280 px above the middle of the picture
    scale = 1.0 / (1.0 - 0.02 * (HEIGHT / 2 - PIVOT_PX[1]) / PIXELS_PER_M)
    assert math.tan(seen.angle_rad) == pytest.approx(scale * math.tan(as_read.angle_rad), rel=1e-9)
    assert seen.sigma_rad == pytest.approx(scale * as_read.sigma_rad, rel=1e-4)
    assert seen.raw_rad == as_read.raw_rad
    assert seen.raw_rad - seen.offset_rad == pytest.approx(seen.angle_rad, abs=1e-15)


def test_the_platform_is_interpolated_to_mid_exposure_along_a_smooth_move(camera: Camera) -> None:
    vision = task()
    for t_s in (0.09, 0.10, 0.11):
        vision.on_message(
            "platform_1", platform(round(t_s * 1e9), t_s**3, 3.0 * t_s**2), round(t_s * 1e9)
        )
    # Hermite interpolation reproduces a cubic
    sample = look(vision, cable_at(camera, 0.0), 100 * MS)
    assert sample.platform_m == pytest.approx(0.105**3, abs=1e-12)


@pytest.mark.parametrize(("age_ms", "known"), [(19, True), (21, False)])
def test_the_platform_is_extrapolated_20_ms_and_no_further(
    camera: Camera, age_ms: int, known: bool
) -> None:
    vision = task()
    vision.on_message("platform_1", platform((105 - age_ms) * MS, 0.01, 0.2), 100 * MS)
    x_m = 0.01 + 0.2 * age_ms * 1e-3
    sample = look(vision, cable_at(camera, 0.0, x_m), 100 * MS)
    assert sample.valid is known
    assert sample.reason is (InvalidReason.NONE if known else InvalidReason.NO_PLATFORM)
    assert sample.platform_m == (pytest.approx(x_m, abs=1e-12) if known else None)


def test_a_platform_message_older_than_the_newest_changes_nothing(camera: Camera) -> None:
    vision = task()
    vision.on_message("platform_1", platform(104 * MS, 0.02), 105 * MS)
    vision.on_message("platform_1", platform(94 * MS, 9.0), 106 * MS)
    assert look(vision, cable_at(camera, 0.0, 0.02), 100 * MS).platform_m == 0.02


def test_an_invalid_frame_gives_a_reason_and_no_value_and_restarts_the_average(
    camera: Camera,
) -> None:
    vision = task()
    vision.on_message("platform_1", platform(45 * MS, 0.0), 46 * MS)
    look(vision, cable_at(camera, 0.1), 30 * MS)
    lost = look(vision, camera.expose(Scene(contrast=0.0).light()), 50 * MS)
    assert (lost.valid, lost.reason) == (False, InvalidReason.NO_CABLE)
    assert (lost.links, lost.cable) == ((), None)
    vision.on_message("platform_1", platform(65 * MS, 0.0), 66 * MS)
    again = look(vision, cable_at(camera, 0.2), 60 * MS)
    assert again.t_valid_ns == 65 * MS
    assert cable_of(again).angle_rad == cable_of(again).raw_rad


def test_a_platform_outside_the_offset_table_gives_no_angle(camera: Camera) -> None:
    vision = task(x_m=[0.0, 0.1], offset_rad=[0.0, 0.0])
    vision.on_message("platform_1", platform(105 * MS, 0.11), 106 * MS)
    sample = look(vision, cable_at(camera, 0.0, 0.11), 100 * MS)
    assert (sample.reason, sample.links) == (InvalidReason.OUT_OF_RANGE, ())


def test_a_colour_picture_is_read_in_its_red_plane(camera: Camera) -> None:
    vision = task()
    vision.on_message("platform_1", platform(105 * MS, 0.0), 106 * MS)
    red = cable_at(camera, -0.1)
    picture = np.stack([cable_at(camera, 0.3), np.full_like(red, 40), red], axis=2)
    sample = look(vision, picture, 100 * MS, encoding="bgr8")
    assert cable_of(sample).angle_rad == pytest.approx(-0.1, abs=1e-4)


@pytest.mark.parametrize(
    ("shape", "encoding"),
    [((HEIGHT, WIDTH, 3), "mono8"), ((240, 320), "mono8"), ((HEIGHT, WIDTH), "bgr8")],
)
def test_a_picture_of_the_wrong_size_is_a_bad_image(shape: tuple[int, ...], encoding: str) -> None:
    vision = task()
    vision.on_message("platform_1", platform(105 * MS, 0.0), 106 * MS)
    assert (
        look(vision, np.zeros(shape, np.uint8), 100 * MS, encoding=encoding).reason
        is InvalidReason.BAD_IMAGE
    )


@pytest.mark.parametrize("pivot_row", [PIVOT_PX[1], 60.0, 120.0, 240.0])
def test_the_angle_of_a_rolling_shutter_holds_at_the_read_out_of_its_rows(
    camera: Camera, pivot_row: float
) -> None:
    row_ns, rate, start_s = 33_000, 0.32, 0.1
    pivot_px = PIVOT_PX[0], pivot_row
    light = np.empty((HEIGHT, WIDTH))
    for row in range(0, HEIGHT, 8):  # eight rows share an instant: 0.08 mrad
        angle = 0.05 + rate * (row + 3.5) * row_ns * 1e-9
        light[row : row + 8] = Scene(angle_rad=angle, pivot_px=pivot_px).light()[row : row + 8]
    vision = task(pivot_home_px=pivot_px)
    vision.on_message("platform_1", platform(105 * MS, 0.0), 106 * MS)
    sample = look(vision, camera.expose(light), round(start_s * 1e9), row_ns=row_ns)
    truth = 0.05 + rate * (sample.t_valid_ns * 1e-9 - start_s - 0.005)
    assert cable_of(sample).angle_rad == pytest.approx(truth, abs=2e-4)


@pytest.mark.parametrize("verb", list(Verb))
def test_every_command_is_answered_with_its_id_and_changes_nothing(verb: Verb) -> None:
    step = task().on_message(
        "command", Command(seq=4, t_ns=1, id=77, to="vision", verb=verb), 5 * MS
    )
    (send,) = step.sends
    assert isinstance(send.message, Reply)
    assert (send.channel, send.at_ns) == ("reply", 5 * MS)
    assert (send.message.id, send.message.sender, send.message.ok) == (77, "vision", True)
    assert (step.wake_ns, step.exit) == (None, None)


def test_the_task_has_no_timer_and_no_shutdown_action() -> None:
    vision = task()
    assert vision.on_tick(5) == NO_STEP
    assert vision.stop(6) == NO_STEP


def test_settings_survive_json_and_an_unknown_key_is_refused() -> None:
    assert build(msgspec.json.encode(SETTINGS)).name == "vision"
    of_another = msgspec.json.encode(SETTINGS | {"camera": 2, "swing_plane": "y"})
    assert build(of_another).name == "vision_2"
    with pytest.raises(msgspec.ValidationError, match="heigth"):
        build(msgspec.json.encode(SETTINGS | {"heigth": 480}))


def test_every_reason_of_the_tracker_is_an_invalid_reason_of_the_message() -> None:
    assert {reason.value for reason in tracker.TrackFailure} <= {
        reason.value for reason in InvalidReason
    }


def written_video(path: Path, planes: list[Grey], fps: float) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FFV1"), fps, (WIDTH, HEIGHT))
    for plane in planes:
        writer.write(cv2.merge([np.zeros_like(plane), np.zeros_like(plane), plane]))
    writer.release()
    return path


def test_a_video_gives_its_red_planes_at_the_frame_rate(tmp_path: Path, camera: Camera) -> None:
    planes = [cable_at(camera, angle) for angle in (0.0, 0.1, -0.2)]
    seen = list(open_source(written_video(tmp_path / "swing.avi", planes, 50.0)).frames())
    assert [f.number for f in seen] == [0, 1, 2]
    assert [f.t_s for f in seen] == pytest.approx([0.0, 0.02, 0.04])
    for plane, picture in zip(planes, seen, strict=True):
        red = red_plane(picture.image)
        assert np.abs(red.astype(int) - plane).max() <= 2
        assert red.flags.c_contiguous


def test_a_single_plane_is_returned_unchanged(camera: Camera) -> None:
    plane = cable_at(camera, 0.0)
    assert red_plane(plane) is plane


def test_a_missing_video_is_refused(tmp_path: Path) -> None:
    with pytest.raises(VisionError, match="no such file"):
        open_source(tmp_path / "nowhere.avi")


@pytest.mark.parametrize("name", ["text.avi", "text.mp4"])
def test_a_file_that_is_no_video_is_refused_with_a_single_message(
    tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    path.write_text("not a video\n" * 100)
    code = (
        "import sys\n"
        "from pathlib import Path\n"
        "from vision.errors import VisionError\n"
        "from vision.sources import open_source\n"
        "try: open_source(Path(sys.argv[1]))\n"
        "except VisionError as e: sys.exit('refused: ' + str(e))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False
    )
    assert run.stderr.startswith("refused: ")
    assert "1200 bytes" in run.stderr
    assert run.stderr.count("\n") == 1
