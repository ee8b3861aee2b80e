"""Length of a frame of classic CAN on the bus.

Davis, Burns, Bril, Lukkien, "Controller Area Network (CAN) schedulability analysis: refuted,
revisited and revised", 2007, equation 1, which includes the 3 bits of intermission.
"""

from __future__ import annotations

from typing import NamedTuple

EXPOSED_BITS, EXPOSED_BITS_EXTENDED = 34, 54  # header and checksum, which are stuffed
OTHER_BITS = 13  # delimiters, acknowledgement, end of frame and intermission, which are not


class FrameBits(NamedTuple):
    """Length of a frame [bits]: without stuff bits, and with the most that can occur."""

    nominal: int
    worst: int


def frame_bits(data_bytes: int, is_extended: bool) -> FrameBits:
    """Compute the length; after five equal bits, each further stuff bit takes four."""
    header = EXPOSED_BITS_EXTENDED if is_extended else EXPOSED_BITS
    exposed = header + 8 * data_bytes
    stuff_bits = (exposed - 1) // 4
    nominal = exposed + OTHER_BITS
    return FrameBits(nominal, nominal + stuff_bits)
