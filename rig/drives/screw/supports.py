"""Supports of a screw's ends: beam coefficients of bending, buckling, sag and axial stiffness."""

from __future__ import annotations

import math
from typing import NamedTuple


class Support(NamedTuple):
    """Coefficients of a uniform beam, exact.

    Rounded values of a maker or a source may replace whirl and buckling.
    """

    # K_v: the first bending frequency is K_v sqrt(E I / (M L^3)) (source 004, C.0.6)
    whirl: float
    # f_eu: Euler's load is f_eu pi^2 E I / L^2 (source 004, C.0.14)
    buckling: float
    # the largest deflection under the own weight W is W L^3 / (own_sag E I) (source 004, C.0.16)
    own_sag: float
    # likewise of a load P at its worst place: P L^3 / (load_sag E I)
    load_sag: float
    # L / L_eq: 4 where both ends take the axial force, as the worst place is the middle
    axial_paths: float

    @property
    def stiffest(self) -> bool:
        """True if no other support is stiffer."""
        return self.load_sag >= SUPPORTS["fixed-fixed"].load_sag


# by first and second end; the squared numbers are roots x of the beam's characteristic equation
SUPPORTS = {
    # cos x cosh x = -1
    "fixed-free": Support(1.8751040687119611**2, 0.25, 8.0, 3.0, 1.0),
    # sin x = 0; own sag 384 / 5
    "supported-supported": Support(math.pi**2, 1.0, 76.8, 48.0, 1.0),
    # tan x = tanh x; buckling tan x = x; own sag at (1 + sqrt 33) / 16 of the length
    "fixed-supported": Support(
        3.9266023120479190**2,
        (4.4934094579090642 / math.pi) ** 2,
        184.6339637,
        3.0 * (1.0 + math.sqrt(2.0)) ** 4,
        1.0,
    ),
    # cos x cosh x = 1
    "fixed-fixed": Support(4.7300407448627040**2, 4.0, 384.0, 192.0, 4.0),
}
