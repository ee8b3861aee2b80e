"""Sources of frames: true time, irregular streams, and files that cannot be read."""

from __future__ import annotations

import struct
import subprocess
import sys
import wave
from pathlib import Path

import cv2
import numpy as np
import pytest

from rig.studies.vision.matroska import MatroskaWriter
from tests.vision.recordings import (
    found,
    jpeg,
    kinds,
    swing,
    with_flipped_bytes,
    write_stamped,
    write_video,
)
from vision.errors import VisionError
from vision.sources import open_source
from vision.stream import FindingKind, PictureFault, SourceOptions, StampKind
from vision.stream_check import summary

IRREGULAR = {
    "variable": [20.0 * index + 20.0 * (index // 2) for index in range(30)],
    "gap": [20.0 * index + 200.0 * (index >= 12) for index in range(30)],
    "joined": [20.0 * index - 300.0 * (index >= 18) for index in range(30)],
    "late": [5000.0 + 20.0 * index for index in range(30)],
    "odd": [33.367 * index for index in range(30)],
}


@pytest.mark.parametrize("name", IRREGULAR)
def test_stamps_are_those_of_the_container_less_the_first(name: str, tmp_path: Path) -> None:
    stamps_ms = IRREGULAR[name]
    path = write_stamped(tmp_path / "v.mkv", swing(30), stamps_ms)
    frames = list(open_source(path).frames())
    expected_s = 1e-3 * (np.array(stamps_ms) - stamps_ms[0])
    assert [frame.t_s for frame in frames] == pytest.approx(expected_s, abs=2e-6)
    assert {frame.stamp for frame in frames} == {StampKind.CONTAINER}
    assert [frame.number for frame in frames] == list(range(30))
    assert all(not frame.faults for frame in frames)


def test_a_regular_recording_has_no_findings(tmp_path: Path) -> None:
    source = open_source(write_video(tmp_path / "v.avi", swing(60), "MJPG"))
    assert len(list(source.frames())) == 60
    assert source.findings == []


def test_a_gap_is_reported_with_its_frame_and_length(tmp_path: Path) -> None:
    source = open_source(write_stamped(tmp_path / "v.mkv", swing(30), IRREGULAR["gap"]))
    list(source.frames())
    (gap,) = found(source, FindingKind.GAP)
    assert (gap.first, gap.last) == (12, 12)
    assert gap.value == pytest.approx(0.2)


def test_a_step_back_is_reported_with_its_frame_and_size(tmp_path: Path) -> None:
    source = open_source(write_stamped(tmp_path / "v.mkv", swing(30), IRREGULAR["joined"]))
    list(source.frames())
    (step,) = found(source, FindingKind.STEP_BACK)
    assert step.first == 18
    assert step.value == pytest.approx(0.28)


def test_a_repeated_stamp_is_reported(tmp_path: Path) -> None:
    stamps_ms = [20.0 * (index - (index >= 9)) for index in range(30)]
    source = open_source(write_stamped(tmp_path / "v.mkv", swing(30), stamps_ms))
    list(source.frames())
    assert [finding.first for finding in found(source, FindingKind.REPEATED_STAMP)] == [9]


def test_a_variable_rate_is_one_finding_and_no_gaps(tmp_path: Path) -> None:
    source = open_source(write_stamped(tmp_path / "v.mkv", swing(30), IRREGULAR["variable"]))
    list(source.frames())
    assert kinds(source) == {"uneven_rate"}
    assert len(source.findings) == 1


def test_findings_are_those_of_the_last_pass(tmp_path: Path) -> None:
    source = open_source(write_stamped(tmp_path / "v.mkv", swing(30), IRREGULAR["gap"]))
    first = [frame.t_s for frame in source.frames()]
    again = [frame.t_s for frame in source.frames()]
    assert first == again
    assert len(source.findings) == 1


def test_a_rate_replaces_the_stamps(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.avi", swing(10), "MJPG", 30.0)
    frames = list(open_source(path, SourceOptions(rate_hz=240.0)).frames())
    assert [frame.t_s for frame in frames] == pytest.approx(np.arange(10) / 240.0)
    assert {frame.stamp for frame in frames} == {StampKind.RATE}


def test_half_a_frame_a_second_is_a_rate_like_any_other(tmp_path: Path) -> None:
    frames = list(open_source(write_video(tmp_path / "v.avi", swing(5), "MJPG", 0.5)).frames())
    assert [frame.t_s for frame in frames] == pytest.approx([0.0, 2.0, 4.0, 6.0, 8.0])


def test_a_range_keeps_numbers_and_times_of_the_file(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.avi", swing(30), "MJPG")
    source = open_source(path, SourceOptions(from_s=0.1, to_s=0.2))
    frames = list(source.frames())
    assert [frame.number for frame in frames] == [5, 6, 7, 8, 9, 10]
    assert frames[0].t_s == pytest.approx(0.1)
    assert source.findings == []


def test_stamps_that_are_all_equal_give_way_to_the_rate_that_the_file_states(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_video(tmp_path / "v.avi", swing(6), "MJPG")
    without_stamps(monkeypatch)
    source = open_source(path)
    frames = list(source.frames())
    assert [frame.t_s for frame in frames] == pytest.approx(np.arange(6) / 50.0)
    assert {frame.stamp for frame in frames} == {StampKind.INDEX}
    assert found(source, FindingKind.NO_STAMPS)[0].value == 50.0


def test_without_stamps_and_rate_the_user_is_asked_for_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_video(tmp_path / "v.avi", swing(6), "MJPG")
    without_stamps(monkeypatch, rate_hz=90_000.0)
    with pytest.raises(VisionError, match="--rate"):
        open_source(path)


def without_stamps(monkeypatch: pytest.MonkeyPatch, rate_hz: float = 50.0) -> None:
    """Let all containers state no stamps, and this rate."""
    opened = cv2.VideoCapture

    class WithoutStamps:
        def __init__(self, *values: object) -> None:
            self._true = opened(*values)

        def get(self, what: int) -> float:
            fixed = {cv2.CAP_PROP_POS_MSEC: 0.0, cv2.CAP_PROP_FPS: rate_hz}
            return fixed[what] if what in fixed else self._true.get(what)

        def __getattr__(self, name: str) -> object:
            return getattr(self._true, name)

    monkeypatch.setattr(cv2, "VideoCapture", WithoutStamps)


@pytest.mark.parametrize("count", [7, 30, 100])
def test_spread_frames_span_the_file(count: int, tmp_path: Path) -> None:
    source = open_source(
        write_stamped(tmp_path / "v.mkv", swing(90), [20.0 * n for n in range(90)])
    )
    numbers = [frame.number for frame in source.spread(count)]
    assert len(numbers) == min(count, 90)
    assert numbers[0] == 0
    assert numbers[-1] >= 90 - 90 // count - 1
    assert max(np.diff(numbers)) <= 2 * 90 / min(count, 90) + 1


def test_spread_frames_of_a_long_file_have_their_stamps(tmp_path: Path) -> None:
    pictures = swing(40)
    repeated = (pictures[index % 40] for index in range(1200))
    source = open_source(write_video(tmp_path / "v.avi", repeated, "MJPG"))
    frames = source.spread(12)
    assert len(frames) == 12
    for frame in frames:
        assert frame.t_s == pytest.approx(frame.number / 50.0)
        expected = pictures[frame.number % 40].astype(float)
        assert np.abs(frame.image - expected).mean() < 4.0


@pytest.mark.parametrize("codec", ["FFV1", "MJPG", "mp4v"])
def test_no_damaged_picture_passes_without_its_flag(codec: str, tmp_path: Path) -> None:
    ending = "mp4" if codec == "mp4v" else "avi"
    path = write_video(tmp_path / f"v.{ending}", swing(48), codec)
    good = {frame.number: frame.image for frame in open_source(path).frames()}
    size = path.stat().st_size
    source = open_source(with_flipped_bytes(path, [int(0.3 * size), int(0.62 * size)]))
    wrong, flagged = set(), set()
    for frame in source.frames():
        if cv2.absdiff(frame.image, good[frame.number]).mean() > 0.01:
            wrong.add(frame.number)
        if PictureFault.DAMAGED in frame.faults:
            flagged.add(frame.number)
    assert wrong
    assert wrong <= flagged
    assert len(flagged) < 40
    named = found(source, FindingKind.DAMAGED)
    assert flagged == {n for run in named for n in range(run.first, run.last + 1)}


def test_a_checksum_names_a_picture_that_looks_right(tmp_path: Path) -> None:
    """A slice that its checksum refuses is replaced by the one before, without a visible edge."""
    code = (
        "import sys, os; from pathlib import Path\n"
        "os.environ['OPENCV_FFMPEG_WRITER_OPTIONS'] = 'level;3|slices;4|slicecrc;1'\n"
        "from tests.vision.recordings import swing, write_video\n"
        "write_video(Path(sys.argv[1]), swing(30, seed=3), 'FFV1')\n"
    )
    path = tmp_path / "v.mkv"
    subprocess.run([sys.executable, "-c", code, str(path)], check=True)
    middle = path.stat().st_size // 2
    source = open_source(with_flipped_bytes(path, [middle]))
    flagged = [frame.number for frame in source.frames() if frame.faults]
    assert flagged == list(range(flagged[0], 24))
    assert 12 <= flagged[0] <= 16


def test_a_file_that_was_cut_short_says_so(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.avi", swing(60), "MJPG")
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    source = open_source(path)
    read = len(list(source.frames()))
    (end,) = found(source, FindingKind.ENDS_EARLY)
    assert 35 < read < 45
    assert end.value == read
    assert "states 60" in end.text


def test_a_change_of_the_picture_size_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "v.mkv"
    with MatroskaWriter(path, 320, 240) as writer:
        for index, picture in enumerate(swing(20)):
            image = picture if index < 10 else cv2.resize(picture, (160, 120))
            writer.add(20.0 * index, jpeg(np.asarray(image, np.uint8)))
    source = open_source(path)
    assert {frame.image.shape for frame in source.frames()} == {(240, 320, 3)}
    (change,) = found(source, FindingKind.SIZE_CHANGE)
    assert change.first == 10
    assert change.value == 0.5


def test_errors_of_other_code_still_reach_the_terminal(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_video(tmp_path / "v.avi", swing(30), "MJPG")
    source = open_source(with_flipped_bytes(path, [path.stat().st_size // 2]))
    for frame in source.frames():
        sys.stderr.write(f"frame {frame.number}\n")
    assert capfd.readouterr().err.splitlines() == [f"frame {number}" for number in range(30)]


def test_a_summary_has_a_line_for_each_kind(tmp_path: Path) -> None:
    stamps_ms = [20.0 * index + 200.0 * (index // 10) for index in range(80)]
    source = open_source(write_stamped(tmp_path / "v.mkv", swing(80), stamps_ms))
    list(source.frames())
    (line,) = summary(source.findings)
    assert line.startswith("frames 10, 20, 30, 40, 50, 2 more: 0.200 s are missing")


def cut_mp4(folder: Path) -> Path:
    path = write_video(folder / "v.mp4", swing(20), "mp4v")
    path.write_bytes(path.read_bytes()[:20_000])
    return path


def sound(folder: Path) -> Path:
    path = folder / "sound.wav"
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(bytes(8000))
    return path


def sound_in_mp4(folder: Path) -> Path:
    path = folder / "sound.mp4"
    index = struct.pack(">I4s", 20, b"hdlr") + b"\0\0\0\0\0\0\0\0soun"
    boxes = [(b"ftyp", b"isom\0\0\0\0"), (b"mdat", bytes(100)), (b"moov", index)]
    path.write_bytes(b"".join(struct.pack(">I", 8 + len(c)) + k + c for k, c in boxes))
    return path


def unknown_codec(folder: Path) -> Path:
    path = write_video(folder / "v.avi", swing(5), "MJPG")
    path.write_bytes(path.read_bytes().replace(b"MJPG", b"QQZZ"))
    return path


def written(name: str, data: bytes) -> object:
    def write(folder: Path) -> Path:
        path = folder / name
        path.write_bytes(data)
        return path

    return write


@pytest.mark.parametrize(
    ("make", "cause"),
    [
        (cut_mp4, "without its index"),
        (sound, "sound alone"),
        (sound_in_mp4, "sound without pictures"),
        (unknown_codec, "codec 'QQZZ'"),
        (written("v.avi", b""), "empty file"),
        (written("v.mp4", b"not a video\n" * 100), "a text file"),
        (written("v.avi", bytes(range(256)) * 20), "not a video file"),
        (lambda folder: folder / "nowhere.avi", "no such file"),
    ],
)
def test_a_file_that_is_no_video_is_refused_with_its_cause(
    make: object, cause: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = make(tmp_path)  # type: ignore[operator]
    with pytest.raises(VisionError, match=cause) as refused:
        open_source(path)
    assert str(path) in str(refused.value)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    "options", [SourceOptions(rate_hz=0.0), SourceOptions(from_s=2.0, to_s=1.0)]
)
def test_impossible_options_are_refused(options: SourceOptions, tmp_path: Path) -> None:
    with pytest.raises(VisionError, match="must be"):
        open_source(tmp_path, options)


def test_reading_pixels_loads_nothing_of_the_wire() -> None:
    code = "import sys, vision.sources; sys.exit(any(m.startswith('comms') for m in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
