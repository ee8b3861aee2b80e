"""Drift of the horizontal magnification of a camera: a gain on the tangent of every angle.

The columns are scaled about that of the optical axis, as by a lens whose focal length along the
rows changes; it is the middle column where `lens.centre_px` does not shift it.
"""

from __future__ import annotations

DRIFT_S = 24.0  # in which the magnification changes by gain_drift_rel of that at the start
MIN_GAIN = 0.1  # a long run ends at this magnification, not at a mirrored picture


def horizontal_gain(drift_rel: float, t_s: float) -> float:
    """Compute the magnification over that at the start, t_s after the start of the simulation."""
    return max(1.0 + drift_rel * t_s / DRIFT_S, MIN_GAIN)
