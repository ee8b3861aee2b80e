"""Folders and printf patterns of pictures, with a file of time stamps or a rate."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from vision.decoder_messages import DecoderMessages
from vision.errors import VisionError
from vision.stream import (
    About,
    FindingKind,
    Image,
    PictureFault,
    SourceFrame,
    SourceOptions,
    StampKind,
    StreamFinding,
)
from vision.stream_check import checked, spread_evenly, within

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
PATTERN = re.compile(r"%0?(\d*)d")
STAMPS_FILE = "stamps.csv"
BITS = (8, 10, 12, 14, 16)  # of a grey level; the first that holds the first picture is taken
NO_FAULTS: frozenset[PictureFault] = frozenset()


class Pictures:
    """Pictures in files, in the order of the numbers in their names."""

    def __init__(self, where: Path, options: SourceOptions) -> None:
        """where: folder, pattern like img_%04d.png, or one picture; raises VisionError."""
        self._files = _files(where)
        self._options = options
        self.findings: list[StreamFinding] = []
        with DecoderMessages() as messages:
            first = _read(self._files[0], messages)
        if first is None:
            raise VisionError(
                f"{self._files[0]}: {self._files[0].stat().st_size} bytes, no picture that can be "
                "read: copy it again, or take it out of the folder"
            )
        self._bits = _bits(first)
        self._size = (first.shape[1], first.shape[0])
        self.about = About(
            name=str(where),
            kind="pictures",
            width=first.shape[1],
            height=first.shape[0],
            rate_hz=options.rate_hz,
            frames=len(self._files),
            codec=self._files[0].suffix[1:],
            is_live=False,
        )
        self._stamp, self._stamps_s = self._choose_stamps(where)

    def frames(self) -> Iterator[SourceFrame]:
        """Read all pictures from from_s to to_s."""
        self.findings.clear()
        if self._bits > 8:
            text = (
                f"{self._bits} bits of grey levels (by the brightest pixel of the first picture) "
                "are reduced to 8; brighter pixels of later pictures are cut off"
            )
            self.findings.append(StreamFinding(FindingKind.DEPTH, 0, 0, float(self._bits), text))
        yield from checked(within(self._read_all(self.findings), self._options), self.findings)

    def spread(self, count: int) -> list[SourceFrame]:
        """Read count pictures, or all if there are fewer, spread over from_s to to_s."""
        return spread_evenly(within(self._read_all([]), self._options), count)

    def _read_all(self, findings: list[StreamFinding]) -> Iterator[SourceFrame]:
        size = self._size
        with DecoderMessages() as messages:
            for number, path in enumerate(self._files):
                levels = _read(path, messages)
                if levels is None:
                    text = f"{path.name} cannot be read: it is left out; copy it again"
                    findings.append(StreamFinding(FindingKind.DAMAGED, number, number, 1.0, text))
                    continue
                image = _eight_bits(levels, self._bits)
                now = (image.shape[1], image.shape[0])
                if now != size:
                    findings.append(_size_change(number, size, now))
                    size = now
                if now != self._size:
                    image = np.asarray(cv2.resize(image, self._size), np.uint8)
                faults = frozenset({PictureFault.DAMAGED}) if messages.last else NO_FAULTS
                yield SourceFrame(number, self._stamps_s[number], self._stamp, image, faults)

    def _choose_stamps(self, where: Path) -> tuple[StampKind, list[float]]:
        if self._options.rate_hz is not None:
            positions = _positions(self._files)
            return StampKind.RATE, [place / self._options.rate_hz for place in positions]
        beside = self._files[0].parent / STAMPS_FILE
        if self._options.stamps is not None or beside.is_file():
            stamps_s = read_stamps(self._options.stamps or beside, self._files)
            return StampKind.FILE, [t_s - stamps_s[0] for t_s in stamps_s]
        if len(self._files) == 1:
            return StampKind.INDEX, [0.0]
        raise VisionError(
            f"{where}: {len(self._files)} pictures without time stamps; need their times: give the "
            f"rate with --rate, or put a {STAMPS_FILE} with the columns file,t_s beside them"
        )


def read_stamps(path: Path, files: list[Path]) -> list[float]:
    """Read the time stamp [s] of each file from a CSV file with t_s and file or frame (from 0).

    Raises VisionError for a missing column, a value that is no number and a picture without stamp.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            columns = reader.fieldnames or []
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise VisionError(f"{path}: {error}; need a CSV file with file,t_s: check it") from error
    key = "file" if "file" in columns else "frame"
    if key not in columns or "t_s" not in columns:
        raise VisionError(
            f"{path}: columns {', '.join(columns) or 'none'}; need t_s, and file or frame: "
            "name the columns in the first line"
        )
    stamps_s: dict[str, float] = {}
    for line, row in enumerate(rows, start=2):
        stamps_s[(row[key] or "").strip()] = _seconds(path, line, row["t_s"])
    names = [file.name if key == "file" else str(index) for index, file in enumerate(files)]
    missing = [name for name in names if name not in stamps_s]
    if missing:
        raise VisionError(
            f"{path}: no row for {key} {missing[0]} and {len(missing) - 1} more of {len(files)} "
            "pictures; need one for each: add the rows or take the pictures out"
        )
    return [stamps_s[name] for name in names]


