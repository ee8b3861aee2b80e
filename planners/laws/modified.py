"""Modified trapezoidal and modified sine law: acceleration from constants and sinusoids."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from planners import bounds
from planners.trajectories.pieces import ExpPolynomial, ModalTerm
from planners.trajectories.trajectory import Trajectory

RISING_PHASE_RAD = -math.pi / 2  # of a cosine that begins at 0 and rises


class LawSegment(NamedTuple):
    """Segment of a law with acceleration constant + size cos(rate x + phase).

    x is the time since the start of the segment, normalised by the duration.
    """

    share: float  # of the duration
    constant: float = 0.0
    size: float = 0.0
    rate: float = 0.0
    phase: float = 0.0

    def piece(self, duration_s: float) -> ExpPolynomial:
        """Compute the acceleration as a piece [1/s^2]."""
        scale = duration_s**-2
        wave = complex(math.cos(self.phase), math.sin(self.phase)) * self.size * scale
        modes = (ModalTerm(1j * self.rate / duration_s, (wave,)),) if self.size else ()
        return ExpPolynomial(self.share * duration_s, (self.constant * scale,), modes)


def modified_trapezoidal(duration_s: float) -> Trajectory:
    """Compute the modified trapezoidal law from 0 to 1 in duration_s (source 000).

    Acceleration: quarter sine up, constant, half cosine down, constant, quarter sine back.
    Its peak is 8 pi / (2 + pi) over [1/8, 3/8].
    """
    ca, rate = 8.0 * math.pi / (2.0 + math.pi), 4.0 * math.pi
    first = LawSegment(1 / 8, size=ca, rate=rate, phase=RISING_PHASE_RAD)
    middle = LawSegment(1 / 4, size=ca, rate=rate)
    last = LawSegment(1 / 8, size=ca, rate=rate, phase=math.pi)
    segments = (first, LawSegment(1 / 4, ca), middle, LawSegment(1 / 4, -ca), last)
    return _integrated(segments, duration_s)


def modified_sine(duration_s: float) -> Trajectory:
    """Compute the modified sine law from 0 to 1 in duration_s (source 000).

    Acceleration: a fast sine at both ends, a slow one between them. Its peak is
    4 pi^2 / (4 + pi) at 1/8.
    """
    ca, fast = 4.0 * math.pi**2 / (4.0 + math.pi), 4.0 * math.pi
    first = LawSegment(1 / 8, size=ca, rate=fast, phase=RISING_PHASE_RAD)
    middle = LawSegment(3 / 4, size=ca, rate=fast / 3.0)
    last = LawSegment(1 / 8, size=ca, rate=fast, phase=math.pi)
    return _integrated((first, middle, last), duration_s)


def _integrated(segments: Sequence[LawSegment], duration_s: float) -> Trajectory:
    """Integrate the accelerations of the segments twice, from rest at 0."""
    bounds.duration(duration_s)
    position, speed, pieces = 0.0, 0.0, []
    for segment in segments:
        velocity = segment.piece(duration_s).integral(speed)
        pieces.append(velocity.integral(position))
        end = pieces[-1].window(pieces[-1].duration_s, pieces[-1].duration_s)
        position = _start_value(end)
        speed = _start_value(end.derivative())
    return Trajectory(tuple(pieces))


def _start_value(piece: ExpPolynomial) -> float:
    """Compute the value at the start of the piece."""
    return piece.coefficients[0] + sum(mode.coefficients[0].real for mode in piece.modes)
