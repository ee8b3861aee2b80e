"""Matroska files of irregular stamps, read back by OpenCV and by a parser of their own."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from rig.errors import ConfigError
from rig.studies.vision.matroska import MatroskaWriter

WIDTH, HEIGHT = 64, 48
STAMP_TOLERANCE_MS = 0.001  # one tick; half a tick for each of two stamps
PICTURE_TOLERANCE = 2  # grey levels between two decoders
TWENTY_MS = np.arange(60) * 20.0
INTERVALS_MS = np.random.default_rng(3).uniform(2.0, 90.0, 120)
STAMPS_MS = {
    "constant": TWENTY_MS,
    "thirds of a millisecond": np.arange(90) * 1000 / 30,
    "variable": np.cumsum(INTERVALS_MS),
    "closer than a millisecond": np.arange(60) * 0.37,
    "hole of a minute": np.concatenate([TWENTY_MS, TWENTY_MS + 61_000]),
    "step back to the start": np.concatenate([TWENTY_MS, TWENTY_MS]),
    "step back before the start": np.concatenate([TWENTY_MS + 5000, TWENTY_MS]),
    "two variable recordings": np.concatenate([np.cumsum(INTERVALS_MS)] * 2),
    "repeated": np.repeat(TWENTY_MS, 2),
    "start offset": TWENTY_MS + 1234.56,
    "Unix time": TWENTY_MS + 1.7e12,
    "single": np.array([7.5]),
}
# ids of RFC 9559, section 5
EBML, SEGMENT, INFO, TRACKS, CLUSTER = "1a45dfa3", "18538067", "1549a966", "1654ae6b", "1f43b675"
PARENTS = {EBML, SEGMENT, INFO, TRACKS, "ae", "e0", CLUSTER}


def encoded(frame: int) -> bytes:
    """Picture of a frame: a ramp of grey that moves by a column a frame."""
    ramp = np.linspace(0, 255, WIDTH).astype(np.uint8)
    picture = np.tile(np.roll(ramp, frame), (HEIGHT, 1))
    return cv2.imencode(".jpg", picture)[1].tobytes()


def written(path: Path, stamps_ms: np.ndarray) -> Path:
    """Write a file with one picture a stamp."""
    with MatroskaWriter(path, WIDTH, HEIGHT) as writer:
        for frame, t_ms in enumerate(stamps_ms):
            writer.add(float(t_ms), encoded(frame))
    return path


def read_back(path: Path) -> tuple[np.ndarray, list[np.ndarray]]:
    """Read stamps [ms] and pictures with OpenCV."""
    capture = cv2.VideoCapture(str(path))
    stamps_ms = []
    pictures = []
    while capture.grab():
        stamps_ms.append(capture.get(cv2.CAP_PROP_POS_MSEC))
        pictures.append(capture.retrieve()[1])
    return np.array(stamps_ms), pictures


def vint(data: bytes, at: int, keep_marker: bool) -> tuple[int, int]:
    """Decode a variable-size integer (RFC 8794, section 4); return value and end."""
    length = 9 - data[at].bit_length()
    value = int.from_bytes(data[at : at + length], "big")
    if not keep_marker:
        value -= 1 << (7 * length)
    return value, at + length


def elements(data: bytes, start: int, end: int) -> Iterator[tuple[str, int, int]]:
    """Walk over all elements, parents first: id, start and end of the content."""
    while start < end:
        element, size_at = vint(data, start, keep_marker=True)
        size, content = vint(data, size_at, keep_marker=False)
        name = f"{element:x}"
        yield name, content, content + size
        if name in PARENTS:
            yield from elements(data, content, content + size)
        start = content + size
    assert start == end, "the sizes of the children do not sum to the size of their parent"


def contents(path: Path, wanted: str) -> list[bytes]:
    """Contents of the elements with one id, in order."""
    data = path.read_bytes()
    walk = elements(data, 0, len(data))
    return [data[start:end] for name, start, end in walk if name == wanted]


def number(content: bytes) -> int:
    """Value of an unsigned element."""
    return int.from_bytes(content, "big")


@pytest.mark.parametrize("name", STAMPS_MS)
def test_opencv_reads_every_stamp_from_the_first_one(tmp_path: Path, name: str) -> None:
    stamps_ms = STAMPS_MS[name]
    read_ms, _ = read_back(written(tmp_path / "video.mkv", stamps_ms))
    assert len(read_ms) == len(stamps_ms)
    np.testing.assert_allclose(read_ms, stamps_ms - stamps_ms[0], rtol=0, atol=STAMP_TOLERANCE_MS)


@pytest.mark.parametrize("name", STAMPS_MS)
def test_the_clusters_hold_every_stamp_as_given(tmp_path: Path, name: str) -> None:
    stamps_ms = STAMPS_MS[name]
    path = written(tmp_path / "video.mkv", stamps_ms)
    [tick_ns] = contents(path, "2ad7b1")
    ticks = np.array([number(content) for content in contents(path, "e7")])
    read_ms = ticks * (number(tick_ns) / 1e6)
    np.testing.assert_allclose(read_ms, stamps_ms, rtol=0, atol=STAMP_TOLERANCE_MS)


def test_opencv_reads_every_picture_across_a_step_back(tmp_path: Path) -> None:
    stamps_ms = STAMPS_MS["step back before the start"]
    _, pictures = read_back(written(tmp_path / "video.mkv", stamps_ms))
    assert len(pictures) == len(stamps_ms)
    for frame, picture in enumerate(pictures):
        jpeg = np.frombuffer(encoded(frame), np.uint8)
        expected = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
        assert cv2.absdiff(picture, expected).max() <= PICTURE_TOLERANCE


def test_opencv_reports_the_rate_and_the_count_of_a_constant_video(tmp_path: Path) -> None:
    path = written(tmp_path / "video.mkv", STAMPS_MS["start offset"])
    capture = cv2.VideoCapture(str(path))
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(50.0)
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) == 60
    assert capture.get(cv2.CAP_PROP_FRAME_WIDTH) == WIDTH
    assert capture.get(cv2.CAP_PROP_FRAME_HEIGHT) == HEIGHT


def test_the_elements_fill_the_file_in_order(tmp_path: Path) -> None:
    path = written(tmp_path / "video.mkv", TWENTY_MS)
    data = path.read_bytes()
    walk = list(elements(data, 0, len(data)))
    order = [name for name, _, _ in walk if name in {EBML, SEGMENT, INFO, TRACKS, CLUSTER}]
    assert order == [EBML, SEGMENT, INFO, TRACKS] + [CLUSTER] * len(TWENTY_MS)
    ends = {name: end for name, _, end in walk}
    assert ends[SEGMENT] == ends[CLUSTER] == path.stat().st_size


def test_the_head_describes_an_unlaced_motion_jpeg_track(tmp_path: Path) -> None:
    path = written(tmp_path / "video.mkv", TWENTY_MS)
    texts = {"4282": b"matroska", "86": b"V_MJPEG", "4d80": b"swayless", "5741": b"swayless"}
    for element, text in texts.items():
        assert contents(path, element) == [text]
    for element, value in {"83": 1, "9c": 0, "b0": WIDTH, "ba": HEIGHT}.items():
        assert [number(content) for content in contents(path, element)] == [value]
    [duration] = contents(path, "4489")
    assert struct.unpack(">d", duration)[0] == pytest.approx(60 * 20_000)


def test_a_block_is_a_key_frame_with_the_jpeg_as_given(tmp_path: Path) -> None:
    path = written(tmp_path / "video.mkv", TWENTY_MS)
    for frame, block in enumerate(contents(path, "a3")):
        track, offset_ticks, flags = struct.unpack(">BhB", block[:4])
        assert (track, offset_ticks, flags) == (0x81, 0, 0x80)
        assert block[4:] == encoded(frame)


@pytest.mark.parametrize("name", ["single", "repeated"])
def test_the_duration_is_positive(tmp_path: Path, name: str) -> None:
    [duration] = contents(written(tmp_path / "video.mkv", STAMPS_MS[name][:2]), "4489")
    assert struct.unpack(">d", duration)[0] > 0


def test_a_file_can_be_read_before_it_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "video.mkv"
    with MatroskaWriter(path, WIDTH, HEIGHT) as writer:
        for frame, t_ms in enumerate(TWENTY_MS):
            writer.add(float(t_ms), encoded(frame))
        unfinished = path.read_bytes()
    path.write_bytes(unfinished)
    read_ms, _ = read_back(path)
    assert len(read_ms) > len(TWENTY_MS) / 2  # the rest is in the buffer of the file
    np.testing.assert_allclose(read_ms, TWENTY_MS[: len(read_ms)], rtol=0, atol=STAMP_TOLERANCE_MS)


@pytest.mark.parametrize(
    ("t_ms", "jpeg", "text"),
    [
        (-0.5, encoded(0), "t_ms = -0.5 of frame 1; must be 0 to 1e+13: add one offset to all"),
        (math.nan, encoded(0), "t_ms = nan of frame 1; must be 0 to 1e+13: add one offset"),
        (2e13, encoded(0), "t_ms = 20000000000000.0 of frame 1; must be 0 to 1e+13"),
        (20.0, b"", "jpeg of frame 1: 0 bytes, .* must start with 'ffd8': encode the picture"),
        (20.0, b"\x89PNG", "jpeg of frame 1: 4 bytes, the first two '8950'; must start with"),
    ],
)
def test_a_refused_picture_leaves_the_others_readable(
    tmp_path: Path, t_ms: float, jpeg: bytes, text: str
) -> None:
    path = tmp_path / "video.mkv"
    with MatroskaWriter(path, WIDTH, HEIGHT) as writer:
        writer.add(0.0, encoded(0))
        with pytest.raises(ConfigError, match=text.replace("+", r"\+")):
            writer.add(t_ms, jpeg)
        writer.add(20.0, encoded(1))
    read_ms, _ = read_back(path)
    assert list(read_ms) == [0.0, 20.0]


def test_closing_twice_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "video.mkv"
    writer = MatroskaWriter(path, WIDTH, HEIGHT)
    writer.add(0.0, encoded(0))
    writer.close()
    data = path.read_bytes()
    writer.close()
    assert path.read_bytes() == data
