"""Log records beside the channels: receipts, timing, link rows, frame stamps, events, pictures."""

from __future__ import annotations

import msgspec

from comms.link import LinkCount


class Receipts(msgspec.Struct, frozen=True, kw_only=True):
    """Receipts of a channel: [seq, t_rx_ns, outcome] of each packet read; "" = delivered."""

    channel: str
    rows: list[tuple[int, int, str]]


class TaskTiming(msgspec.Struct, frozen=True, kw_only=True):
    """Wake-up lateness of a task [ns], one value a wake, and the ticks it skipped so far."""

    task: str
    t_ns: int
    late_ticks: int
    lateness_ns: list[int]


class LinkRow(msgspec.Struct, frozen=True, kw_only=True):
    """Packet counts of one end of a channel; in the log, the merged counts of both ends."""

    channel: str
    count: LinkCount
    balanced: bool = True


class FrameStamp(msgspec.Struct, frozen=True, kw_only=True):
    """Frame without its pixels; crc32 is that of the pixels (in virtual time only, else 0)."""

    seq: int
    t_ns: int
    t_exposure_start_ns: int
    exposure_ns: int
    row_ns: int
    camera: str
    encoding: str
    height: int
    width: int
    crc32: int = 0


class Event(msgspec.Struct, frozen=True, kw_only=True):
    """Event of the run with its level and its source."""

    t_ns: int
    level: str  # "info" | "warning" | "error"
    source: str
    text: str


class Stamp(msgspec.Struct, frozen=True, kw_only=True):
    """Time of the foxglove schemas: seconds and nanoseconds."""

    sec: int
    nsec: int


class CompressedImage(msgspec.Struct, frozen=True, kw_only=True):
    """Image of the schema foxglove.CompressedImage; data is base64 in JSON."""

    timestamp: Stamp
    frame_id: str
    data: bytes
    format: str


Record = Receipts | TaskTiming | LinkRow | Event


def picture_topic(channel: str) -> str:
    """Name the topic of the pictures of a channel of frames; the first camera has no number."""
    camera = channel.removeprefix("frame_")
    return "/camera/image" if camera == "1" else f"/camera_{camera}/image"
