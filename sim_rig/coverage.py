"""Share of each pixel that a line covers, on strips of columns around its axis."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig.cable_axis import CableAxis
from sim_rig.profile import CableShape, profile_table

FloatArray = NDArray[np.float64]
MIN_SWEEP_PX = 0.02  # a shorter sweep is drawn as this one; the profile is wider by 1e-5
DERIVATIVE_PX = 0.05  # half the distance of the central difference


class Strips(NamedTuple):
    """Values on strips of an image: row rows[r], columns columns[r]."""

    rows: NDArray[np.intp]  # (R, 1)
    columns: NDArray[np.intp]  # (R, W)
    share: FloatArray  # (R, W) covered, 0 to 1


def coverage(
    axis: CableAxis, shape: CableShape, width: int, shift_px: float = 0.0
) -> Strips | None:
    """Compute the share that a line covers, on the columns 0 to before width.

    shape: with contrast 1. shift_px moves the line to the right. None if nothing is covered.
    """
    low = np.minimum(axis.start_px, axis.end_px) + shift_px
    high = np.maximum(axis.start_px, axis.end_px) + shift_px
    cos_tilt = 1.0 / np.hypot(1.0, axis.slope)
    reach = _edge_px(shape) / cos_tilt + 1.0
    near = (high + reach > 0.0) & (low - reach < width - 1.0)
    if not near.any():
        return None
    span = int(np.ceil((high - low + 2.0 * reach)[near].max())) + 1
    span = min(span, width)
    middle = 0.5 * (low + high)
    left = np.rint(middle - 0.5 * (span - 1))
    left = np.minimum(np.maximum(left, 0), width - span).astype(np.intp)
    columns = left[:, None] + np.arange(span)
    # the mean over the exposure is where the line is; its range is where it has been
    sweep = np.maximum(high - low, MIN_SWEEP_PX)
    start = (axis.mean_px + shift_px - 0.5 * sweep)[:, None]
    share = _swept(columns, start, sweep[:, None], cos_tilt[:, None], shape)
    rows = (axis.first_row + np.arange(len(left)))[:, None]
    return Strips(rows, columns, share)


def derivative(strips: Strips, axis: CableAxis, shape: CableShape) -> FloatArray:
    """Compute the change of the share per pixel that the line moves to the right (R, W)."""
    sweep = np.maximum(np.abs(axis.end_px - axis.start_px), MIN_SWEEP_PX)[:, None]
    start = axis.mean_px[:, None] - 0.5 * sweep
    cos_tilt = 1.0 / np.hypot(1.0, axis.slope)[:, None]
    right = _swept(strips.columns, start + DERIVATIVE_PX, sweep, cos_tilt, shape)
    left = _swept(strips.columns, start - DERIVATIVE_PX, sweep, cos_tilt, shape)
    return np.asarray((right - left) / (2.0 * DERIVATIVE_PX))


def _swept(
    columns: NDArray[np.intp],
    start: FloatArray,
    sweep: FloatArray,
    cos_tilt: FloatArray,
    shape: CableShape,
) -> FloatArray:
    """Compute (P((x - a) c) - P((x - b) c)) / (c (b - a)) of a line that moves from a to b."""
    first = (columns - start) * cos_tilt
    return np.asarray(
        (_integral(first, shape) - _integral(first - sweep * cos_tilt, shape)) / (sweep * cos_tilt)
    )


def _integral(d_px: FloatArray, shape: CableShape) -> FloatArray:
    """Look up the integral of the profile at distances (R, W) from the axis."""
    table, per_px, zero = _table(shape)
    place = np.minimum(np.maximum(d_px * per_px + zero, 0.0), table.size - 2.0)
    whole = place.astype(np.intp)
    part = place - whole
    lower = table.take(whole)
    return np.asarray(lower + part * (table.take(whole + 1) - lower))


@lru_cache(maxsize=32)
def _table(shape: CableShape) -> tuple[FloatArray, float, float]:
    """Tabulate the integral of the profile: values, values per pixel, place of distance 0."""
    d_px, p_px = profile_table(shape)
    per_px = (d_px.size - 1) / (d_px[-1] - d_px[0])
    return p_px, per_px, -d_px[0] * per_px


def _edge_px(shape: CableShape) -> float:
    return float(profile_table(shape)[0][-1])
