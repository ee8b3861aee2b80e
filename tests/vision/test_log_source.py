"""Pictures in the log of a run."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from comms.mcap_log import LogWriter
from comms.records import CompressedImage, Stamp
from tests.vision.recordings import jpeg, swing
from vision.errors import VisionError
from vision.sources import open_source
from vision.stream import SourceOptions, StampKind

PERIOD_NS = 20_000_000
START_NS = 2_990_000_001


def write_log(path: Path, topic: str, count: int) -> None:
    log = LogWriter(path, {}, 0)
    for index, picture in enumerate(swing(count)):
        seconds, nanoseconds = divmod(START_NS + index * PERIOD_NS, 10**9)
        stamp = Stamp(sec=seconds, nsec=nanoseconds)
        image = CompressedImage(timestamp=stamp, frame_id="c", data=jpeg(picture), format="jpeg")
        log.write(topic, image, index, index)
    log.close({})


@pytest.mark.parametrize("camera", [1, 2])
def test_a_log_gives_the_pictures_of_a_camera_with_their_stamps(
    camera: int, tmp_path: Path
) -> None:
    write_log(tmp_path / "run.mcap", "/camera/image" if camera == 1 else "/camera_2/image", 12)
    source = open_source(tmp_path, SourceOptions(camera=camera))
    frames = list(source.frames())
    assert [frame.t_s for frame in frames] == pytest.approx(0.02 * np.arange(12), abs=1e-9)
    assert {frame.stamp for frame in frames} == {StampKind.LOG}
    assert source.findings == []
    assert source.about.kind == "log"
    for frame, picture in zip(frames, swing(12), strict=True):
        assert cv2.absdiff(frame.image, picture).mean() < 4.0
    assert [frame.number for frame in source.spread(3)] == [0, 4, 8]


def test_a_log_without_pictures_of_the_camera_names_those_it_has(tmp_path: Path) -> None:
    write_log(tmp_path / "run.mcap", "/camera/image", 3)
    with pytest.raises(VisionError, match="no pictures on /camera_2/image; the log has /camera/im"):
        open_source(tmp_path / "run.mcap", SourceOptions(camera=2))


def test_a_file_that_is_no_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(b"no log")
    with pytest.raises(VisionError, match="need the log of a run"):
        open_source(tmp_path)
