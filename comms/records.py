"""What the log holds beside the channels: receipts, timing, link rows, frame stamps, events, pictures."""

from __future__ import annotations

import msgspec

from comms.link import LinkCount


class Receipts(msgspec.Struct, frozen=True, kw_only=True):
    """The receiver's side of a channel: [seq, t_rx_ns, outcome] of each packet read; outcome "" = delivered."""

    channel: str
    rows: list[tuple[int, int, str]]


class TaskTiming(msgspec.Struct, frozen=True, kw_only=True):
    """How late a task woke, wake by wake [ns], and ticks it skipped for being late, so far."""

    task: str
    t_ns: int
    late_ticks: int
    lateness_ns: list[int]


class LinkRow(msgspec.Struct, frozen=True, kw_only=True):
    """One end's count of a channel; the log holds the settled row of both ends."""

    channel: str
    count: LinkCount
    balanced: bool = True


class FrameStamp(msgspec.Struct, frozen=True, kw_only=True):
    """A Frame without its pixels; crc32 is theirs (virtual time only, else 0)."""

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
    """Something worth reading later."""

    t_ns: int
    level: str  # "info" | "warning" | "error"
    source: str
    text: str


class Stamp(msgspec.Struct, frozen=True, kw_only=True):
    """foxglove time: seconds and nanoseconds."""

    sec: int
    nsec: int


class CompressedImage(msgspec.Struct, frozen=True, kw_only=True):
    """foxglove.CompressedImage; data travels as base64 in JSON."""

    timestamp: Stamp
    frame_id: str
    data: bytes
    format: str


Record = Receipts | TaskTiming | LinkRow | Event
