"""Trapezoid and sine with rounded ends of the acceleration: the cam laws of least peak acceleration and torque."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from planners import bounds
from planners.trajectories.pieces import ExpPolynomial, ModalTerm
from planners.trajectories.trajectory import Trajectory


class LawSegment(NamedTuple):
    """Part of a law in normalised time x: acceleration constant + size cos(rate x + phase), x from the stretch's start."""

    share: float  # of the duration
    constant: float = 0.0
    size: float = 0.0
    rate: float = 0.0
    phase: float = 0.0

    def piece(self, duration_s: float) -> ExpPolynomial:
        """The acceleration as a piece [1/s^2]."""
        scale = duration_s**-2
        wave = complex(math.cos(self.phase), math.sin(self.phase)) * self.size * scale
        modes = (ModalTerm(1j * self.rate / duration_s, (wave,)),) if self.size else ()
        return ExpPolynomial(self.share * duration_s, (self.constant * scale,), modes)


RISE = -math.pi / 2  # phase of a cosine that begins at 0 and rises


def modified_trapezoidal(duration_s: float) -> Trajectory:
    """Acceleration up along a sine, flat, across along a cosine, flat, back; from 0 to 1 in duration_s (source 000).

    Peak acceleration 8 pi / (2 + pi) over [1/8, 3/8].
    """
    ca, rate = 8.0 * math.pi / (2.0 + math.pi), 4.0 * math.pi
    ends = LawSegment(1 / 8, size=ca, rate=rate, phase=RISE)
    across = LawSegment(1 / 4, size=ca, rate=rate)
    last = LawSegment(1 / 8, size=ca, rate=rate, phase=math.pi)
    return _integrated(
        (ends, LawSegment(1 / 4, ca), across, LawSegment(1 / 4, -ca), last), duration_s
    )


def modified_sine(duration_s: float) -> Trajectory:
    """Acceleration of a fast sine at both ends and a slow one between them; from 0 to 1 in duration_s (source 000).

    Peak acceleration 4 pi^2 / (4 + pi) at 1/8.
    """
    ca, fast = 4.0 * math.pi**2 / (4.0 + math.pi), 4.0 * math.pi
    first = LawSegment(1 / 8, size=ca, rate=fast, phase=RISE)
    last = LawSegment(1 / 8, size=ca, rate=fast, phase=math.pi)
    return _integrated((first, LawSegment(3 / 4, size=ca, rate=fast / 3.0), last), duration_s)


def _integrated(stretches: Sequence[LawSegment], duration_s: float) -> Trajectory:
    """From rest at 0."""
    bounds.duration(duration_s)
    position, speed, pieces = 0.0, 0.0, []
    for stretch in stretches:
        velocity = stretch.piece(duration_s).integral(speed)
        pieces.append(velocity.integral(position))
        end = pieces[-1].window(pieces[-1].duration_s, pieces[-1].duration_s)
        position = _value(end)
        speed = _value(end.derivative())
    return Trajectory(tuple(pieces))


def _value(piece: ExpPolynomial) -> float:
    """At the piece's start."""
    return piece.coefficients[0] + sum(mode.coefficients[0].real for mode in piece.modes)
