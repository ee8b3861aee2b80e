"""Angles of two links in rendered pictures, by a pitched camera with offset table or model."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import pytest

from comms.messages import AngleSample, Frame, Phase, RobotState
from sim_rig.cable_state import CableState
from sim_rig.camera_params import CameraParams
from sim_rig.imager import Imager
from sim_rig.link_angles import LinkState
from sim_rig.load_params import LinkParams
from sim_rig.params import BenchParams
from vision.camera_model import CameraParameters
from vision.task import VisionSettings, VisionTask

MS = 1_000_000
WIDTH, HEIGHT = 640, 480
PITCH = math.radians(3.0)
LENGTHS_M = (0.3, 0.5)
PLACE_M = 0.1
BELOW_PIVOT_M = 0.28


def settings(**keys: Any) -> VisionSettings:
    """Settings of the task for a camera 1 m before the plane of the swing."""
    turn = np.array(
        [
            [1.0, 0.0, 0.0],
            [0.0, -math.sin(PITCH), -math.cos(PITCH)],
            [0.0, math.cos(PITCH), -math.sin(PITCH)],
        ]
    )
    move = -turn @ np.array([0.0, -1.0, -BELOW_PIVOT_M])
    pivot = 1000.0 * move[1] / move[2] + HEIGHT / 2
    model = CameraParameters(
        focal_px=(1000.0, 1000.0),
        centre_px=(WIDTH / 2, HEIGHT / 2),
        distortion=(0.0, 0.0, 0.0, 0.0, 0.0),
        rotation=tuple(cv2.Rodrigues(turn)[0].ravel().tolist()),
        translation_m=tuple(move.tolist()),
    )
    places_m = [-0.2, 0.2]
    common: dict[str, Any] = {
        "width": WIDTH,
        "height": HEIGHT,
        "period_ns": 20 * MS,
        "pivot_home_px": (WIDTH / 2, pivot),
        "pixels_per_m": 1000.0 / move[2],
        "x_m": places_m,
        "offset_rad": [math.atan(-math.sin(PITCH) * x_m) for x_m in places_m],
        "camera_distance_m": 1.0,
    }
    if keys.pop("by_model"):
        common |= {"model": model, "x_m": [], "offset_rad": []}
    return VisionSettings(**common)


def measured(task: VisionTask, angles: tuple[float, float], number: int) -> AngleSample:
    """Angle sample of a picture of a load with two links."""
    links = tuple(LinkParams(length_m=length_m, mass_kg=0.3) for length_m in LENGTHS_M)
    camera = CameraParams(pitch_deg=math.degrees(PITCH))
    imager = Imager(BenchParams(cameras=(camera,), links=links), 0)
    states = [LinkState(angle, 0.0, 0.0, 0.0) for angle in angles]
    state = CableState((PLACE_M, 0.0, 0.0), states, list(LENGTHS_M), [])
    picture = imager.picture([state] * len(imager.instants_ns), 0.0, number)
    t_ns = (number + 1) * 100 * MS
    platform = RobotState(
        seq=number,
        t_ns=t_ns,
        t_actual_ns=t_ns,
        commanded_m=(0.0, 0.0, 0.0),
        actual_m=(PLACE_M, 0.0, 0.0),
        actual_velocity_m_s=(0.0, 0.0, 0.0),
        phase=Phase.RUNNING,
    )
    task.on_message("platform_1", platform, t_ns)
    frame = Frame(
        seq=number,
        t_ns=t_ns + 10 * MS,
        t_exposure_start_ns=t_ns,
        exposure_ns=10 * MS,
        row_ns=0,
        camera="test",
        encoding="mono8",
        height=HEIGHT,
        width=WIDTH,
        pixels=picture,
    )
    (send,) = task.on_message("frame_1", frame, t_ns + 20 * MS).sends
    assert isinstance(send.message, AngleSample)
    return send.message


@pytest.mark.parametrize("by_model", [False, True])
def test_the_task_sends_the_angles_of_both_links_and_the_joint(by_model: bool) -> None:
    task = VisionTask(settings(by_model=by_model))
    for number, angles in enumerate([(0.05, 0.15), (-0.1, 0.05), (0.1, -0.1)]):
        sample = measured(task, angles, number)
        assert len(sample.links) == 2, sample.reason
        for link, angle in zip(sample.links, angles, strict=True):
            assert link.angle_rad == pytest.approx(angle, abs=0.2e-3)
            assert link.raw_rad - link.offset_rad == pytest.approx(link.angle_rad, abs=1e-12)
        joint = sample.links[1].joint_px
        assert joint is not None
        # 0.3 m down the first link, seen by a camera that is pitched
        down = LENGTHS_M[0] * math.cos(angles[0]) - BELOW_PIVOT_M
        away = math.cos(PITCH) + down * math.sin(PITCH)
        across_m = PLACE_M + LENGTHS_M[0] * math.sin(angles[0])
        row = HEIGHT / 2 + 1000.0 * (down * math.cos(PITCH) - math.sin(PITCH)) / away
        assert joint == pytest.approx((WIDTH / 2 + 1000.0 * across_m / away, row), abs=2.0)


def test_one_link_has_one_angle() -> None:
    task = VisionTask(settings(by_model=False))
    sample = measured(task, (0.08, 0.08), 0)
    (link,) = sample.links
    assert link.angle_rad == pytest.approx(0.08, abs=0.1e-3)
