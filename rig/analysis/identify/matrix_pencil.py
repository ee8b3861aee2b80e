"""Poles of a record by the matrix pencil: start, order and second opinion of the fit."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.identify.sampled import Sampled

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

MAX_GRID = 420  # samples; beyond it the singular values cost more than the fit
MAX_DAMPING_RATIO = 0.6
MIN_PERIODS = 0.6  # of a pole inside the record; less is a drift
HIGHEST_ORDER = 12  # of the stabilisation diagram


class Pole(NamedTuple):
    """An oscillating pole; amplitude and phase at the first sample."""

    frequency_hz: float  # undamped
    damping_ratio: float
    amplitude: float
    phase_rad: float


class Pencil(NamedTuple):
    """Singular vectors of the Hankel matrix of an even grid."""

    values: FloatArray  # (N,) on the grid
    step_s: float
    singular_values: FloatArray
    right: FloatArray  # (rank, L) rows


def pencil(record: Sampled, samples_per_period: float, frequency_hz: float) -> Pencil:
    """Resample to an even grid (linear interpolation; block means where it is coarser)."""
    step_s = max(record.step_s, 1 / (samples_per_period * frequency_hz))
    count = int(record.duration_s / step_s) + 1
    if count > MAX_GRID:
        coarsest_s = 1 / (8 * frequency_hz)
        step_s = min(max(step_s, record.duration_s / (MAX_GRID - 1)), max(coarsest_s, step_s))
        count = min(int(record.duration_s / step_s) + 1, MAX_GRID)
    grid = record.t_s[0] + step_s * np.arange(count)
    values = _block_means(record, grid, step_s)
    rows = count // 3
    hankel = np.lib.stride_tricks.sliding_window_view(values, rows)
    _, singular_values, right = np.linalg.svd(hankel, full_matrices=False)
    return Pencil(values, step_s, singular_values, right)


def poles(decomposed: Pencil, order: int) -> list[Pole]:
    """Compute the oscillating poles of a model of so many poles, strongest first.

    Strength is the root of the energy over the record.
    """
    V = decomposed.right[:order].T
    shifted = np.linalg.lstsq(V[:-1], V[1:])[0]
    z = np.linalg.eigvals(shifted).astype(np.complex128)
    z = z[np.abs(z) > 1e-6]
    n = np.arange(decomposed.values.size)
    growth = np.minimum(np.abs(z), math.exp(30 / n.size))  # a spurious pole must not overflow
    basis = (growth * np.exp(1j * np.angle(z))) ** n[:, None]
    residues = np.linalg.lstsq(basis, decomposed.values.astype(np.complex128))[0]
    energy = np.abs(residues) ** 2 * np.sum(np.abs(basis) ** 2, axis=0)
    found = []
    span_s = decomposed.values.size * decomposed.step_s
    for k in np.argsort(-energy):
        s = np.log(z[k]) / decomposed.step_s
        w0 = abs(s)
        is_kept = s.imag > 0 and w0 * span_s > 2 * math.pi * MIN_PERIODS
        if is_kept and abs(s.real) < MAX_DAMPING_RATIO * w0:
            residue = 2 * residues[k]
            amplitude, phase = abs(residue), float(np.angle(residue))
            frequency_hz = float(w0) / (2 * math.pi)
            found.append(Pole(frequency_hz, float(-s.real / w0), float(amplitude), phase))
    return found


def order_by_gap(decomposed: Pencil, noise: float, highest: int) -> int:
    """Count the singular values above those of white noise: the modes they allow, 1 to highest."""
    values = decomposed.singular_values
    columns = decomposed.right.shape[1]
    rows = decomposed.values.size - columns + 1
    floor = noise * (math.sqrt(rows) + math.sqrt(columns))
    above = int(np.count_nonzero(values > max(1.5 * floor, 1e-9 * values[0])))
    return max(1, min(highest, (above + 1) // 2))


def stabilisation(decomposed: Pencil) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute order, frequency [Hz] and damping ratio of the poles of rising order, as columns."""
    rows = []
    for order in range(2, min(HIGHEST_ORDER, decomposed.right.shape[0]) + 1):
        found = poles(decomposed, order)
        rows += [(float(order), pole.frequency_hz, pole.damping_ratio) for pole in found]
    if not rows:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    table = np.array(rows)
    return table[:, 0], table[:, 1], table[:, 2]


def _block_means(record: Sampled, grid: FloatArray, step_s: float) -> FloatArray:
    """Mean of the samples around each point of the grid, interpolated where there is none."""
    if step_s < 1.5 * record.step_s:
        return np.interp(grid, record.t_s, record.values)
    block = np.rint((record.t_s - grid[0]) / step_s).astype(np.int64)
    inside = block < grid.size
    counts = np.bincount(block[inside], minlength=grid.size)
    sums = np.bincount(block[inside], record.values[inside], grid.size)
    stamps = np.bincount(block[inside], record.t_s[inside], grid.size)
    full = counts > 0
    means = sums[full] / counts[full]
    return np.interp(grid, stamps[full] / counts[full], means)
