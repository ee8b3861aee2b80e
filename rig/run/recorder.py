"""The recorder: every message once, receipts, events and some pictures, into one MCAP file."""

from __future__ import annotations

from pathlib import Path

import cv2
import msgspec

from comms.link import LinkCount
from comms.mcap_log import LogWriter
from comms.messages import Frame, Message
from comms.records import (
    CompressedImage,
    Event,
    FrameStamp,
    LinkRow,
    Receipts,
    Record,
    Stamp,
    TaskTiming,
    picture_topic,
)

FLUSH_PERIOD_NS = 500_000_000
JPEG_QUALITY = 92


class Recorder:
    """Writer of run.mcap; what was recorded before a crash stays readable."""

    def __init__(
        self, path: Path, start: dict[str, str], attachments: dict[str, bytes], epoch_ns: int
    ) -> None:
        """epoch_ns: wall-clock time of run time 0 [ns since 1970]."""
        self._log = LogWriter(path, start, epoch_ns)
        for name, data in attachments.items():
            kind = "application/toml" if name.endswith(".toml") else "application/json"
            self._log.attach(name, kind, data)
        self._log.flush()
        self._flushed_ns = 0
        self.counts: dict[str, int] = {}

    def message(self, channel: str, message: Message, log_ns: int, crc32: int = 0) -> None:
        """Record a message of a channel as its sender sent it; a Frame without its pixels."""
        record: msgspec.Struct = message
        if isinstance(message, Frame):
            record = _frame_stamp(message, crc32)
        self.counts[channel] = self.counts.get(channel, 0) + 1
        self._log.write(f"/{channel}", record, message.t_ns, log_ns, message.seq)

    def picture(self, channel: str, frame: Frame, log_ns: int) -> None:
        """Record a picture of a channel as JPEG, for viewers of the log.

        Analysis does not use it.
        """
        good, data = cv2.imencode(".jpg", frame.pixels, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if good:
            seconds, nanoseconds = divmod(frame.t_exposure_start_ns + frame.exposure_ns // 2, 10**9)
            stamp = Stamp(sec=seconds, nsec=nanoseconds)
            image = CompressedImage(
                timestamp=stamp, frame_id=frame.camera, data=data.tobytes(), format="jpeg"
            )
            self._log.write(picture_topic(channel), image, frame.t_ns, log_ns, frame.seq)

    def record(self, record: Record, log_ns: int) -> None:
        """Record a receipt, timing, link row or event."""
        self._log.write(_topic(record), record, getattr(record, "t_ns", log_ns), log_ns)

    def tick(self, t_ns: int) -> None:
        """Flush at most every 0.5 s: a kill loses no more than that."""
        if t_ns - self._flushed_ns >= FLUSH_PERIOD_NS:
            self._flushed_ns = t_ns
            self._log.flush()

    def close(self, rows: dict[str, LinkCount], stop: dict[str, str], log_ns: int) -> None:
        """Write the settled ledger and the stop metadata, and close the file."""
        for channel, count in rows.items():
            balanced = count.unaccounted == 0
            self.record(LinkRow(channel=channel, count=count, balanced=balanced), log_ns)
        self._log.close(stop)


def _frame_stamp(frame: Frame, crc32: int) -> FrameStamp:
    return FrameStamp(
        seq=frame.seq,
        t_ns=frame.t_ns,
        t_exposure_start_ns=frame.t_exposure_start_ns,
        exposure_ns=frame.exposure_ns,
        row_ns=frame.row_ns,
        camera=frame.camera,
        encoding=frame.encoding,
        height=frame.height,
        width=frame.width,
        crc32=crc32,
    )


def _topic(record: Record) -> str:
    match record:
        case Receipts():
            return f"/receipts/{record.channel}"
        case LinkRow():
            return f"/link/{record.channel}"
        case TaskTiming():
            return f"/timing/{record.task}"
        case Event():
            return "/events"
