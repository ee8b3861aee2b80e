"""Axis of the cable in an image whose rows are exposed one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig.cable_state import CableState
from sim_rig.camera_pose import PosedCamera

FloatArray = NDArray[np.float64]
GLOBAL_SAMPLES = 3  # of an exposure: start, middle and end
# of a rolling shutter; a polynomial through five follows 20 Hz over 40 ms to 1e-3
ROLLING_SAMPLES = 5
PIECES = 128  # of a link seen through a distorting lens: 1e-4 px of its bend
MIN_RISE_PX = 1e-3  # between two points; less is a cable that does not hang down in the image


class CableAxis(NamedTuple):
    """Columns of the axis on the rows first_row to before first_row + R."""

    first_row: int
    start_px: FloatArray  # (R,) at the start of the exposure of the row
    mean_px: FloatArray  # (R,) mean over the exposure, by Simpson's rule
    end_px: FloatArray  # (R,)
    slope: FloatArray  # (R,) columns per row
    link_rows: int  # rows of the first link

    @property
    def rows(self) -> FloatArray:
        """Numbers of the rows (R,)."""
        return self.first_row + np.arange(self.mean_px.size, dtype=np.float64)


class AxisProjector:
    """Projection of the states during an exposure to the axis in the image."""

    def __init__(self, pose: PosedCamera, height: int, exposure_s: float, row_s: float) -> None:
        self._pose = pose
        self._height = height
        self._rows = np.arange(height, dtype=np.float64)
        samples = ROLLING_SAMPLES if row_s else GLOBAL_SAMPLES
        whole_s = exposure_s + row_s * (height - 1)
        # instants of the samples from the start of the exposure of row 0 [s]
        self.instants_s: FloatArray = np.linspace(0.0, whole_s, samples)
        starts_s = row_s * self._rows
        parts = (0.0, 0.5, 1.0)
        # weights of the samples (3, S, height) at start, middle and end of the exposure of a row
        self._weights = np.stack(
            [_lagrange(self.instants_s, starts_s + part * exposure_s) for part in parts]
        )
        self._pieces = PIECES if pose.is_distorted else 1

    def axis(self, states: Sequence[CableState], start_s: float = 0.0) -> CableAxis | None:
        """Compute the axis from one state at each of the instants after start_s.

        None if a point is behind the camera, or if the cable does not hang down in the image.
        """
        columns = np.empty((len(states), self._height))
        first, last, link_end = 0.0, self._height - 1.0, self._height - 1.0
        for k, state in enumerate(states):
            pixels = self._project(state, start_s + float(self.instants_s[k]))
            if pixels is None:
                return None
            if pixels[-1, 1] < pixels[0, 1]:  # the camera is upside down
                pixels = pixels[::-1]
            else:
                link_end = min(link_end, pixels[(state.first_link - 1) * self._pieces, 1])
            if np.diff(pixels[:, 1]).min() < MIN_RISE_PX:
                return None
            columns[k] = np.interp(self._rows, pixels[:, 1], pixels[:, 0])
            first = max(first, pixels[0, 1])
            last = min(last, pixels[-1, 1])
        shown = slice(int(np.ceil(first)), int(np.floor(last)) + 1)
        if shown.start >= shown.stop:
            return None
        start, middle, end = np.einsum("ksr,sr->kr", self._weights, columns)[:, shown]
        mean = (start + 4.0 * middle + end) / 6.0
        slope = np.gradient(mean) if mean.size > 1 else np.zeros(1)
        link_rows = min(int(link_end) + 1 - shown.start, mean.size)
        return CableAxis(shown.start, start, mean, end, slope, link_rows)

    def middle_s(self, start_s: float) -> float:
        """Return the instant of the middle one of the states of an exposure that starts then."""
        return start_s + float(self.instants_s[len(self.instants_s) // 2])

    def pivot_px(self, state: CableState, t_s: float = 0.0) -> FloatArray | None:
        """Project the upper end of the cable (2,) at t_s; None if it is behind the camera."""
        found = self._pose.project(np.array([state.position_m]), t_s)
        return None if found is None else found[0]

    def end_px(self, state: CableState, t_s: float = 0.0) -> tuple[FloatArray, float] | None:
        """Project the lower end (2,) at t_s, with the pixels per metre there without drift.

        None if it is behind the camera.
        """
        end_m = np.add(state.position_m, state.points_m[-1])
        found = self._pose.project(end_m[None, :], t_s)
        if found is None:
            return None
        return found[0], float(self._pose.matrix[0, 0]) / self._pose.depth_m(end_m)

    def _project(self, state: CableState, t_s: float) -> FloatArray | None:
        """Project the points of the cable at t_s, with further ones between them by a lens."""
        points = np.asarray(state.points_m)
        if self._pieces > 1:
            knots = np.arange(len(points))
            dense = np.linspace(0, len(points) - 1, (len(points) - 1) * self._pieces + 1)
            points = np.stack([np.interp(dense, knots, axis) for axis in points.T], axis=1)
        return self._pose.project(points + state.position_m, t_s)


def _lagrange(nodes: FloatArray, at: FloatArray) -> FloatArray:
    """Compute the weights (S, N) of the values at nodes (S,) in the polynomial at points (N,)."""
    if nodes[-1] == nodes[0]:
        weights = np.zeros((nodes.size, at.size))
        weights[0] = 1.0
        return weights
    weights = np.ones((nodes.size, at.size))
    for k, node in enumerate(nodes):
        for other in np.delete(nodes, k):
            weights[k] *= (at - other) / (node - other)
    return weights
