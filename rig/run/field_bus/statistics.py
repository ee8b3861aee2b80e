"""Statistics of the frames of a bus: rate and jitter by identifier, and the load of the bus."""

from __future__ import annotations

import math

import can
import msgspec

from comms.can_bits import FrameBits, frame_bits


class IdStatistics(msgspec.Struct, kw_only=True):
    """Frames of one identifier; None where there are too few of them."""

    can_id: int
    is_extended: bool
    frames: int
    rate_hz: float | None  # mean
    period_ms: float | None  # mean
    jitter_ms: float | None  # standard deviation of the period
    longest_ms: float | None  # longest period


class BusStatistics(msgspec.Struct, kw_only=True):
    """Frames of a bus; the load leaves error frames out."""

    frames: int
    duration_s: float
    error_frames: int
    remote_frames: int
    fd_frames: int
    bitrate: int
    load_nominal: float | None  # share of the bit rate, without stuff bits
    load_worst: float | None  # with the most stuff bits that can occur
    by_id: list[IdStatistics]


class _Periods:
    """Running mean and variance of the periods of an identifier (Welford 1962)."""

    def __init__(self, t_s: float) -> None:
        self.frames = 1
        self.first_s = self.last_s = t_s
        self.mean_s = 0.0
        self.squares_s2 = 0.0
        self.longest_s = 0.0

    def add(self, t_s: float) -> None:
        """Add a frame."""
        period_s = t_s - self.last_s
        self.last_s = t_s
        before_s = self.mean_s
        self.mean_s += (period_s - before_s) / self.frames
        self.squares_s2 += (period_s - before_s) * (period_s - self.mean_s)
        self.longest_s = max(self.longest_s, period_s)
        self.frames += 1

    def result(self, key: tuple[int, bool]) -> IdStatistics:
        """Statistics so far."""
        periods = self.frames - 1
        row = IdStatistics(
            can_id=key[0],
            is_extended=key[1],
            frames=self.frames,
            rate_hz=None,
            period_ms=None,
            jitter_ms=None,
            longest_ms=None,
        )
        if periods:
            row.period_ms = 1e3 * self.mean_s
            row.longest_ms = 1e3 * self.longest_s
            row.rate_hz = 1.0 / self.mean_s if self.mean_s > 0 else None
        if periods > 1:
            row.jitter_ms = 1e3 * math.sqrt(self.squares_s2 / (periods - 1))
        return row


class FrameCounter:
    """Count of the frames of a bus, one after the other."""

    def __init__(self, bitrate: int) -> None:
        self._bitrate = bitrate
        self._periods: dict[tuple[int, bool], _Periods] = {}
        self._first_s = math.inf
        self._last_s = -math.inf
        self._nominal = self._worst = 0
        self.frames = self._errors = self._remote = self._fd = 0

    def add(self, frame: can.Message) -> None:
        """Count a frame."""
        t_s = frame.timestamp
        is_first = not self.frames
        self.frames += 1
        self._first_s = min(self._first_s, t_s)
        self._last_s = max(self._last_s, t_s)
        if frame.is_error_frame:
            self._errors += 1
            return
        self._remote += frame.is_remote_frame
        self._fd += frame.is_fd
        if not is_first:  # its stamp is the begin of the duration, and the end of the frame
            bits = _bits(frame)
            self._nominal += bits.nominal
            self._worst += bits.worst
        key = (frame.arbitration_id, frame.is_extended_id)
        periods = self._periods.get(key)
        if periods is None:
            self._periods[key] = _Periods(t_s)
        else:
            periods.add(t_s)

    def result(self) -> BusStatistics:
        """Statistics so far; a bus of less than two frames has no load."""
        duration_s = max(0.0, self._last_s - self._first_s)
        capacity = self._bitrate * duration_s  # bits
        return BusStatistics(
            frames=self.frames,
            duration_s=duration_s,
            error_frames=self._errors,
            remote_frames=self._remote,
            fd_frames=self._fd,
            bitrate=self._bitrate,
            load_nominal=self._nominal / capacity if capacity else None,
            load_worst=self._worst / capacity if capacity else None,
            by_id=[periods.result(key) for key, periods in sorted(self._periods.items())],
        )


def _bits(frame: can.Message) -> FrameBits:
    data_bytes = 0 if frame.is_remote_frame else len(frame.data)
    return frame_bits(data_bytes, frame.is_extended_id)
