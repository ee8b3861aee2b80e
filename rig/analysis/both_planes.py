"""Swing in one plane from two cameras: a swing across is seen in perspective, and is taken out.

A camera with a camera file gives the angle of the cable as if there were no swing across. The cable
lies in the plane through the camera C and its line in the picture. With P the pivot and t_1 the
tangent that a camera of the plane x gives, the normal of that plane is (1, r, t_1), where

    (P - C) . (1, r, t_1) = 0,

and a cable with the tangents (t_x, t_y) lies in it if t_x = t_1 - r t_y. A camera of the plane y
gives t_y = t_2 - q t_x likewise, and both together give t_x = (t_1 - r t_2) / (1 - r q).
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from rig.analysis.seen_swing import FloatArray, SeenSwing

MAX_GAP_S = 0.1  # between two angles of the other camera, from which its angle is interpolated


def camera_centre_m(settings: bytes) -> FloatArray | None:
    """Find the centre (3,) of a camera from the settings of its task; None without a model."""
    from scipy.spatial.transform import Rotation

    tables: dict[str, Any] = msgspec.json.decode(settings)
    model = tables.get("model")
    if not model:
        return None
    turn = Rotation.from_rotvec(model["rotation"])
    return np.asarray(-turn.inv().apply(model["translation_m"]), dtype=np.float64)


def coupling(slope: FloatArray, pivot_m: FloatArray, centre_m: FloatArray, axis: int) -> FloatArray:
    """Compute r (N,): the change of the slope that a camera gives by one of the slope across.

    slope (N,): tangents that it gives. pivot_m (N, 3). axis: of its plane, 0 for x, 1 for y.
    """
    away_m = pivot_m - centre_m
    return np.asarray(-(away_m[:, axis] + slope * away_m[:, 2]) / away_m[:, 1 - axis])


def in_one_plane(
    seen: SeenSwing,
    other: SeenSwing,
    pivot_m: FloatArray,
    centres_m: tuple[FloatArray, FloatArray],
    axis: int,
) -> SeenSwing:
    """Solve for the angle in the plane of one camera, with that of the other at the same instant.

    The angle of the other one is interpolated; an instant where it has none within MAX_GAP_S is
    left out. pivot_m (N, 3) at the instants of seen; centres_m: of both cameras; axis: of the
    first one.
    """
    has_other = _is_covered(seen.t_s, other.t_s)
    t_s = seen.t_s[has_other]
    pivot_m = pivot_m[has_other]
    slope = np.tan(seen.angle_rad[has_other])
    across = np.tan(np.interp(t_s, other.t_s, other.angle_rad))
    r = coupling(slope, pivot_m, centres_m[0], axis)
    q = coupling(across, pivot_m, centres_m[1], 1 - axis)
    solved = (slope - r * across) / (1.0 - r * q)
    return SeenSwing(t_s, np.arctan(solved), seen.sigma_rad[has_other])


def _is_covered(t_s: FloatArray, other_s: FloatArray) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Mark the instants (N,) between two of the other ones, which are not far apart."""
    if other_s.size < 2:
        return np.zeros(t_s.size, dtype=bool)
    after = np.clip(np.searchsorted(other_s, t_s), 1, other_s.size - 1)
    is_close = other_s[after] - other_s[after - 1] <= MAX_GAP_S
    is_inside = (t_s >= other_s[0]) & (t_s <= other_s[-1])
    return np.asarray(is_close & is_inside)
