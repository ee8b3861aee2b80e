"""Cameras and pipelines: stamps of the driver, and what is refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.vision.recordings import FakeCamera, found, swing
from vision.errors import VisionError
from vision.live import LiveSource, has_gstreamer
from vision.sources import open_source
from vision.stream import FindingKind, SourceOptions, StampKind

STAMPS_MS = [7000.0 + 20.0 * index + 60.0 * (index >= 15) for index in range(30)]


def test_a_camera_gives_the_stamps_of_its_driver_and_its_gaps() -> None:
    source = LiveSource(FakeCamera(swing(30), STAMPS_MS), "camera 0", "camera", SourceOptions())
    frames = list(source.frames())
    expected_s = 1e-3 * (np.array(STAMPS_MS) - STAMPS_MS[0])
    assert [frame.t_s for frame in frames] == pytest.approx(expected_s)
    assert {frame.stamp for frame in frames} == {StampKind.DEVICE}
    assert [finding.first for finding in found(source, FindingKind.GAP)] == [15]


def test_a_camera_without_stamps_is_timed_by_the_arrival_of_its_pictures() -> None:
    arrivals_s = iter(np.arange(100.0, 101.0, 0.05))
    source = LiveSource(
        FakeCamera(swing(10), [0.0] * 10),
        "camera 0",
        "camera",
        SourceOptions(),
        lambda: float(next(arrivals_s)),
    )
    frames = list(source.frames())
    assert [frame.t_s for frame in frames] == pytest.approx(0.05 * np.arange(10))
    assert {frame.stamp for frame in frames} == {StampKind.ARRIVAL}


def test_the_frames_of_the_first_look_come_again() -> None:
    source = LiveSource(FakeCamera(swing(30), STAMPS_MS), "camera 0", "camera", SourceOptions())
    assert [frame.number for frame in source.spread(8)] == list(range(8))
    assert [frame.number for frame in source.frames()] == list(range(30))


def test_a_camera_is_described_as_it_was_set() -> None:
    camera = FakeCamera(swing(1), [0.0])
    source = LiveSource(camera, "camera 0", "camera", SourceOptions())
    assert source.about.rate_hz == 50.0
    assert source.about.codec == "YUYV"
    assert source.about.is_live
    source.close()
    assert camera.is_released


def test_a_camera_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(VisionError, match="/dev/video97 does not exist; must be one of"):
        open_source("97")


@pytest.mark.skipif(has_gstreamer(), reason="this OpenCV has GStreamer")
def test_a_pipeline_needs_an_opencv_that_is_built_with_it() -> None:
    with pytest.raises(VisionError, match="built without GStreamer"):
        open_source("videotestsrc ! appsink")


def test_the_build_information_tells_of_gstreamer(monkeypatch: pytest.MonkeyPatch) -> None:
    text = "  Video I/O:\n    GStreamer:                   YES (1.20.3)\n"
    monkeypatch.setattr(cv2, "getBuildInformation", lambda: text)
    assert has_gstreamer()
