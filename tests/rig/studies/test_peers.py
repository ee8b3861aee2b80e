"""The two trackers to compare with, on pictures drawn by code that they do not share."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rig.studies.vision.peers import PEERS, ParabolaTracker
from tests.vision.rendered_cable import HEIGHT, PIVOT_PX, WIDTH, Camera, Scene

EACH = pytest.mark.parametrize("name", PEERS)


def measure(name, light, pivot_px=PIVOT_PX, noise=2.0):
    """Result of a peer on one picture."""
    picture = Camera(seed=5, noise=noise).expose(light)
    return PEERS[name](WIDTH, HEIGHT).measure(picture, pivot_px)


@EACH
@pytest.mark.parametrize("angle_rad", [-0.4, -0.1, 0.0, 0.003, 0.25, 0.5])
@pytest.mark.parametrize("width_px", [2.0, 5.0])
def test_a_peer_measures_the_angle_of_a_drawn_cable(name, angle_rad, width_px) -> None:
    found = measure(name, Scene(angle_rad=angle_rad, width_px=width_px).light())
    assert found.angle_rad == pytest.approx(angle_rad, abs=2e-4)


@EACH
def test_a_peer_gives_no_angle_of_a_screen_without_a_cable(name) -> None:
    light = np.full((HEIGHT, WIDTH), 200.0)
    assert measure(name, light).angle_rad is None
    assert measure(name, light, noise=0.0).angle_rad is None


@EACH
def test_a_peer_gives_no_angle_of_a_bright_cable_on_a_dark_screen(name) -> None:
    light = 255.0 - Scene(angle_rad=0.1).light()
    assert measure(name, light).angle_rad is None


@EACH
@pytest.mark.parametrize(("miss_px", "is_found"), [(3.0, True), (8.0, False), (60.0, False)])
def test_a_line_more_than_five_pixels_from_the_pivot_is_refused(name, miss_px, is_found) -> None:
    pivot_px = (PIVOT_PX[0] + miss_px, PIVOT_PX[1])
    found = measure(name, Scene(angle_rad=0.1).light(), pivot_px)
    assert (found.angle_rad is not None) is is_found


@EACH
def test_a_line_beyond_45_degrees_is_refused(name) -> None:
    light = Scene(angle_rad=0.9, pivot_px=(100.0, 10.0)).light()
    assert measure(name, light, (100.0, 10.0)).angle_rad is None


@EACH
def test_the_edge_of_a_bar_is_not_taken_for_a_cable(name) -> None:
    light = np.full((HEIGHT, WIDTH), 200.0)
    light[:, 320:420] = 40.0
    assert measure(name, light).angle_rad is None


@EACH
def test_a_cable_that_is_covered_in_places_is_measured_from_the_rest(name) -> None:
    light = Scene(angle_rad=0.2).light()
    light[120:180] = 60.0
    light[300:340] = 210.0
    assert measure(name, light).angle_rad == pytest.approx(0.2, abs=3e-4)


@EACH
def test_a_cable_beside_a_second_line_elsewhere_is_measured(name) -> None:
    other = Scene(angle_rad=0.0, pivot_px=(500.0, -40.0))
    light = np.minimum(Scene(angle_rad=0.05).light(), other.light() + 40.0)
    assert measure(name, light).angle_rad == pytest.approx(0.05, abs=3e-4)


@EACH
def test_a_peer_gives_the_same_result_for_the_same_picture(name) -> None:
    picture = Camera(seed=2, noise=8.0).expose(Scene(angle_rad=0.15).light())
    tracker = PEERS[name](WIDTH, HEIGHT)
    first = tracker.measure(picture, PIVOT_PX)
    assert tracker.measure(picture, PIVOT_PX) == first
    assert PEERS[name](WIDTH, HEIGHT).measure(picture, PIVOT_PX) == first


def test_the_deviation_of_the_parabola_is_that_of_its_errors_in_white_noise() -> None:
    camera = Camera(seed=11, noise=4.0)
    tracker = ParabolaTracker(WIDTH, HEIGHT)
    ratios = []
    for angle_rad in np.linspace(-0.3, 0.3, 40):
        found = tracker.measure(camera.expose(Scene(angle_rad=angle_rad).light()), PIVOT_PX)
        assert found.angle_rad is not None
        assert found.sigma_rad is not None
        ratios.append((found.angle_rad - angle_rad) / found.sigma_rad)
    assert 0.7 < math.sqrt(np.mean(np.square(ratios))) < 1.5
