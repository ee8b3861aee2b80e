"""Frames with their true time, whatever they come from, and what is wrong with them.

A source is a video file, a folder of pictures, a camera or a log of a run; `sources.open_source`
opens one.
"""

from __future__ import annotations

import enum
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

Image = np.ndarray[Any, np.dtype[np.uint8]]


class StampKind(enum.Enum):
    """Origin of a time stamp."""

    CONTAINER = "container"  # presentation time in the video file
    INDEX = "index"  # number of the frame / frame rate that the file states
    RATE = "rate"  # number of the frame / frame rate that the user gave
    FILE = "file"  # file of stamps beside the pictures
    DEVICE = "device"  # driver of the camera
    ARRIVAL = "arrival"  # clock of this computer when the picture came
    LOG = "log"  # stamp of the picture in the log of a run


class PictureFault(enum.Enum):
    """Fault that makes a picture useless as a measurement at its time stamp."""

    DAMAGED = "damaged"  # rows that do not belong to this picture
    DUPLICATE = "duplicate"  # shows the picture before
    FROZEN = "frozen"  # one of three or more in a row that show one picture


class FindingKind(enum.Enum):
    """Irregularity of a stream."""

    NO_STAMPS = "no_stamps"
    STEP_BACK = "step_back"
    REPEATED_STAMP = "repeated_stamp"
    GAP = "gap"
    UNEVEN_RATE = "uneven_rate"
    DUPLICATE = "duplicate"
    FROZEN = "frozen"
    PULLDOWN = "pulldown"
    CUT = "cut"
    LOOP = "loop"
    DAMAGED = "damaged"
    SIZE_CHANGE = "size_change"
    ENDS_EARLY = "ends_early"
    DEPTH = "depth"


class StreamFinding(NamedTuple):
    """Irregularity with the frames it concerns."""

    kind: FindingKind
    first: int  # number of its first frame
    last: int  # number of its last frame; equal to first for one frame
    value: float  # in the unit that text names
    text: str  # what, value and next step


class SourceFrame(NamedTuple):
    """Frame of a source."""

    number: int  # from 0, in the file
    t_s: float  # from the first frame of the file; steps back where the stamps of the file do
    stamp: StampKind
    image: Image  # (height, width), or (height, width, 3) blue, green, red
    faults: frozenset[PictureFault] = frozenset()
    pivot_px: tuple[float, float] | None = None  # upper end of the cable, where the source knows it


class SourceOptions(NamedTuple):
    """Choices for a source; None = the default."""

    rate_hz: float | None = None  # true frame rate; replaces the stamps. Of a camera: asked of it
    from_s: float | None = None  # first time stamp wanted, on the time of the source
    to_s: float | None = None  # last time stamp wanted; reading ends at the first later one
    stamps: Path | None = None  # file of stamps of a folder of pictures
    camera: int = 1  # of a log with several


class About(NamedTuple):
    """Description of a source, as it states itself; None where it states nothing."""

    name: str
    kind: str  # "video", "pictures", "camera", "pipeline" or "log"
    width: int
    height: int
    rate_hz: float | None
    frames: int | None  # often an estimate from duration and rate
    codec: str  # FourCC or name, "" if unknown
    is_live: bool  # can be read once only


class FrameStream(Protocol):
    """Source of frames."""

    @property
    def about(self) -> About:
        """Description of the source."""

    @property
    def findings(self) -> Sequence[StreamFinding]:
        """Irregularities of the frames passed since the last frames(), in order; grows with them.

        Complete when frames() has ended.
        """

    def frames(self) -> Iterator[SourceFrame]:
        """Read from the first frame; a live source goes on from where it stands.

        Raises VisionError before the first frame if nothing can be read.
        """

    def spread(self, count: int) -> list[SourceFrame]:
        """Read about count frames spread over the whole; the first ones of a live source.

        A live source gives these frames again as the first of frames(). Their faults are not
        searched for.
        """
