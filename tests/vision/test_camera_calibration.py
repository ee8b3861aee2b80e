"""Lens from a chessboard and pose from marks, on rendered pictures whose camera is known."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from rig.studies.vision.scene import read_scene, scene_frames
from sim_rig.cable_state import CableState
from sim_rig.camera_params import CameraParams, LensParams
from sim_rig.imager import Imager
from sim_rig.link_angles import LinkState
from sim_rig.params import BenchParams
from vision.cable_geometry import ModelGeometry
from vision.camera_model import CameraModel, CameraParameters, SeenLine
from vision.chessboard import (
    MIN_BOARDS,
    BoardSize,
    FoundBoards,
    Intrinsics,
    SeenBoard,
    calibrate_intrinsics,
    find_boards,
)
from vision.errors import VisionError
from vision.line_fit import Grey
from vision.marks import MeasuredPose, SeenMarks, find_marks, find_pose
from vision.tracker import Tracker

PITCH = "bench.camera.pitch_deg=5"
BOARD = BoardSize(9, 6, 0.022)
WIDTH, HEIGHT = 640, 480
FOCAL_PX, CENTRE_PX, K1 = 1000.0, (320.0, 240.0), -0.1
CENTRE_M = (0.0, -1.0, -0.28)  # of the camera
SIGMAS = 4.0


class Calibrated(NamedTuple):
    """Camera as it was calibrated, and what it was calibrated with."""

    boards: FoundBoards
    intrinsics: Intrinsics
    marks: SeenMarks
    places_m: NDArray[np.float64]
    pose: MeasuredPose

    @property
    def parameters(self) -> CameraParameters:
        """Parameters of the model."""
        return CameraParameters(
            focal_px=self.intrinsics.focal_px,
            centre_px=self.intrinsics.centre_px,
            distortion=self.intrinsics.distortion,
            rotation=self.pose.rotation,
            translation_m=self.pose.translation_m,
        )


def pictures(name: str, frames: int) -> list[tuple[str, Grey]]:
    """Pictures of a shipped scene, by a camera pitched by 5 degrees."""
    scene = read_scene(name, [PITCH])
    return [(f"frame {f.number}", f.picture) for f in scene_frames(scene, frames)]


@pytest.fixture(scope="module")
def calibrated() -> Calibrated:
    found = find_boards(pictures("chessboard", 16), BOARD)
    intrinsics = calibrate_intrinsics(found, BOARD)
    plant = read_scene("marks").plant
    places_m = np.array([mark.place_m for mark in plant.cameras[0].objects])
    marks = find_marks(pictures("marks", 1)[0][1])
    pose = find_pose(marks, places_m, intrinsics, "x")
    return Calibrated(found, intrinsics, marks, places_m, pose)


def test_the_lens_is_that_of_the_camera_within_its_sigma(calibrated: Calibrated) -> None:
    found = calibrated.intrinsics
    assert len(found.used) >= 12
    assert found.rms_px < 0.1
    for value, sigma in zip(found.focal_px, found.sigma_focal_px, strict=True):
        assert abs(value - FOCAL_PX) < SIGMAS * sigma < 5.0
    for value, sigma, true in zip(found.centre_px, found.sigma_centre_px, CENTRE_PX, strict=True):
        assert abs(value - true) < SIGMAS * sigma < 6.0
    k1, k2, p1, p2, k3 = found.distortion
    assert abs(k1 - K1) < SIGMAS * found.sigma_distortion[0] < 0.02
    assert abs(k2) < SIGMAS * found.sigma_distortion[1]
    assert max(abs(p1), abs(p2)) < 2e-3
    assert k3 == 0.0


def test_the_pictures_without_a_whole_board_are_named(calibrated: Calibrated) -> None:
    refused = calibrated.intrinsics.refused
    assert set(refused.values()) == {"no board"}
    assert len(refused) + len(calibrated.intrinsics.used) == 16


def test_the_camera_stands_where_it_does(calibrated: Calibrated) -> None:
    model = CameraModel(calibrated.parameters)
    assert model.centre_m == pytest.approx(CENTRE_M, abs=4e-3)
    ahead = model.turn[2]
    assert math.degrees(math.asin(-ahead[2])) == pytest.approx(5.0, abs=0.2)
    assert math.degrees(math.atan2(ahead[0], ahead[1])) == pytest.approx(2.0, abs=0.2)
    assert calibrated.pose.rms_px < 0.1
    assert calibrated.pose.unused == 0


def test_the_angle_of_the_calibrated_camera_is_right_wherever_the_platform_is(
    calibrated: Calibrated,
) -> None:
    """Pitch 5, roll 2, yaw 2 degrees, k1 -0.1, x, y, z within 0.1 m, 0.2 rad: 0.3 mrad rms."""
    lens = LensParams(k1=K1)
    camera = CameraParams(pitch_deg=5.0, roll_deg=2.0, yaw_deg=2.0, lens=lens)
    imager = Imager(BenchParams(cameras=(camera,)), 0)
    geometry = ModelGeometry(calibrated.parameters, HEIGHT, 0)
    tracker = Tracker(WIDTH, HEIGHT)
    rng = np.random.default_rng(1)
    errors = []
    for number in range(60):
        x, y, z = (float(place) for place in rng.uniform(-0.1, 0.1, 3))
        angle = float(rng.uniform(-0.2, 0.2))
        state = CableState((x, y, z), [LinkState(angle, 0.0, 0.0, 0.0)], [1.0], [])
        picture = imager.picture([state] * len(imager.instants_ns), 0.0, number)
        column, row = geometry.pivot_px((x, y, z))
        tracker.forget()
        fit = tracker.measure(picture, (column, row))
        assert fit.angle_rad is not None, fit.reason
        miss = fit.pivot_miss_px or 0.0
        line = SeenLine(column + miss, row, fit.angle_rad, fit.first_row, fit.last_row)
        errors.append(geometry.true_angle(line, 0.0, (x, y, z)).angle_rad - angle)
    assert math.sqrt(np.mean(np.square(errors))) < 0.1e-3
    assert np.abs(errors).max() < 0.3e-3


def test_a_board_of_another_size_is_named() -> None:
    shown = pictures("chessboard", 1)
    with pytest.raises(VisionError, match=r"no board of 11 x 8 .* one of 9x6, give --corners 9x6"):
        find_boards(shown, BoardSize(11, 8, 0.022))


def test_pictures_without_a_board_say_what_to_show() -> None:
    empty = np.full((HEIGHT, WIDTH), 200, np.uint8)
    with pytest.raises(VisionError, match=r"no board of 9 x 6 .* show the whole board"):
        find_boards([("a", empty)], BOARD)
    with pytest.raises(VisionError, match="no picture of a chessboard"):
        find_boards([], BOARD)


def test_a_picture_of_another_size_is_named() -> None:
    large, small = np.zeros((480, 640), np.uint8), np.zeros((240, 320), np.uint8)
    with pytest.raises(VisionError, match="small: picture of 320 x 240 px; must be 640 x 480"):
        find_boards([("large", large), ("small", small)], BOARD)


def test_a_board_at_rest_counts_once_and_too_few_poses_are_refused(
    calibrated: Calibrated,
) -> None:
    shown = pictures("chessboard", 1) * 8
    found = find_boards(shown, BOARD)
    assert len(found.boards) == 1
    assert found.refused == {"frame 0": "board as in frame 0"}
    few = FoundBoards(
        calibrated.boards.boards[: MIN_BOARDS - 1], (WIDTH, HEIGHT), {"b": "no board"}
    )
    with pytest.raises(VisionError, match=r"5 poses of the board \(b: no board\); must be >= 6"):
        calibrate_intrinsics(few, BOARD)


def test_a_board_that_does_not_fit_is_left_out_with_its_reason(calibrated: Calibrated) -> None:
    boards = list(calibrated.boards.boards)
    rng = np.random.default_rng(2)
    shaken = boards[3].corners_px + rng.normal(0.0, 2.0, boards[3].corners_px.shape)
    boards[3] = SeenBoard("shaken", shaken.astype(np.float32))
    found = calibrate_intrinsics(calibrated.boards._replace(boards=boards), BOARD)
    assert "reprojection" in found.refused["shaken"]
    assert found.focal_px[0] == pytest.approx(FOCAL_PX, abs=10.0)


def test_boards_that_no_lens_explains_are_refused(calibrated: Calibrated) -> None:
    rng = np.random.default_rng(2)
    boards = []
    for seen in calibrated.boards.boards:
        shaken = seen.corners_px + rng.normal(0.0, 5.0, seen.corners_px.shape)
        boards.append(SeenBoard(seen.name, shaken.astype(np.float32)))
    with pytest.raises(VisionError, match=r"px rms; must be <= 1.0 px"):
        calibrate_intrinsics(calibrated.boards._replace(boards=boards), BOARD)


def test_marks_are_found_to_a_twentieth_of_a_pixel() -> None:
    rng = np.random.default_rng(5)
    fine, shift = 8, 3
    picture = np.full((240 * fine, 320 * fine), 200, np.uint8)
    centres = [
        (40.0 + 60 * i + rng.uniform(-3, 3), 50.0 + 70 * j) for i in range(5) for j in (0, 1)
    ]
    for x, y in centres:
        own = [((value + 0.5) * fine - 0.5) * 2**shift for value in (x, y)]
        place = (round(own[0]), round(own[1]))
        cv2.circle(picture, place, 6 * fine * 2**shift, 30, -1, cv2.LINE_AA, shift)
    small = cv2.resize(picture, (320, 240), interpolation=cv2.INTER_AREA)
    noisy = small + rng.normal(0.0, 2.0, small.shape)
    seen = find_marks(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
    assert len(seen.centres_px) == len(centres)
    for x, y in centres:
        apart = np.linalg.norm(seen.centres_px - (x, y), axis=1)
        assert apart.min() < 0.05
    assert seen.radius_px == pytest.approx(np.full(len(centres), 6.0), abs=0.7)


def test_lines_and_spots_at_the_border_are_no_marks() -> None:
    picture = np.full((240, 320), 200, np.uint8)
    picture[:, 100:103] = 30
    cv2.circle(picture, (319, 120), 6, 30, -1)
    cv2.rectangle(picture, (200, 50), (240, 55), 30, -1)
    assert len(find_marks(picture).centres_px) == 0


def test_a_place_that_is_typed_wrong_is_named(calibrated: Calibrated) -> None:
    wrong = calibrated.places_m.copy()
    wrong[4, 2] += 0.03
    with pytest.raises(VisionError, match=r"do not match their places: number 5 at \[-0.185, 0.0"):
        find_pose(calibrated.marks, wrong, calibrated.intrinsics, "x")


def test_the_order_of_the_places_does_not_matter_and_a_spot_too_many_is_left(
    calibrated: Calibrated,
) -> None:
    order = np.random.default_rng(4).permutation(len(calibrated.places_m))
    centres = np.concatenate([[[300.0, 280.0]], calibrated.marks.centres_px])
    seen = SeenMarks(centres, np.full(len(centres), 6.0))
    pose = find_pose(seen, calibrated.places_m[order], calibrated.intrinsics, "x")
    assert pose.translation_m == pytest.approx(calibrated.pose.translation_m, abs=1e-7)
    assert pose.unused == 1


def test_too_few_marks_or_spots_are_refused(calibrated: Calibrated) -> None:
    with pytest.raises(VisionError, match="5 places of marks; must be >= 6"):
        find_pose(calibrated.marks, calibrated.places_m[:5], calibrated.intrinsics, "x")
    few = SeenMarks(calibrated.marks.centres_px[:9], calibrated.marks.radius_px[:9])
    with pytest.raises(VisionError, match="9 round dark spots in the picture, 12 places"):
        find_pose(few, calibrated.places_m, calibrated.intrinsics, "x")
