"""Faults of a camera: sensor, light, objects in the picture, shutter, and single frames."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sim_rig.bench import Bench
from sim_rig.camera_objects import (
    Dust,
    Glare,
    Hand,
    Knots,
    LoadInPicture,
    Patch,
    Shadow,
    StaticLine,
)
from sim_rig.camera_params import (
    CameraFaults,
    CameraParams,
    Interval,
    LensParams,
    LightParams,
    LightStep,
    SensorParams,
)
from sim_rig.imager import Imager
from sim_rig.params import BenchParams, PendulumParams, View
from sim_rig.plain_imager import PlainImager, is_plain
from sim_rig.shutter import Exposure, Shutter
from sim_rig.synthetic import swinging_video

GREY = SensorParams(kind="grey")
QUIET = {"noise": 0.0, "sensor": GREY, "pitch_deg": 0.0}
EMPTY = QUIET | {"contrast": 0.0}
Levels = NDArray[np.float64]


def plant(camera: dict[str, Any], **keys: Any) -> BenchParams:
    """Make a plant with one camera and a load that hangs 1 m below the pivot."""
    return BenchParams(cameras=(CameraParams(**camera),), **keys)


def first_picture(params: BenchParams, seconds: float = 0.01) -> NDArray[np.uint8]:
    *_, last = swinging_video(params, seconds)
    return last.exposure.pixels


def picture(camera: dict[str, Any], **keys: Any) -> Levels:
    return first_picture(plant(camera, **keys)).astype(float)


def exposures(params: BenchParams, seconds: float) -> list[Exposure]:
    return [frame.exposure for frame in swinging_video(params, seconds)]


# the picture of a plain camera, drawn in two ways


def test_a_plain_camera_gives_the_same_picture_by_both_ways_of_drawing() -> None:
    params = plant({"noise": 0.0, "pitch_deg": 3.0}, pendulum=PendulumParams(initial_swing_rad=0.3))
    (frame,) = swinging_video(params, 0.01)
    states = frame.exposure.states
    fast = PlainImager(params, 0).picture(states, 0.0, 0).astype(int)
    full = Imager(params, 0).picture(states, 0.0, 0).astype(int)
    assert fast.min() < 60
    assert np.abs(fast - full).max() <= 1


@pytest.mark.parametrize(
    "change",
    [
        {"contrast": -10.0},
        {"row_us": 1.0},
        {"yaw_deg": 0.1},
        {"lens": LensParams(k1=1e-3)},
        {"light": LightParams(level=0.9)},
        {"objects": (Shadow(),)},
        {"sensor": GREY},
    ],
)
def test_a_camera_with_any_fault_of_the_picture_is_not_plain(change: dict[str, Any]) -> None:
    assert is_plain(CameraParams())
    assert is_plain(CameraParams(faults=CameraFaults(dropped=0.5), jitter_us=10.0))
    assert not is_plain(CameraParams(**change))


# sensor


def test_equal_seeds_give_equal_pictures_and_others_do_not() -> None:
    camera = {"sensor": SensorParams(kind="bayer", shot=0.1, row_noise=1.0, jpeg=80)}
    first, again, other = (first_picture(plant(camera, seed=seed)) for seed in (7, 7, 8))
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.5


def test_the_noise_has_its_variance_shot_noise_included() -> None:
    sensor = SensorParams(kind="grey", shot=0.05)
    levels = picture(EMPTY | {"noise": 2.0, "sensor": sensor, "background": 100.0})
    assert levels.var() == pytest.approx(2.0**2 + 0.05 * 100.0 + 1.0 / 12.0, rel=0.02)
    assert levels.mean() == pytest.approx(100.0, abs=0.02)


def test_row_noise_moves_whole_rows() -> None:
    sensor = SensorParams(kind="grey", row_noise=3.0)
    levels = picture(EMPTY | {"sensor": sensor, "background": 100.0})
    assert levels.mean(axis=1).std() == pytest.approx(3.0, rel=0.15)
    assert levels.std(axis=1).max() < 0.6


def test_the_sensor_clips_at_full_scale() -> None:
    levels = picture(EMPTY | {"sensor": SensorParams(kind="grey", gain=1.3)})
    assert np.all(levels == 255.0)


def test_gain_scales_the_noise_too() -> None:
    sensor = SensorParams(kind="grey", gain=2.0)
    levels = picture(EMPTY | {"noise": 2.0, "sensor": sensor, "background": 50.0})
    assert levels.mean() == pytest.approx(100.0, abs=0.05)
    assert levels.std() == pytest.approx(math.hypot(4.0, 12.0**-0.5), rel=0.02)


@pytest.mark.parametrize("level", [10.0, 120.0, 250.0])
def test_gamma_is_a_power_of_the_level(level: float) -> None:
    levels = picture(EMPTY | {"sensor": SensorParams(kind="grey", gamma=2.2), "background": level})
    assert np.ptp(levels) == 0.0
    assert levels[0, 0] == pytest.approx(255.0 * (level / 255.0) ** (1.0 / 2.2), abs=0.7)


@pytest.mark.parametrize("kind", ["colour", "bayer"])
def test_a_colour_camera_gives_blue_green_and_red_in_this_order(kind: Any) -> None:
    camera = EMPTY | {"sensor": SensorParams(kind=kind), "screen_colour": (0.1, 0.4, 0.9)}
    levels = picture(camera)
    assert levels.shape == (480, 640, 3)
    inner = levels[10:-10, 10:300].reshape(-1, 3)
    np.testing.assert_allclose([inner.min(axis=0), inner.max(axis=0)], [[20, 80, 180]] * 2, atol=1)


def test_a_cable_can_have_the_colour_of_the_screen_in_one_plane() -> None:
    camera = QUIET | {
        "sensor": SensorParams(kind="colour"),
        "screen_colour": (1.0, 1.0, 1.0),
        "cable_colour": (1.0, 1.0, 200.0 / 35.0),
    }
    blue, _, red = np.moveaxis(picture(camera), -1, 0)
    assert np.ptp(red) <= 1.0
    assert np.ptp(blue) > 100.0


def test_a_bright_cable_is_brighter_than_its_ground() -> None:
    levels = picture(QUIET | {"background": 40.0, "contrast": -160.0})
    assert levels.min() == 40.0
    assert levels.max() > 150.0


def test_compression_changes_the_picture_near_the_cable_alone() -> None:
    plain = picture(QUIET)
    packed = picture(QUIET | {"sensor": SensorParams(kind="grey", jpeg=40)})
    changed = np.flatnonzero(np.abs(packed - plain).max(axis=0) > 2.0)
    assert changed.size > 0
    assert changed.min() >= 304
    assert changed.max() <= 336


def test_a_filter_in_the_camera_correlates_neighbours() -> None:
    sensor = SensorParams(kind="grey", denoise_px=1.2)
    noise = picture(EMPTY | {"noise": 10.0, "sensor": sensor}) - 200.0
    correlation = (noise[:, 1:] * noise[:, :-1]).mean() / noise.var()
    # that of a Gaussian filter: exp(-1 / (4 s^2))
    assert correlation == pytest.approx(math.exp(-1.0 / (4.0 * 1.2**2)), abs=0.03)


# light


def test_a_gradient_changes_the_light_from_edge_to_edge() -> None:
    levels = picture(EMPTY | {"light": LightParams(gradient=(0.4, 0.0)), "background": 100.0})
    assert (levels[:, 0].mean(), levels[:, -1].mean()) == pytest.approx((80.0, 120.0), abs=0.5)


def test_steps_drift_and_flicker_change_the_level_over_time() -> None:
    light = LightParams(steps=(LightStep(at_s=0.3, level=0.5),), drift=0.2, drift_s=2.0)
    camera = EMPTY | {"light": light, "background": 100.0, "exposure_ms": 1.0}
    means = [shot.pixels.mean() for shot in exposures(plant(camera), 0.6)]
    times_s = 0.02 * np.arange(len(means))
    factor = np.where(times_s >= 0.3, 0.5, 1.0) * (1.0 + 0.2 * np.sin(math.pi * times_s))
    np.testing.assert_allclose(means, 100.0 * factor, atol=0.6)


def test_flicker_is_averaged_over_the_exposure() -> None:
    def swing_of(exposure_ms: float) -> float:
        light = LightParams(flicker=0.3, flicker_hz=60.0)
        camera = EMPTY | {"light": light, "background": 100.0, "exposure_ms": exposure_ms}
        means = [shot.pixels.mean() for shot in exposures(plant(camera), 0.2)]
        return float(np.ptp(means))

    # sampled at 50 Hz, 60 Hz gives 10 Hz: five samples a period, +-sin(72 degrees)
    assert swing_of(0.1) == pytest.approx(2.0 * 30.0 * math.sin(math.radians(72.0)), rel=0.06)
    assert swing_of(1000.0 / 60.0) < 1.5


def test_flicker_makes_bands_before_a_rolling_shutter() -> None:
    light = LightParams(flicker=0.3, flicker_hz=100.0)
    camera = EMPTY | {"light": light, "row_us": 33.3, "exposure_ms": 1.0, "background": 100.0}
    rows = picture(camera).mean(axis=1)
    assert np.ptp(rows) > 40.0
    # 10 ms of a period are 300 rows
    crossings = np.flatnonzero(np.diff(np.sign(rows - 100.0)))
    assert np.diff(crossings).max() == pytest.approx(150.0, abs=3.0)


def test_light_on_a_flank_moves_the_cable_to_the_other_side_down_the_picture() -> None:
    plain, lit = picture(QUIET), picture(QUIET | {"light": LightParams(flank=60.0)})
    columns = np.arange(640)

    def centre(levels: Levels, row: int) -> float:
        dark = 200.0 - levels[row]
        return float((dark * columns).sum() / dark.sum())

    shifts = [centre(lit, row) - centre(plain, row) for row in (0, 240, 479)]
    assert 0.0 > shifts[0] > shifts[1] > shifts[2] > -0.5
    assert shifts[2] - shifts[0] < -0.05


# objects


def changed_box(camera: dict[str, Any], item: Any, **keys: Any) -> tuple[slice, slice, Levels]:
    """Draw an object: rows and columns that it changes, and by how much."""
    difference = picture(camera | {"objects": (item,)}, **keys) - picture(camera, **keys)
    rows, columns = np.nonzero(np.abs(difference) > 5.0)
    return (
        slice(rows.min(), rows.max() + 1),
        slice(columns.min(), columns.max() + 1),
        difference,
    )


def test_a_static_line_stands_where_its_point_is_and_is_as_dark_as_told() -> None:
    item = StaticLine(at_px=(100.0, 200.0), angle_deg=10.0, width_px=20.0, dark=0.5)
    _, _, difference = changed_box(EMPTY, item)
    row = 160  # 200 below a pivot 40 px above the picture
    centre = (difference[row] * np.arange(640)).sum() / difference[row].sum()
    assert centre == pytest.approx(420.0, abs=0.1)
    assert difference[row].min() == pytest.approx(-100.0, abs=1.0)
    lower = (difference[row + 100] * np.arange(640)).sum() / difference[row + 100].sum()
    assert lower - centre == pytest.approx(100.0 * math.tan(math.radians(10.0)), abs=0.2)


def test_a_shadow_is_beside_the_cable() -> None:
    rows, columns, _ = changed_box(QUIET, Shadow(shift_px=20.0, width_px=4.0))
    assert (rows.start, rows.stop) == (0, 480)
    assert 0.5 * (columns.start + columns.stop - 1) == pytest.approx(340.0, abs=0.5)


def test_the_load_is_a_disc_at_the_end_of_the_cable() -> None:
    item = LoadInPicture(radius_m=0.03)
    load = PendulumParams(length_m=0.4)
    rows, columns, _ = changed_box(EMPTY, item, pendulum=load)
    assert 0.5 * (rows.start + rows.stop - 1) == pytest.approx(360.0, abs=0.5)
    assert columns.stop - columns.start == pytest.approx(60, abs=3)


def test_knots_are_at_equal_distances() -> None:
    _, _, difference = changed_box(EMPTY, Knots(spacing_m=0.1, radius_px=5.0))
    profile = difference[:, 320]
    rows = np.flatnonzero((profile[1:-1] < -100.0) & (np.abs(np.diff(profile[:-1])) < 60.0)) + 1
    centres = [part.mean() for part in np.split(rows, np.flatnonzero(np.diff(rows) > 20) + 1)]
    np.testing.assert_allclose(centres, [60.0, 160.0, 260.0, 360.0, 460.0], atol=1.0)


def test_a_hand_hides_the_cable_while_it_is_there() -> None:
    item = Hand(tip_px=(-60.0, 300.0), angle_deg=0.0, width_px=40.0, from_s=0.1, to_s=0.2)
    params = plant(QUIET | {"objects": (item,)})
    shots = exposures(params, 0.3)
    seen = [shot.pixels[260, 320] < 60 for shot in shots]
    assert seen == [not 0.1 <= 0.02 * k < 0.2 for k in range(len(shots))]


def test_a_patch_hides_the_cable_behind_the_screen() -> None:
    item = Patch(corner_px=(-50.0, 140.0), size_px=(100.0, 60.0))
    levels = picture(QUIET | {"objects": (item,)})
    hidden = levels[100:160, 320]
    assert np.all(hidden == 200.0)
    assert levels[95, 320] < 60.0
    assert levels[165, 320] < 60.0


def test_rows_of_the_cable_that_are_hidden_do_not_count() -> None:
    item = Patch(corner_px=(-50.0, 140.0), size_px=(100.0, 60.0))
    params = plant(QUIET | {"objects": (item,)})
    (frame,) = swinging_video(params, 0.01)
    truth = Imager(params, 0).truth(frame.exposure.states, 0.0)
    assert truth.rows == 480 - 61


def test_dust_is_the_same_in_every_picture_of_a_seed() -> None:
    camera = EMPTY | {"objects": (Dust(count=50, radius_px=2.0),)}
    first, second = (shot.pixels for shot in exposures(plant(camera, seed=3), 0.04)[:2])
    np.testing.assert_array_equal(first, second)
    assert 200 < np.count_nonzero(first < 150) < 1500
    assert (first != first_picture(plant(camera, seed=4))).any()


def test_glare_is_a_bright_spot_that_moves() -> None:
    item = Glare(at_px=(0.0, 200.0), level=40.0, radius_px=20.0, velocity_px_s=(500.0, 0.0))
    for shot in exposures(plant(EMPTY | {"objects": (item,)}), 0.1):
        row, column = np.unravel_index(np.argmax(shot.pixels), shot.pixels.shape)
        bright = shot.pixels.astype(float) - 200.0
        centre = (bright * np.arange(640)).sum() / bright.sum()
        assert (row, shot.pixels.max()) == (pytest.approx(160, abs=3), 240)
        assert centre == pytest.approx(320.0 + 500.0 * shot.start_ns * 1e-9, abs=0.5)
        assert abs(column - centre) < 6


# shutter


def test_a_rolling_shutter_may_expose_two_pictures_at_the_same_time() -> None:
    shots = exposures(plant({"row_us": 33.3, "sensor": GREY}), 0.1)
    assert [shot.start_ns for shot in shots] == [20_000_000 * k for k in range(5)]
    assert {shot.readout_ns for shot in shots} == {479 * 33_300}
    assert shots[0].start_ns + shots[0].exposure_ns + shots[0].readout_ns > shots[1].start_ns


def test_the_delay_of_the_trigger_is_not_in_the_stamp() -> None:
    shots = exposures(plant({"jitter_us": 500.0}), 2.0)
    delays_us = np.array([shot.true_start_ns - shot.start_ns for shot in shots]) / 1e3
    assert [shot.start_ns for shot in shots] == [20_000_000 * k for k in range(100)]
    assert delays_us.min() >= 0.0
    # half a normal distribution
    assert delays_us.mean() == pytest.approx(500.0 * math.sqrt(2.0 / math.pi), rel=0.2)


def test_a_camera_has_a_rate_of_its_own() -> None:
    params = plant({"rate_hz": 25.0})
    assert [shot.start_ns for shot in exposures(params, 0.2)] == [40_000_000 * k for k in range(5)]


def test_equal_calls_of_the_shutter_do_not_depend_on_the_view_of_others() -> None:
    params = BenchParams(cameras=(CameraParams(), CameraParams(plane="y")), seed=2)
    alone, beside = Shutter(params, 0), Shutter(params, 0)
    bench, other = Bench(params), Shutter(params, 1)
    first = None
    while first is None:
        bench.advance(alone.next_ns)
        first = alone.sample(bench)
    bench = Bench(params)
    second = None
    while second is None:
        if other.next_ns <= beside.next_ns:
            bench.advance(other.next_ns)
            other.sample(bench)
        else:
            bench.advance(beside.next_ns)
            second = beside.sample(bench)
    np.testing.assert_array_equal(first.pixels, second.pixels)


# single frames


def test_dropped_frames_are_missing_and_the_others_keep_their_stamps() -> None:
    params = plant({"faults": CameraFaults(dropped=0.3)}, view=View(width=64, height=64))
    shots = exposures(params, 4.0)
    assert 110 < len(shots) < 170
    assert all(shot.start_ns == 20_000_000 * shot.number for shot in shots)


def test_duplicated_frames_show_the_picture_before() -> None:
    params = plant({"faults": CameraFaults(duplicated=0.3)}, view=View(width=64, height=64))
    shots = exposures(params, 2.0)
    equal = [np.array_equal(before.pixels, after.pixels) for before, after in pairwise(shots)]
    assert 0.15 < np.mean(equal) < 0.5


def test_a_frozen_picture_stands_still_for_its_interval() -> None:
    faults = CameraFaults(frozen=(Interval(from_s=0.2, to_s=0.4),))
    camera = {"faults": faults, "sensor": GREY}
    shots = exposures(plant(camera, view=View(width=64, height=64)), 0.6)
    equal = [np.array_equal(shot.pixels, shots[9].pixels) for shot in shots]
    assert [k for k, is_equal in enumerate(equal) if is_equal] == list(range(9, 20))


def test_damaged_frames_have_a_band_of_wrong_rows() -> None:
    camera = QUIET | {"faults": CameraFaults(damaged=1.0)}
    clean = picture(QUIET)
    damaged = first_picture(plant(camera, seed=5))
    rows = np.flatnonzero((damaged != clean).any(axis=1))
    assert 2 <= rows.size <= 240
    assert rows[-1] - rows[0] + 1 == pytest.approx(rows.size, abs=2)


# what cannot be


@pytest.mark.parametrize(
    ("camera", "told"),
    [
        ({"shift_m": (0.0, 2.0, 0.0)}, "behind the screen; the second value must be < 2 m"),
        ({"exposure_ms": 21.0}, "must be <= 20 ms, the frame period"),
        ({"row_us": 42.0}, r"480 rows take 20\.16 ms; must be <= 20 ms, the frame period"),
        ({"row_us": 30.0, "rate_hz": 100.0}, "must be <= 10 ms, the frame period"),
    ],
)
def test_a_camera_that_cannot_be_is_refused_with_its_bound(
    camera: dict[str, Any], told: str
) -> None:
    with pytest.raises(ValueError, match=told):
        plant(camera)
