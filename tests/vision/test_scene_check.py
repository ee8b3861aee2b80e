"""The static scene of a live run: what it removes, and that a moved camera gives no angle."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from tests.vision.rendered_cable import HEIGHT, PIVOT_PX, WIDTH, Camera, FloatArray, Grey, stripe
from vision.fit import Fit
from vision.ridge import grey_levels
from vision.scene_check import SceneCheck
from vision.static_scene import StaticScene
from vision.templates import CableLook, make_templates
from vision.tracker import Tracker, TrackFailure

REACH_PX = make_templates(CableLook()).half_px
FAR = (40.0, 0.0)  # line of a cable that hides none of the scene
LEVEL, CONTRAST = 210.0, 165.0


def lines(*offsets_px: float) -> FloatArray:
    """Darkness of upright lines beside the pivot."""
    dark = np.zeros((HEIGHT, WIDTH))
    for offset_px in offsets_px:
        at_px = (PIVOT_PX[0] + offset_px, PIVOT_PX[1])
        dark = np.maximum(dark, stripe(0.0, at_px, 2.5, 0.85))
    return dark


def exposed(camera: Camera, dark: FloatArray, light: float = 1.0) -> Grey:
    return camera.expose(light * (LEVEL - CONTRAST * dark))


def scene(*offsets_px: float) -> Grey:
    return exposed(Camera(1, noise=0.0), lines(*offsets_px))


def fits(check: SceneCheck, image: Grey, line_px: tuple[float, float] = FAR) -> bool:
    fit = Fit(line_px=line_px, background=grey_levels(image).background)
    return check.fits(image, fit, CableLook())


@pytest.mark.parametrize("noise", [1.0, 4.0, 20.0])
@pytest.mark.parametrize("light", [0.5, 1.0, 1.2])
def test_the_scene_fits_in_any_light_and_noise(noise: float, light: float) -> None:
    check = SceneCheck(scene(0.0, 70.0))
    image = exposed(Camera(2, noise), lines(0.0, 70.0), light)
    assert fits(check, image)


@pytest.mark.parametrize("shift_px", [2.0, -2.0, 3.5, 6.0, 20.0])
@pytest.mark.parametrize("noise", [1.0, 20.0])
def test_a_scene_that_has_moved_does_not_fit(shift_px: float, noise: float) -> None:
    check = SceneCheck(scene(0.0, 70.0))
    image = exposed(Camera(3, noise), lines(shift_px, 70.0 + shift_px))
    assert not fits(check, image)


def test_half_a_pixel_is_not_a_move() -> None:
    check = SceneCheck(scene(0.0, 70.0))
    assert fits(check, exposed(Camera(4), lines(0.5, 70.5)))


def test_where_nothing_static_is_seen_every_picture_fits() -> None:
    other = exposed(Camera(5), lines(0.0))
    assert fits(SceneCheck(scene()), other)
    # the cable hides the only line
    behind = (PIVOT_PX[0] + 100.0, 0.0)
    assert fits(SceneCheck(scene(100.0)), other, behind)


def test_a_turned_scene_does_not_fit() -> None:
    check = SceneCheck(scene(0.0, 70.0))
    turn = cv2.getRotationMatrix2D((WIDTH / 2.0, HEIGHT / 2.0), 1.5, 1.0)
    image = exposed(Camera(6), lines(0.0, 70.0))
    turned = cv2.warpAffine(image, turn, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REPLICATE)
    assert not fits(check, np.asarray(turned, np.uint8))


def test_between_two_static_lines_no_joint_is_seen_where_the_cable_is_hidden() -> None:
    camera = Camera(7, noise=2.0)
    tracker = Tracker(WIDTH, HEIGHT, static=StaticScene(scene(0.0, 12.0), REACH_PX))
    still = lines(0.0, 12.0)
    errors_rad = []
    for angle_rad in 0.15 * np.cos(0.0626 * np.arange(50)):
        dark = np.maximum(stripe(angle_rad, PIVOT_PX, 2.5, 0.85), still)
        fit = tracker.measure(exposed(camera, dark), PIVOT_PX)
        if fit.angle_rad is not None:
            errors_rad.append(fit.angle_rad - angle_rad)
    assert len(errors_rad) > 35
    assert np.abs(errors_rad).max() < 1e-3


def test_a_line_that_came_after_the_tour_is_remembered_while_the_cable_hides_it() -> None:
    camera = Camera(8)
    tracker = Tracker(WIDTH, HEIGHT, static=StaticScene(scene(), REACH_PX))
    reasons = []
    for angle_rad in (0.1, math.radians(0.05)):
        dark = np.maximum(stripe(angle_rad, PIVOT_PX, 2.5, 0.85), lines(0.0))
        reasons.append(tracker.measure(exposed(camera, dark), PIVOT_PX).reason)
    assert reasons == [TrackFailure.AMBIGUOUS, TrackFailure.AMBIGUOUS]


def test_the_scene_follows_the_width_of_the_cable() -> None:
    # free beside a thin cable, not beside one of 12 px
    rows, columns = np.array([100]), np.array([PIVOT_PX[0] + 12.0])
    still = StaticScene(scene(0.0), REACH_PX)
    assert still.is_free(rows, columns).all()
    wide = still.reaching(make_templates(CableLook(12.0, 0.85)).half_px)
    assert not wide.is_free(rows, columns).any()
    assert still.reaching(REACH_PX - 1) is still
