"""Pieces of a trajectory, each on its own local time 0..duration_s.

Three kinds in two classes: a polynomial; a polynomial plus (damped, growing) sinusoids, which is
the same class with modes; and a smooth function with its own derivatives.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from planners.errors import PlanError

FloatArray: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]
Number = TypeVar("Number", float, complex)


class ModalTerm(NamedTuple):
    """Term Re(p(t) exp(rate t)) with a complex polynomial p; of degree 0 for a plain sinusoid."""

    rate_1_s: complex
    coefficients: tuple[complex, ...]  # of p, ascending powers of t

    def at(self, t: FloatArray) -> FloatArray:
        """Compute the values at local times t."""
        s, w = self.rate_1_s.real, self.rate_1_s.imag
        if len(self.coefficients) == 1:
            size, phase = cmath.polar(self.coefficients[0])
            wave = np.asarray(w * t)
            wave += phase
            np.cos(wave, out=wave)
            wave *= size
        else:
            real = _horner([c.real for c in self.coefficients], t)
            imaginary = _horner([c.imag for c in self.coefficients], t)
            wave = real * np.cos(w * t) - imaginary * np.sin(w * t)
        if s:
            wave *= np.exp(s * t)
        return wave


@dataclass(frozen=True)
class ExpPolynomial:
    """Polynomial plus modes: sum_j coefficients[j] t^j + sum_k Re(p_k(t) exp(rate_k t))."""

    duration_s: float
    coefficients: tuple[float, ...]  # ascending powers of t, at least one
    modes: tuple[ModalTerm, ...] = ()

    @property
    def cell_count(self) -> int:
        """Number of equal cells with |rate| x half a cell <= 1 for the fastest mode."""
        fastest = max((abs(mode.rate_1_s) for mode in self.modes), default=0.0)
        return max(1, math.ceil(self.duration_s * fastest / 2))

    @property
    def degree(self) -> int:
        """Highest power of t, in the polynomial or in front of a mode."""
        powers = [len(self.coefficients), *(len(mode.coefficients) for mode in self.modes)]
        return max(powers) - 1

    def at(self, t: FloatArray, order: int = 0) -> FloatArray:
        """Compute the derivative of that order at local times t, any shape."""
        f = self
        for _ in range(order):
            f = f.derivative()
        out = _horner(f.coefficients, t)
        for mode in f.modes:
            out += mode.at(t)
        return out

    def value(self, t: float) -> float:
        """Compute the value at one local time, ten times faster than with an array of one."""
        total = sum(c * t**j for j, c in enumerate(self.coefficients))
        for rate, p in self.modes:
            total += (cmath.exp(rate * t) * sum(c * t**j for j, c in enumerate(p))).real
        return total

    def derivative(self) -> ExpPolynomial:
        """Compute the derivative as a piece."""
        modes = []
        for rate, c in self.modes:
            slope = (*_derivative(c), 0j)
            modes.append(
                ModalTerm(rate, tuple(rate * a + b for a, b in zip(c, slope, strict=True)))
            )
        line = _derivative(self.coefficients) or (0.0,)
        return ExpPolynomial(self.duration_s, line, tuple(modes))

    def integral(self, start: float) -> ExpPolynomial:
        """Compute the integral that begins at `start`; no mode may have rate 0."""
        modes = tuple(
            ModalTerm(rate, exponential_antiderivative(rate, c)) for rate, c in self.modes
        )
        constant = start - sum(mode.coefficients[0].real for mode in modes)
        powers = (c / (j + 1) for j, c in enumerate(self.coefficients))
        return ExpPolynomial(self.duration_s, (constant, *powers), modes)

    def window(self, start_s: float, duration_s: float) -> ExpPolynomial:
        """Compute the part from start_s on, on its own local time."""
        modes = []
        for rate, c in self.modes:
            growth = cmath.exp(rate * start_s)
            modes.append(ModalTerm(rate, tuple(growth * a for a in _shifted(c, start_s))))
        return ExpPolynomial(duration_s, _shifted(self.coefficients, start_s), tuple(modes))

    def scaled(self, factor: float) -> ExpPolynomial:
        """Multiply the piece by factor."""
        modes = tuple(ModalTerm(rate, tuple(factor * a for a in c)) for rate, c in self.modes)
        return ExpPolynomial(self.duration_s, tuple(factor * a for a in self.coefficients), modes)


@dataclass(frozen=True)
class Smooth:
    """Smooth function with its own derivatives: function(local times, order).

    Orders are 0 to highest_order.
    """

    duration_s: float
    function: Callable[[FloatArray, int], FloatArray]
    highest_order: int

    def at(self, t: FloatArray, order: int = 0) -> FloatArray:
        """Compute the derivative of that order at local times t.

        Raises PlanError beyond highest_order.
        """
        if order > self.highest_order:
            raise PlanError(
                f"derivative order {order} of a smooth piece; must be <= {self.highest_order}: "
                "declare more derivatives"
            )
        return self.function(t, order)

    def window(self, start_s: float, duration_s: float) -> Smooth:
        """Compute the part from start_s on, on its own local time."""
        last = self.duration_s  # rounding at a joint must stay in the domain of the function
        return Smooth(
            duration_s,
            lambda t, order: self.at(np.clip(t + start_s, 0.0, last), order),
            self.highest_order,
        )

    def scaled(self, factor: float) -> Smooth:
        """Multiply the piece by factor."""
        return Smooth(
            self.duration_s, lambda t, order: factor * self.at(t, order), self.highest_order
        )


Piece: TypeAlias = ExpPolynomial | Smooth


def polynomial(duration_s: float, coefficients: Sequence[float]) -> ExpPolynomial:
    """Build the plain polynomial sum_j coefficients[j] t^j."""
    return ExpPolynomial(duration_s, tuple(float(c) for c in coefficients))


def add(a: Piece, b: Piece) -> Piece:
    """Compute a + b over the duration of a; both must have the same duration."""
    if isinstance(a, ExpPolynomial) and isinstance(b, ExpPolynomial):
        return add_closed(a, b)
    highest = min(piece.highest_order for piece in (a, b) if isinstance(piece, Smooth))
    return Smooth(a.duration_s, lambda t, order: a.at(t, order) + b.at(t, order), highest)


def add_closed(a: ExpPolynomial, b: ExpPolynomial) -> ExpPolynomial:
    """Compute a + b of two closed forms; modes of one rate become one."""
    modes: dict[complex, tuple[complex, ...]] = {}
    for rate, c in (*a.modes, *b.modes):
        modes[rate] = _sum(modes.get(rate, (0j,)), c)
    terms = tuple(ModalTerm(*item) for item in modes.items())
    return ExpPolynomial(a.duration_s, _sum(a.coefficients, b.coefficients), terms)


def _horner(coefficients: Sequence[float], t: FloatArray) -> FloatArray:
    out = np.full(t.shape, coefficients[-1], dtype=np.float64)
    for c in coefficients[-2::-1]:
        out *= t
        out += c
    return out


def _derivative(coefficients: tuple[Number, ...]) -> tuple[Number, ...]:
    return tuple(j * c for j, c in enumerate(coefficients))[1:]


def _sum(a: tuple[Number, ...], b: tuple[Number, ...]) -> tuple[Number, ...]:
    return tuple(x + y for x, y in zip_longest(a, b, fillvalue=0.0))


def _shifted(coefficients: tuple[Number, ...], start: float) -> tuple[Number, ...]:
    """Compute the coefficients of p(t + start), by repeated synthetic division."""
    c = list(coefficients)
    for i in range(len(c) - 1):
        for j in range(len(c) - 2, i - 1, -1):
            c[j] += start * c[j + 1]
    return tuple(c)


def polynomial_integral(coefficients: tuple[complex, ...]) -> tuple[complex, ...]:
    """Compute the coefficients of int_0^t p."""
    return (0j, *(c / (j + 1) for j, c in enumerate(coefficients)))


def exponential_antiderivative(
    rate: complex, coefficients: tuple[complex, ...]
) -> tuple[complex, ...]:
    """Compute q with (q exp(rate t))' = p exp(rate t), that is q' + rate q = p."""
    q = [0j] * (len(coefficients) + 1)
    for j in range(len(coefficients) - 1, -1, -1):
        q[j] = (coefficients[j] - (j + 1) * q[j + 1]) / rate
    return tuple(q[:-1])
