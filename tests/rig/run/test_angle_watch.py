"""Angles of several cameras at the streamer: the age of each, and the swing in both planes."""

from __future__ import annotations

import math

import pytest

from comms.messages import AngleSample, InvalidReason, LinkAngle, SwingPlane
from rig.analysis.identify.errors import AnalysisError
from rig.run.tasks.angle_watch import AngleWatch, WatchedCamera
from rig.run.tasks.pause import PauseMeter

MS = 1_000_000
OMEGA_RAD_S = math.sqrt(9.81)
PAUSE = PauseMeter(10 * MS)
TWO = (
    WatchedCamera(stale_ns=300 * MS),
    WatchedCamera(number=2, plane=SwingPlane.Y, stale_ns=600 * MS),
)


def angle(
    t_ns: int, angle_rad: float | None, reason: InvalidReason = InvalidReason.NONE
) -> AngleSample:
    """Angle sample of now."""
    links: tuple[LinkAngle, ...] = ()
    if angle_rad is not None:
        cable = LinkAngle(
            angle_rad=angle_rad, sigma_rad=1e-5, raw_rad=angle_rad, offset_rad=0.0, joint_px=None
        )
        links = (cable,)
    return AngleSample(
        seq=0,
        t_ns=t_ns,
        t_valid_ns=t_ns,
        swing_plane=SwingPlane.X,
        valid=angle_rad is not None,
        reason=reason,
        platform_m=None,
        rows=400,
        residual_px=None,
        pivot_miss_px=None,
        background=200.0,
        saturation=0.0,
        links=links,
    )


def watched(**amplitudes_rad: float) -> AngleWatch:
    """Watch of two cameras that saw a second of these swings, by channel."""
    watch = AngleWatch(TWO)
    for k in range(50):
        t_ns = k * 20 * MS
        for channel, amplitude_rad in amplitudes_rad.items():
            seen_rad = amplitude_rad * math.cos(OMEGA_RAD_S * t_ns * 1e-9)
            watch.take(channel, angle(t_ns, seen_rad), t_ns, is_quiet=True)
    return watch


def test_angles_of_all_cameras_are_fresh_up_to_their_bounds() -> None:
    watch = AngleWatch(TWO)
    watch.take("angle_1", angle(400 * MS, 0.0), 400 * MS, is_quiet=False)
    watch.take("angle_2", angle(100 * MS, 0.0), 100 * MS, is_quiet=False)
    assert watch.stale(700 * MS, 0, PAUSE) is None


@pytest.mark.parametrize(("silent", "bound_ms"), [(1, 300), (2, 600)])
def test_a_stale_angle_of_any_camera_names_camera_age_and_bound(silent: int, bound_ms: int) -> None:
    watch = AngleWatch(TWO)
    now_ns = (bound_ms + 10) * MS
    watch.take(f"angle_{3 - silent}", angle(now_ns, 0.0), now_ns, is_quiet=False)
    assert watch.stale(now_ns, 0, PAUSE) == (
        f"no valid cable angle of camera {silent} for {bound_ms + 10} ms; "
        f"must be <= {bound_ms} ms (no picture arrived): check camera, screen and calibration"
    )


def test_a_camera_that_sees_no_cable_names_its_own_reason() -> None:
    watch = AngleWatch(TWO)
    now_ns = 700 * MS
    watch.take("angle_1", angle(now_ns, 0.0), now_ns, is_quiet=False)
    unseen = angle(now_ns, None, InvalidReason.FEW_ROWS)
    watch.take("angle_2", unseen, now_ns, is_quiet=False)
    assert "of camera 2 for 700 ms; must be <= 600 ms (last reason: few_rows)" in str(
        watch.stale(now_ns, 0, PAUSE)
    )


@pytest.mark.parametrize(
    ("x_rad", "y_rad", "expected"),
    [(0.004, 0.02, (0.02, "y")), (0.03, 0.02, (0.03, "x"))],
)
def test_the_larger_swing_of_both_planes_decides(
    x_rad: float, y_rad: float, expected: tuple[float, str]
) -> None:
    swing_rad, where = watched(angle_1=x_rad, angle_2=y_rad).initial_swing(OMEGA_RAD_S)
    assert swing_rad == pytest.approx(expected[0], rel=1e-9)
    assert where == f" in the plane {expected[1]}"


def test_two_cameras_of_one_plane_are_one_fit() -> None:
    watch = AngleWatch((TWO[0], WatchedCamera(number=2, stale_ns=300 * MS)))
    for k in range(100):
        t_ns = k * 10 * MS
        seen_rad = 0.01 * math.sin(OMEGA_RAD_S * t_ns * 1e-9)
        watch.take(f"angle_{1 + k % 2}", angle(t_ns, seen_rad), t_ns, is_quiet=True)
    swing_rad, where = watch.initial_swing(OMEGA_RAD_S)
    assert swing_rad == pytest.approx(0.01, rel=1e-9)
    assert where == ""


def test_a_plane_whose_camera_saw_too_little_is_named() -> None:
    with pytest.raises(AnalysisError, match="in the plane y: 0 samples in the quiet interval"):
        watched(angle_1=0.001).initial_swing(OMEGA_RAD_S)


def test_an_angle_of_a_camera_that_is_not_of_the_run_changes_nothing() -> None:
    watch = AngleWatch(TWO[:1])
    watch.take("angle_2", angle(500 * MS, 0.3), 500 * MS, is_quiet=True)
    assert "no valid cable angle for 500 ms" in str(watch.stale(500 * MS, 0, PAUSE))
