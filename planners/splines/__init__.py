"""Splines through several points of one axis: one table, spline(times_s, points_m).

Imports trajectories, planners/bounds.py and planners/errors.py.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from numpy.typing import ArrayLike

from planners.splines.b_spline import b_spline
from planners.splines.cubic import clamped, natural, periodic
from planners.splines.four_three_four import four_three_four
from planners.splines.n_point import n_point
from planners.trajectories.trajectory import Trajectory

# spline(times_s (N,), points_m (N,)) -> Trajectory that starts at the first point;
# at rest at both ends, except for the last three
SPLINES: dict[str, Callable[[ArrayLike, ArrayLike], Trajectory]] = {
    "cubic": clamped,
    "four_three_four": four_three_four,
    "b_spline_4": partial(b_spline, degree=4),
    "b_spline_5": partial(b_spline, degree=5),
    "natural": natural,
    "periodic": periodic,
    "n_point": n_point,
}
