"""Tridiagonal systems of splines, one or thousands at once."""

from __future__ import annotations

import numpy as np

from planners.trajectories.pieces import FloatArray


def solve(
    lower: FloatArray, diagonal: FloatArray, upper: FloatArray, right: FloatArray
) -> FloatArray:
    """Solve lower x[k-1] + diagonal x[k] + upper x[k+1] = right; all (..., n).

    Each leading index is a system of its own. They are solved end to end as one banded system,
    in which the first lower and the last upper entry of each is 0.
    """
    from scipy.linalg import solve_banded

    bands = np.zeros((3, *np.broadcast_shapes(diagonal.shape, right.shape)))
    bands[0, ..., 1:] = upper[..., :-1]
    bands[1] = diagonal
    bands[2, ..., :-1] = lower[..., 1:]
    flat = np.broadcast_to(right, bands.shape[1:]).ravel()
    x: FloatArray = solve_banded(
        (1, 1), bands.reshape(3, -1), flat, check_finite=False, overwrite_ab=True
    )
    return x.reshape(bands.shape[1:])