def _seconds(path: Path, line: int, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise VisionError(f"{path} line {line}: t_s = '{text}'; must be a number of seconds")
    return value


def _files(where: Path) -> list[Path]:
    if where.is_dir():
        found = [path for path in where.iterdir() if path.suffix.lower() in ENDINGS]
        if not found:
            others = sum(1 for _ in where.iterdir())
            raise VisionError(
                f"{where}: a folder with {others} files, none of them a picture; need "
                f"{', '.join(ENDINGS)}: check the path"
            )
        return sorted(found, key=_natural)
    if where.is_file():
        return [where]
    return _matches(where)


def _matches(pattern: Path) -> list[Path]:
    """List the files that a printf pattern names, by their numbers."""
    place = PATTERN.search(pattern.name)
    if place is None or not pattern.parent.is_dir():
        raise VisionError(f"{pattern}: no such file; check the path")
    before, after = pattern.name[: place.start()], pattern.name[place.end() :]
    digits = f"{{{place.group(1) or 1},}}"
    expression = re.compile(f"{re.escape(before)}(\\d{digits}){re.escape(after)}")
    found = [path for path in pattern.parent.iterdir() if expression.fullmatch(path.name)]
    if not found:
        raise VisionError(
            f"{pattern}: none of the {sum(1 for _ in pattern.parent.iterdir())} files in "
            f"'{pattern.parent}' matches; need names like {before}{1:0{place.group(1) or 1}}{after}"
            ": check the pattern"
        )
    return sorted(found, key=_natural)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Order names by the numbers in them: img_9 before img_10."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]


def _positions(files: list[Path]) -> list[int]:
    """Number the files by their names where most of these count up by one, else one by one.

    A picture that is missing then leaves a gap.
    """
    numbers = [re.findall(r"\d+", path.stem)[-1:] for path in files]
    if not all(numbers) or len(files) < 2:
        return list(range(len(files)))
    values = np.array([int(number[0]) for number in numbers])
    steps = np.diff(values)
    if np.any(steps <= 0) or np.median(steps) != 1:
        return list(range(len(files)))
    return [int(value) for value in values - values[0]]


def _read(path: Path, messages: DecoderMessages) -> np.ndarray | None:
    flags = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR
    levels = messages.call(cv2.imread, str(path), flags)
    if levels is None or levels.dtype not in (np.uint8, np.uint16):
        return None
    return levels


def _bits(levels: np.ndarray) -> int:
    if levels.dtype == np.uint8:
        return 8
    highest = int(levels.max())
    return next(bits for bits in BITS if highest < 2**bits)


def _eight_bits(levels: np.ndarray, bits: int) -> Image:
    if levels.dtype == np.uint8:
        return levels
    return np.asarray(cv2.convertScaleAbs(levels, alpha=255.0 / (2**bits - 1)), np.uint8)


def _size_change(number: int, before: tuple[int, int], now: tuple[int, int]) -> StreamFinding:
    text = (
        f"the pictures change from {before[0]}x{before[1]} to {now[0]}x{now[1]} pixels and are "
        "scaled to the first size: pivot and scale may change; analyse the parts by themselves"
    )
    return StreamFinding(FindingKind.SIZE_CHANGE, number, number, now[0] / before[0], text)
