"""Small recordings with known stamps and faults; pictures share no code with sim_rig."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from rig.studies.vision.matroska import MatroskaWriter
from vision.stream import FindingKind, FrameStream, StreamFinding

Picture = np.ndarray[Any, np.dtype[np.uint8]]
WIDTH, HEIGHT = 320, 240
LENGTH_PX = 230.0
PERIOD_FRAMES = 40.0


def swing(
    count: int,
    noise: float = 2.5,
    first: float = 0.0,
    seed: int = 1,
    period: float = PERIOD_FRAMES,
) -> list[Picture]:
    """Draw a dark line that swings on a bright screen, drawn anew with fresh noise."""
    random = np.random.default_rng(seed)
    pictures = []
    for index in range(count):
        angle = 0.5 * math.sin(math.tau * (index + first) / period)
        picture = np.full((HEIGHT, WIDTH, 3), 190.0)
        end = (160 + LENGTH_PX * math.sin(angle), LENGTH_PX * math.cos(angle))
        corners = np.round(np.array([(160.0, 0.0), end]) * 64).astype(int)
        cv2.line(picture, corners[0], corners[1], (30, 30, 30), 3, cv2.LINE_AA, 6)
        picture += random.normal(0.0, noise, picture.shape)
        pictures.append(np.clip(np.round(picture), 0, 255).astype(np.uint8))
    return pictures


def write_stamped(path: Path, pictures: Iterable[Picture], stamps_ms: Sequence[float]) -> Path:
    """Write JPEG pictures with these stamps."""
    with MatroskaWriter(path, WIDTH, HEIGHT) as writer:
        for t_ms, picture in zip(stamps_ms, pictures, strict=True):
            writer.add(t_ms, jpeg(picture))
    return path


def write_video(path: Path, pictures: Iterable[Picture], codec: str, rate_hz: float = 50.0) -> Path:
    """Write a video of constant rate."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), rate_hz, (WIDTH, HEIGHT))
    assert writer.isOpened()
    for picture in pictures:
        writer.write(picture)
    writer.release()
    return path


def jpeg(picture: Picture, quality: int = 95) -> bytes:
    """Encode a picture."""
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def with_flipped_bytes(path: Path, places: Iterable[int]) -> Path:
    """Change the bytes at places of a copy of the file."""
    data = bytearray(path.read_bytes())
    for place in places:
        data[place] ^= 0x5A
    damaged = path.with_name(f"damaged_{path.name}")
    damaged.write_bytes(bytes(data))
    return damaged


def found(source: FrameStream, kind: FindingKind) -> list[StreamFinding]:
    """Select the findings of a kind."""
    return [finding for finding in source.findings if finding.kind is kind]


def kinds(source: FrameStream) -> set[str]:
    """Collect the kinds of all findings."""
    return {finding.kind.value for finding in source.findings}


class FakeCamera:
    """Camera like cv2.VideoCapture with the stamps of a driver."""

    def __init__(self, pictures: Sequence[Picture], stamps_ms: Iterable[float]) -> None:
        self._pictures: Iterator[Picture] = iter(pictures)
        self._stamps_ms = itertools.chain(stamps_ms, itertools.repeat(0.0))
        self._values = {
            cv2.CAP_PROP_FPS: 50.0,
            cv2.CAP_PROP_FRAME_WIDTH: float(WIDTH),
            cv2.CAP_PROP_FRAME_HEIGHT: float(HEIGHT),
            cv2.CAP_PROP_FOURCC: float(cv2.VideoWriter.fourcc(*"YUYV")),
        }
        self._picture: Picture | None = None
        self.is_released = False

    def grab(self) -> bool:
        """Take the next picture."""
        self._picture = next(self._pictures, None)
        self._values[cv2.CAP_PROP_POS_MSEC] = next(self._stamps_ms)
        return self._picture is not None

    def retrieve(self) -> tuple[bool, Picture | None]:
        """Return the picture taken last."""
        return self._picture is not None, self._picture

    def get(self, what: int) -> float:
        """Read a property."""
        return self._values[what]

    def release(self) -> None:
        """Note the end."""
        self.is_released = True
