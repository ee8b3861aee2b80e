"""Folders and patterns of pictures: order, stamps, depth, and what is refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.vision.recordings import found, jpeg, swing
from vision.errors import VisionError
from vision.sources import open_source
from vision.stream import FindingKind, PictureFault, SourceOptions, StampKind

AT_50_HZ = SourceOptions(rate_hz=50.0)


def fill(folder: Path, count: int, name: str = "img_{}.png") -> Path:
    for index, picture in enumerate(swing(count)):
        assert cv2.imwrite(str(folder / name.format(index)), picture)
    return folder


def test_pictures_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    frames = list(open_source(fill(tmp_path, 12), AT_50_HZ).frames())
    for index, (frame, picture) in enumerate(zip(frames, swing(12), strict=True)):
        assert frame.number == index
        assert np.array_equal(frame.image, picture)
        assert frame.t_s == pytest.approx(index / 50.0)
        assert frame.stamp is StampKind.RATE


@pytest.mark.parametrize("ending", ["png", "jpg", "bmp", "tif"])
def test_a_pattern_selects_its_files(ending: str, tmp_path: Path) -> None:
    fill(tmp_path, 10, "img_{:04d}." + ending)
    (tmp_path / f"other_0003.{ending}").write_bytes(b"no picture")
    source = open_source(tmp_path / f"img_%04d.{ending}", AT_50_HZ)
    assert len(list(source.frames())) == 10
    assert source.about.frames == 10
    assert [frame.number for frame in source.spread(5)] == [0, 2, 4, 6, 8]


def test_a_missing_number_is_a_gap_in_time(tmp_path: Path) -> None:
    fill(tmp_path, 12)
    (tmp_path / "img_6.png").unlink()
    source = open_source(tmp_path, AT_50_HZ)
    assert [frame.t_s for frame in source.frames()][6] == pytest.approx(7 / 50.0)
    assert [finding.first for finding in found(source, FindingKind.GAP)] == [6]


@pytest.mark.parametrize("key", ["file", "frame"])
def test_stamps_beside_the_pictures_are_used(key: str, tmp_path: Path) -> None:
    fill(tmp_path, 6)
    stamps_s = [3.0, 3.1, 3.25, 3.3, 3.4, 3.5]
    lines = [f"{key},t_s"]
    for index, t_s in enumerate(stamps_s):
        lines.append(f"{f'img_{index}.png' if key == 'file' else index},{t_s}")
    (tmp_path / "stamps.csv").write_text("\n".join(lines))
    frames = list(open_source(tmp_path).frames())
    assert [frame.t_s for frame in frames] == pytest.approx(np.array(stamps_s) - 3.0)
    assert {frame.stamp for frame in frames} == {StampKind.FILE}


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("file,t_s\nimg_0.png,0\n", "no row for file img_1.png"),
        ("name,t_s\n", "columns name, t_s"),
        ("file,t_s\nimg_0.png,soon\n", "line 2: t_s = 'soon'"),
    ],
)
def test_a_stamps_file_that_does_not_fit_is_refused(text: str, cause: str, tmp_path: Path) -> None:
    fill(tmp_path, 3)
    stamps = tmp_path / "mine.csv"
    stamps.write_text(text)
    with pytest.raises(VisionError, match=cause):
        open_source(tmp_path, SourceOptions(stamps=stamps))


def test_deep_pictures_are_reduced_by_one_factor_and_said(tmp_path: Path) -> None:
    for index, picture in enumerate(swing(5)):
        deep = picture[..., 0].astype(np.uint16) * 16  # 12 bits in 16
        cv2.imwrite(str(tmp_path / f"{index}.png"), deep)
    source = open_source(tmp_path, AT_50_HZ)
    images = [frame.image for frame in source.frames()]
    for image, picture in zip(images, swing(5), strict=True):
        assert np.abs(image - picture[..., 0] * (16.0 * 255.0 / 4095.0)).max() <= 0.51
    assert found(source, FindingKind.DEPTH)[0].value == 12.0


def test_a_damaged_and_an_unreadable_picture_are_named(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for index, picture in enumerate(swing(12)):
        data = jpeg(picture)
        (tmp_path / f"{index}.jpg").write_bytes(data[: len(data) // 2] if index == 5 else data)
    (tmp_path / "8.jpg").write_bytes(b"nothing")
    source = open_source(tmp_path, AT_50_HZ)
    frames = list(source.frames())
    assert [f.number for f in frames if PictureFault.DAMAGED in f.faults] == [5]
    assert 8 not in [frame.number for frame in frames]
    assert [finding.first for finding in found(source, FindingKind.DAMAGED)] == [5, 8]
    assert capfd.readouterr().err == ""


def test_pictures_of_another_size_are_scaled_and_reported(tmp_path: Path) -> None:
    fill(tmp_path, 6)
    for index in (4, 5):
        path = str(tmp_path / f"img_{index}.png")
        cv2.imwrite(path, cv2.resize(cv2.imread(path), (160, 120)))
    source = open_source(tmp_path, AT_50_HZ)
    assert {frame.image.shape for frame in source.frames()} == {(240, 320, 3)}
    assert [finding.first for finding in found(source, FindingKind.SIZE_CHANGE)] == [4]


def test_one_picture_needs_no_rate(tmp_path: Path) -> None:
    fill(tmp_path, 1)
    (frame,) = open_source(tmp_path / "img_0.png").frames()
    assert frame.t_s == 0.0


def test_folders_and_patterns_without_pictures_are_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no picture")
    with pytest.raises(VisionError, match="none of them a picture"):
        open_source(tmp_path)
    with pytest.raises(VisionError, match=r"matches; need names like img_0001\.png"):
        open_source(tmp_path / "img_%04d.png")
    fill(tmp_path, 3)
    with pytest.raises(VisionError, match="3 pictures without time stamps"):
        open_source(tmp_path)
