"""Parameters of a free decay of one or several modes, and its model in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.damped_envelope import damping_rate, envelope_with_terms, riccati
from rig.analysis.identify.free_swing import mode_swing, turning_point, viscous_envelope
from rig.analysis.identify.sampled import Sampled

FloatArray = npt.NDArray[np.float64]

MODE_SIZE = 4  # damped frequency, decay rate, amplitude, phase
TERMS = ("trend", "trend_squared", "quadratic", "coulomb")
DRIFTS = TERMS[:2]
DAMPING_TERMS = TERMS[2:]
MAX_DECAY_REL = 0.6  # decay rate over damped frequency


class ParameterLayout(NamedTuple):
    """Places of the parameters: those of each mode, the offset, the terms in order."""

    modes: int
    terms: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of parameters."""
        return MODE_SIZE * self.modes + 1 + len(self.terms)

    @property
    def offset(self) -> int:
        """Index of the offset."""
        return MODE_SIZE * self.modes

    def position(self, term: str) -> int:
        """Index of a term."""
        return self.offset + 1 + self.terms.index(term)

    def value(self, p: FloatArray, term: str) -> float:
        """Value of a term, 0 where the model lacks it."""
        return float(p[self.position(term)]) if term in self.terms else 0.0

    def mode(self, p: FloatArray, k: int) -> FloatArray:
        """Parameters (4,) of mode k."""
        return p[MODE_SIZE * k : MODE_SIZE * (k + 1)]

    def with_term(self, term: str) -> ParameterLayout:
        """Make the layout with one term more."""
        return ParameterLayout(self.modes, (*self.terms, term))

    def is_decay(self, p: FloatArray) -> bool:
        """Tell if frequencies and amplitudes are positive and damping lies within its bound."""
        for k in range(self.modes):
            w, decay, amplitude, _ = self.mode(p, k)
            if not (w > 0 and amplitude > 0 and abs(decay) < MAX_DECAY_REL * w):
                return False
        return all(self.value(p, term) >= 0 for term in DAMPING_TERMS)


class DecayModel(Protocol):
    """Model of the samples of one window."""

    @property
    def layout(self) -> ParameterLayout:
        """Places of the parameters."""

    def __call__(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute values (N,) and Jacobian (N, P)."""

    def natural(self, p: FloatArray, k: int) -> tuple[float, float]:
        """Compute undamped frequency [rad/s] and viscous decay rate [1/s] of mode k."""

    def amplitude(self, p: FloatArray, k: int, tau: FloatArray) -> FloatArray:
        """Compute the turning point of mode k at tau (N,)."""

    def damping_ratio(self, p: FloatArray, k: int, amplitude: float) -> float:
        """Compute the damping ratio of mode k at an amplitude."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeSum:
    """Sum of decaying modes in closed form; that of a pendulum holds below about 0.5 rad."""

    tau: FloatArray
    layout: ParameterLayout
    elliptic: bool
    average_frames: int
    frame_period_s: float
    span_s: float  # of the window that a drift of the offset refers to

    def __call__(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute values (N,) and Jacobian (N, P)."""
        values = np.full(self.tau.size, p[self.layout.offset])
        J = np.zeros((self.tau.size, self.layout.size))
        J[:, self.layout.offset] = 1.0
        for k in range(self.layout.modes):
            swing, slopes = self._mode(p, k)
            values += swing
            J[:, MODE_SIZE * k : MODE_SIZE * (k + 1)] = slopes[:, :MODE_SIZE]
            for n, term in enumerate(DAMPING_TERMS):
                if term in self.layout.terms:
                    J[:, self.layout.position(term)] = slopes[:, MODE_SIZE + n]
        for term in DRIFTS:
            if term in self.layout.terms:
                column = drift(self.tau / self.span_s, term)
                values += self.layout.value(p, term) * column
                J[:, self.layout.position(term)] = column
        return values, J

    def _mode(self, p: FloatArray, k: int) -> tuple[FloatArray, FloatArray]:
        mode = self.layout.mode(p, k)
        if any(term in self.layout.terms for term in DAMPING_TERMS):
            numbers = self._numbers(p, k)
            envelope = envelope_with_terms(self.tau, numbers, elliptic=self.elliptic)
        else:
            envelope = viscous_envelope(
                self.tau, float(mode[2]), float(mode[1]), elliptic=self.elliptic
            )
        return mode_swing(mode, self.tau, envelope, self.average_frames, self.frame_period_s)

    def _numbers(self, p: FloatArray, k: int) -> FloatArray:
        _, decay, B0, _ = self.layout.mode(p, k)
        terms = [self.layout.value(p, term) for term in DAMPING_TERMS]
        return np.array([B0, decay, *terms])

    def natural(self, p: FloatArray, k: int) -> tuple[float, float]:
        """Compute undamped frequency [rad/s] and viscous decay rate [1/s] of mode k."""
        wd, decay, _, _ = self.layout.mode(p, k)
        return math.hypot(wd, decay), float(decay)

    def amplitude(self, p: FloatArray, k: int, tau: FloatArray) -> FloatArray:
        """Compute the turning point of mode k at tau (N,)."""
        B = np.maximum(riccati(tau, self._numbers(p, k)), 0.0)
        return turning_point(B) if self.elliptic else B

    def damping_ratio(self, p: FloatArray, k: int, amplitude: float) -> float:
        """Compute the damping ratio of mode k at an amplitude."""
        w0, decay = self.natural(p, k)
        _, _, quadratic, coulomb = self._numbers(p, k)
        at = np.array([max(amplitude, 1e-12)])
        return float(damping_rate(at, decay, quadratic, coulomb)[0]) / w0


def drift(part: FloatArray, term: str) -> FloatArray:
    """Compute the shape (N,) of a drift of the offset at a part, 0 to 1, of the window."""
    u = part - 0.5
    return u if term == "trend" else u * u


def mode_sum(record: Sampled, layout: ParameterLayout, *, elliptic: bool) -> ModeSum:
    """Make the model of the samples of a window."""
    tau = record.t_s - record.t_s[0]
    return ModeSum(
        tau=tau,
        span_s=float(tau[-1]),
        layout=layout,
        elliptic=elliptic,
        average_frames=record.average_frames,
        frame_period_s=record.frame_period_s,
    )
