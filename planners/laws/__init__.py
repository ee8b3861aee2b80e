"""Motion laws from 0 to 1, rest to rest: one table, law(duration_s) -> Trajectory.

Imports trajectories, planners/bounds.py and planners/errors.py.
A move of any distance, sign and start is
LAWS[name](duration_s).scaled(distance_m).shifted(start_m); a distance of 0 m is a hold.
"""

from __future__ import annotations

from collections.abc import Callable

from planners.laws.double_s import double_s
from planners.laws.elliptic import elliptic
from planners.laws.fourier import cycloidal, freudenstein_1_3, freudenstein_1_3_5, gutman_1_3
from planners.laws.harmonic import harmonic
from planners.laws.modified import modified_sine, modified_trapezoidal
from planners.laws.polynomial import cubic, quintic, septic
from planners.laws.rect_cascade import fifteen_segments
from planners.laws.trapezoidal import trapezoidal, triangular
from planners.trajectories.trajectory import Trajectory

LAWS: dict[str, Callable[[float], Trajectory]] = {
    "harmonic": harmonic,
    "cycloidal": cycloidal,
    "elliptic": elliptic,
    "cubic": cubic,
    "quintic": quintic,
    "septic": septic,
    "gutman_1_3": gutman_1_3,
    "freudenstein_1_3": freudenstein_1_3,
    "freudenstein_1_3_5": freudenstein_1_3_5,
    "modified_trapezoidal": modified_trapezoidal,
    "modified_sine": modified_sine,
    "triangular": triangular,
    "trapezoidal": trapezoidal,
    "double_s": double_s,
    "fifteen_segments": fifteen_segments,
}
