"""Frames of a source with their angles: times, faults, places, and the bend of the shutter."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.vision.swing_pictures import (
    BLUR_PX,
    HEIGHT,
    PIVOT_PX,
    WIDTH,
    FloatArray,
    Image,
    Point,
    cable,
    picture,
)
from vision.camera_model import SeenLine, Vector
from vision.first_look import LookChoices
from vision.geometry import TrueAngle
from vision.offset_table import OffsetTable
from vision.stream import PictureFault, SourceFrame, StampKind
from vision.tracked import (
    CameraPlacement,
    MeasureOptions,
    TrackedFrame,
    tracked_frames,
    without_readout_bend,
)
from vision.video_tracker import VideoTracker
from vision.view import PictureRegion

PERIOD_S = 0.02
RATE_RAD_S = 13.0  # of the phase of the swing: up to 2.6 rad/s
COUNT = 24
TIMES_S = PERIOD_S * np.arange(COUNT)


def swing_at(t_s: FloatArray) -> FloatArray:
    return 0.2 * np.sin(RATE_RAD_S * t_s)


def along(columns: FloatArray, slopes: FloatArray) -> FloatArray:
    """Share of each pixel that a cable of 2.5 px with these columns covers."""
    distance = (np.arange(WIDTH) - columns[:, None]) / np.hypot(1.0, slopes)[:, None]
    inside = np.clip((1.25 - np.abs(distance)) / BLUR_PX + 0.5, 0.0, 1.0)
    return np.asarray(inside * inside * (3.0 - 2.0 * inside))


def frame(number: int, image: Image, *faults: PictureFault) -> SourceFrame:
    return SourceFrame(
        number, float(TIMES_S[number]), StampKind.CONTAINER, image, frozenset(faults)
    )


def frames_of(covers: list[FloatArray], seed: int) -> list[SourceFrame]:
    random = np.random.default_rng(seed)
    return [frame(k, picture(cover, random)) for k, cover in enumerate(covers)]


def plain(seed: int = 1) -> list[SourceFrame]:
    return frames_of([cable(float(angle)) for angle in swing_at(TIMES_S)], seed)


def rows_of(
    frames: list[SourceFrame],
    chosen: MeasureOptions | None = None,
    choices: LookChoices | None = None,
) -> list[TrackedFrame]:
    tracker = VideoTracker(WIDTH, HEIGHT, choices, keeps_pivot=True)
    tracker.prepare([item.image for item in frames])
    return [item.row for item in tracked_frames(frames, tracker, chosen or MeasureOptions())]


def angle_of(row: TrackedFrame) -> float:
    assert row.valid, row.reason
    assert row.angle_rad is not None
    return row.angle_rad


def test_a_row_holds_the_frame_its_time_and_its_angle() -> None:
    rows = rows_of(plain())
    for number, row in enumerate(rows):
        assert (row.frame, row.stamp, row.plane) == (number, "container", "grey")
        assert row.t_s == TIMES_S[number]
        assert angle_of(row) == pytest.approx(swing_at(TIMES_S)[number], abs=3e-4)
        assert row.raw_rad == row.angle_rad
        assert row.reason == "none"
        assert row.lower_rad is None
        assert row.joint_x_px is None
        assert row.rows > 0.8 * HEIGHT
        assert (row.first_row, row.last_row) == pytest.approx((0, HEIGHT - 1), abs=4)


def test_a_fault_of_the_source_is_the_reason_and_leaves_no_angle() -> None:
    frames = plain()
    faults = {3: PictureFault.DUPLICATE, 5: PictureFault.FROZEN, 7: PictureFault.DAMAGED}
    for number, fault in faults.items():
        frames[number] = frame(number, frames[number].image, fault)
    frames[9] = frame(9, frames[9].image, *faults.values())
    rows = rows_of(frames)
    assert [rows[number].reason for number in (3, 5, 7, 9)] == [
        "duplicate", "frozen", "damaged", "damaged"
    ]  # fmt: skip
    for row in rows:
        assert row.valid is (row.frame not in (3, 5, 7, 9))
        assert row.valid is (row.angle_rad is not None)
        assert row.valid is (row.sigma_rad is not None)
        assert row.valid is (row.raw_rad is not None)


def test_a_cable_at_rest_may_repeat_but_not_be_damaged() -> None:
    frames = frames_of([cable(0.1)] * 12, 2)
    frames[4] = frame(4, frames[3].image, PictureFault.DUPLICATE)
    frames[5] = frame(5, frames[3].image, PictureFault.FROZEN)
    frames[6] = frame(6, frames[6].image, PictureFault.DAMAGED)
    rows = rows_of(frames, MeasureOptions(at_rest=True), LookChoices(at_rest=True))
    assert [row.reason for row in rows[3:7]] == ["none", "none", "none", "damaged"]


def rolling(row_s: float, bend_px: float = 0.0) -> list[SourceFrame]:
    """Frames of a camera that reads row y at y row_s; the cable may be bent, too."""
    v = np.arange(float(HEIGHT))
    t = 2.0 * v / (HEIGHT - 1) - 1.0
    covers = []
    for start_s in TIMES_S:
        slopes = np.tan(swing_at(start_s + v * row_s))
        columns = PIVOT_PX[0] + slopes * (v - PIVOT_PX[1]) + bend_px * (1.0 - t * t)
        covers.append(along(columns, slopes))
    return frames_of(covers, 3)


def test_the_time_of_an_angle_is_that_at_which_a_rolling_shutter_shows_it() -> None:
    row_s = 1e-4  # 16 ms a picture: 40 mrad
    frames = rolling(row_s)
    rows = rows_of(frames, MeasureOptions(row_s=row_s))
    errors = [angle_of(row) - float(swing_at(np.array(row.t_s))) for row in rows]
    assert np.abs(errors).max() < 1.5e-3
    early = [angle_of(row) - float(swing_at(TIMES_S[row.frame])) for row in rows]
    assert np.abs(early).max() > 0.03


def test_the_bend_of_a_rolling_shutter_is_subtracted_and_that_of_the_cable_left() -> None:
    row_s, bend_px = 1e-4, 0.8
    rows = rows_of(rolling(row_s, bend_px), MeasureOptions(row_s=row_s))
    shutter = np.array([row.bend_px for row in rows])
    left = np.array([row.bend_px for row in without_readout_bend(rows, row_s)])
    assert np.ptp(shutter) > 1.5
    assert left[1:-1] == pytest.approx(np.full(COUNT - 2, bend_px), abs=0.25)
    # the first and the last frame have no neighbour on one side
    assert (left[0], left[-1]) == (shutter[0], shutter[-1])


def test_a_bend_beside_a_refused_frame_is_kept() -> None:
    rows = rows_of(rolling(1e-4), MeasureOptions(row_s=1e-4))
    rows[10] = rows[10]._replace(raw_rad=None)
    rows[20] = rows[20]._replace(t_s=rows[18].t_s)  # does not advance
    left = without_readout_bend(rows, 1e-4)
    kept = [k for k in range(COUNT) if left[k].bend_px == rows[k].bend_px]
    assert set(kept) >= {0, 9, 10, 11, 19, COUNT - 1}
    assert len(kept) < 10


def test_a_region_leaves_rows_places_and_times_those_of_the_picture() -> None:
    region = PictureRegion(20, 30, 160, 120)
    row_s = 1e-4
    frames = plain()
    tracker = VideoTracker(WIDTH, HEIGHT, LookChoices(region=region))
    tracker.prepare([item.image for item in frames])
    for item in tracked_frames(frames, tracker, MeasureOptions(row_s=row_s)):
        line = item.line
        assert line is not None
        assert (line.first_row, line.last_row) == pytest.approx((30, 149), abs=4)
        place = PIVOT_PX[0] + math.tan(line.slope_rad) * (line.row_px - PIVOT_PX[1])
        assert line.column_px == pytest.approx(place, abs=0.1)
        assert line.row_px == pytest.approx(PIVOT_PX[1], abs=0.2)
        expected_s = item.source.t_s + row_s * (line.first_row + line.last_row - line.row_px)
        assert item.row.t_s == pytest.approx(expected_s, abs=1e-12)


def test_two_links_give_both_angles_and_the_joint() -> None:
    v = np.arange(float(HEIGHT))
    joint_row = 90.0
    lowers = swing_at(TIMES_S) + 0.1 + 0.05 * np.cos(9.0 * TIMES_S)
    covers = []
    for upper, lower in zip(swing_at(TIMES_S)[:12], lowers[:12], strict=True):
        slopes = np.where(v < joint_row, math.tan(upper), math.tan(lower))
        bend = (math.tan(lower) - math.tan(upper)) * np.maximum(v - joint_row, 0.0)
        covers.append(along(PIVOT_PX[0] + math.tan(upper) * (v - PIVOT_PX[1]) + bend, slopes))
    rows = [row for row in rows_of(frames_of(covers, 4)) if row.lower_rad is not None]
    assert len(rows) > 7
    for row in rows:
        assert angle_of(row) == pytest.approx(swing_at(TIMES_S)[row.frame], abs=2e-3)
        assert row.lower_rad == pytest.approx(lowers[row.frame], abs=3e-3)
        assert row.lower_sigma_rad is not None
        assert row.lower_sigma_rad < 1e-3
        assert row.joint_y_px == pytest.approx(joint_row, abs=4.0)
        column = PIVOT_PX[0] + math.tan(angle_of(row)) * (joint_row - PIVOT_PX[1])
        assert row.joint_x_px == pytest.approx(column, abs=1.5)


class Geometry:
    """Geometry whose true angle is a known function of the line."""

    def pivot_px(self, position_m: Vector) -> Point:
        return PIVOT_PX[0] + 100.0 * position_m[0], PIVOT_PX[1]

    def true_angle(self, line: SeenLine, offset_rad: float, position_m: Vector) -> TrueAngle:
        return TrueAngle(2.0 * line.slope_rad - offset_rad + position_m[1], 2.0)

    def lower_angle(self, line: SeenLine, offset_rad: float, position_m: Vector) -> TrueAngle:
        raise AssertionError("there is one link")


def test_a_calibrated_camera_gives_the_angle_of_the_cable() -> None:
    offsets = OffsetTable([-1.0, 1.0], [-0.02, 0.02])
    placement = CameraPlacement(Geometry(), (0.0, 0.01, 0.0), 0, offsets)
    assert placement.pivot_px() == PIVOT_PX
    assert placement._replace(position_m=(0.2, 0.0, 0.0)).pivot_px() == (120.0, PIVOT_PX[1])
    frames = plain()
    bare = rows_of(frames, MeasureOptions(pivot_px=PIVOT_PX))
    aside = placement._replace(position_m=(0.5, 0.01, 0.0))
    for position, offset_rad in ((placement, 0.0), (aside, 0.01)):
        rows = rows_of(frames, MeasureOptions(pivot_px=PIVOT_PX, placement=position))
        for plain_row, row in zip(bare, rows, strict=True):
            assert row.raw_rad == plain_row.angle_rad
            expected = 2.0 * angle_of(plain_row) - offset_rad + 0.01
            assert row.angle_rad == pytest.approx(expected, abs=1e-9)
            assert plain_row.sigma_rad is not None
            assert row.sigma_rad == pytest.approx(2.0 * plain_row.sigma_rad)


def test_the_pivot_of_a_frame_comes_before_the_told_one() -> None:
    random = np.random.default_rng(5)
    frames = []
    for number, angle in enumerate(swing_at(TIMES_S)):
        pivot = (60.0 + 2.5 * number, PIVOT_PX[1])
        seen = frame(number, picture(cable(float(angle), pivot), random))
        frames.append(seen._replace(pivot_px=pivot))
    tracker = VideoTracker(WIDTH, HEIGHT, keeps_pivot=True)
    pivots = [item.pivot_px for item in frames if item.pivot_px is not None]
    tracker.prepare([item.image for item in frames], pivots)
    chosen = MeasureOptions(pivot_px=(20.0, 0.0))
    for item in tracked_frames(frames, tracker, chosen):
        assert angle_of(item.row) == pytest.approx(swing_at(TIMES_S)[item.row.frame], abs=5e-4)
        assert item.row.pivot_miss_px == pytest.approx(0.0, abs=0.5)
