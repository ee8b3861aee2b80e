"""Loads of source 004's tables."""

from __future__ import annotations

from planners.models.chain import ChainModel, Link
from planners.models.pendulum import PendulumModel

PENDULUM = PendulumModel(length_m=1.0, mass_kg=0.7, cart_mass_kg=32.0)  # section 3.1
BAR = Link(0.5, 3.375)  # aluminium of 50 mm x 50 mm
TWO_BARS = ChainModel(  # section 4.1
    links=(BAR, BAR),
    stiffness_n_m_rad=(10.0,),
    joint_damping_n_m_s_rad=(2.214e-4,),
    cart_mass_kg=19.522,  # sum of its parts, not the printed 10.5223
)
