"""Corrupted frames on a field bus: repeated at once, until the transmitter goes bus-off.

Fault confinement of ISO 11898-1: an error raises the transmit error counter by 8, a frame without
one lowers it by 1; beyond 255 the transmitter is bus-off. It stays so until it is reset.
"""

from __future__ import annotations

from collections.abc import Callable

ERROR_STEP = 8
BUS_OFF = 256
ERROR_PASSIVE = 128
# error flag, delimiter and intermission (20 bits at most) and the frame once more (135 bits with
# 8 bytes and the most stuff bits), at 1 Mbit/s
REPEAT_NS = 155_000


class ErrorConfinement:
    """Transmit error counter of a sender, and the delay by frames that are repeated."""

    def __init__(self, share: float, draw: Callable[[int, int], float]) -> None:
        """share: of the frames that are corrupted. draw: uniform number of frame and attempt."""
        self.counter = 0
        self.errors = 0
        self._share = share
        self._draw = draw

    @property
    def is_off(self) -> bool:
        """True once the sender is bus-off."""
        return self.counter >= BUS_OFF

    def delay_ns(self, seq: int) -> int | None:
        """Compute the delay of a frame by its repetitions [ns]; None where it is not sent."""
        attempt = 0
        while not self.is_off and self._draw(seq, attempt) < self._share:
            self.errors += 1
            self.counter += ERROR_STEP
            attempt += 1
        if self.is_off:
            return None
        self.counter = max(0, self.counter - 1)
        return attempt * REPEAT_NS
