"""Lines of `rig can monitor`: a frame with its signals, and the summary of a bus."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import Any

import can
import msgspec

from rig.run.field_bus.decoding import DecodedFrame, Decoder
from rig.run.field_bus.statistics import BusStatistics, FrameCounter, IdStatistics
from rig.ui.cli.page import (
    Column,
    err,
    out,
    plain_table,
    print_paragraph,
    print_table,
    print_whole,
)

HEADING = f"{'time [s]':>11} {'id':>8} n {'data':<23} name: signals"
INDENT = " " * 12
DATA_INDENT = " " * 23
BYTES_A_LINE = 8
COLUMNS = (
    "id",
    Column("name"),
    "frames",
    "rate\n[1/s]",
    Column("period\n[ms]", drop=1),
    "jitter\n[ms]",
    "longest\nperiod [ms]",
)


class FramePage:
    """Frames on the terminal, or as JSON lines; what it shows is counted."""

    def __init__(
        self, decoder: Decoder, zero_s: float | None, bitrate: int, *, as_json: bool
    ) -> None:
        """zero_s: stamp that is shown as 0; None: that of the first frame."""
        self._decoder = decoder
        self._zero_s = zero_s
        self._as_json = as_json
        self._counter = FrameCounter(bitrate)
        self._names: dict[tuple[int, bool], str] = {}

    @property
    def frames(self) -> int:
        """Number of frames so far."""
        return self._counter.frames

    def show(self, frame: can.Message) -> None:
        """Print a frame."""
        if self._zero_s is None:
            self._zero_s = frame.timestamp
        t_s = frame.timestamp - self._zero_s
        decoded = self._decoder.decode(frame)
        if not self.frames and not self._as_json:
            print_whole(HEADING, "dim")
        self._counter.add(frame)
        self._names[frame.arbitration_id, frame.is_extended_id] = decoded.name
        if self._as_json:
            _print_json_line(_document(t_s, frame, decoded))
            return
        for line in _lines(t_s, frame, decoded, out.width):
            print_whole(line)

    def summarise(self, name: str) -> None:
        """Print the summary of what was shown."""
        summary = self._counter.result()
        if self._as_json:
            _print_json_line({"summary": {"source": name} | msgspec.to_builtins(summary)})
            return
        if not summary.frames:
            print_paragraph(f"no frame on {name}: look for power, termination and bit rate")
            return
        table = plain_table("", COLUMNS, left=2)
        for row in summary.by_id:
            table.add_row(*self._cells(row))
        print_table(table)
        for line in _summary_lines(name, summary):
            print_paragraph(line)

    def note(self, text: str) -> None:
        """Print a remark beside the frames."""
        if self._as_json:
            err.print(text)
        else:
            print_paragraph(text)

    def _cells(self, row: IdStatistics) -> Iterable[str]:
        digits = 8 if row.is_extended else 3
        return (
            f"{row.can_id:0{digits}X}",
            self._names[row.can_id, row.is_extended] or "-",
            str(row.frames),
            _number(row.rate_hz, 1),
            _number(row.period_ms, 3),
            _number(row.jitter_ms, 3),
            _number(row.longest_ms, 3),
        )


def _lines(t_s: float, frame: can.Message, decoded: DecodedFrame, width: int) -> list[str]:
    """Fold a frame into lines: signals that do not fit follow below."""
    pieces = _data(frame)
    ident = _ident(frame)
    head = f"{t_s:11.6f} {ident:>8} {frame.dlc} {pieces[0]:<23} {decoded.name}".rstrip()
    further = [DATA_INDENT + piece for piece in pieces[1:]]
    if not decoded.text:
        return [head, *further]
    whole = f"{head}: {decoded.text}"
    if len(whole) <= width and not further:
        return [whole]
    signals = textwrap.wrap(
        decoded.text,
        width,
        initial_indent=INDENT,
        subsequent_indent=INDENT,
        break_on_hyphens=False,
    )
    return [head, *further, *signals]


def _data(frame: can.Message) -> list[str]:
    if frame.is_remote_frame:
        return ["remote frame"]
    data = bytes(frame.data)
    starts = range(0, len(data), BYTES_A_LINE)
    return [data[at : at + BYTES_A_LINE].hex(" ").upper() for at in starts] or [""]


def _ident(frame: can.Message) -> str:
    if frame.is_error_frame:
        return "error"
    digits = 8 if frame.is_extended_id else 3
    return f"{frame.arbitration_id:0{digits}X}"


def _document(t_s: float, frame: can.Message, decoded: DecodedFrame) -> dict[str, Any]:
    document: dict[str, Any] = {
        "t_s": round(t_s, 9),
        "id": frame.arbitration_id,
        "is_extended": frame.is_extended_id,
        "is_remote": frame.is_remote_frame,
        "is_error": frame.is_error_frame,
        "length": frame.dlc,
        "data": bytes(frame.data).hex(),
        "name": decoded.name,
        "signals": {name: value for name, value, _ in decoded.signals},
    }
    if decoded.problem:
        document["problem"] = decoded.problem
    return document


def _summary_lines(name: str, summary: BusStatistics) -> list[str]:
    others = [
        f"{summary.error_frames} error frames",
        f"{summary.remote_frames} remote frames",
    ]
    if summary.fd_frames:
        others.append(f"{summary.fd_frames} frames of CAN FD, counted as classic ones")
    lines = [
        f"{name}: {summary.frames} frames in {summary.duration_s:.3f} s, of these "
        f"{', '.join(others)}"
    ]
    if summary.load_nominal is None or summary.load_worst is None:
        return lines
    lines.append(
        f"bus load at {summary.bitrate} bit/s: {100 * summary.load_nominal:.2f} % without stuff "
        f"bits, {100 * summary.load_worst:.2f} % with the most that can occur"
    )
    lines.append("jitter: standard deviation of the period")
    return lines


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _print_json_line(document: Any) -> None:
    """Print one document in one line, at once."""
    print_whole(msgspec.json.encode(document).decode())
