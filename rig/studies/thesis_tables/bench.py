"""Door to the simulated free cart: a model of the planners in, its nonlinear motion out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from planners.models.chain import ChainModel
from planners.trajectories.pieces import FloatArray
from sim_rig.free_cart import FreeCart
from sim_rig.load_params import LinkParams, LoadParams


class ForceStep(NamedTuple):
    """Constant force on the cart along x."""

    duration_s: float
    force_n: float


class CartMotion(NamedTuple):
    """Sampled motion of a free cart and its load, from rest at position 0."""

    t_s: FloatArray  # (N,) from 0
    position_m: FloatArray  # (N,)
    angles_rad: FloatArray  # (N, n) absolute
    rates_rad_s: FloatArray  # (N, n)


def nonlinear_motion(
    model: ChainModel, start_rad: float, forces: Sequence[ForceStep], sample_s: float
) -> CartMotion:
    """Simulate cart and chain from rest with every link at start_rad.

    Durations of the forces are multiples of sample_s. The model must have no modal damping.
    """
    load = LoadParams(
        gravity_m_s2=model.gravity_m_s2,
        damping_ratio=model.damping_ratio,
        tip_mass_kg=model.tip_mass_kg,
    )
    cart = FreeCart(model.cart_mass_kg, _links(model, start_rad), load)
    samples = [_sample(cart)]
    for step in forces:
        for _ in range(round(step.duration_s / sample_s)):
            cart.advance(sample_s, 1, step.force_n)
            samples.append(_sample(cart))
    n = model.links_count
    values = np.array(samples, dtype=np.float64)
    t_s = sample_s * np.arange(len(values), dtype=np.float64)
    return CartMotion(t_s, values[:, 0], values[:, 1 : 1 + n], values[:, 1 + n :])


def _links(model: ChainModel, start_rad: float) -> list[LinkParams]:
    """Convert the links; a joint belongs to the link below it, the pivot is free."""
    stiffness = (0.0, *model.stiffness_n_m_rad)
    damping = (0.0, *model.joint_damping_n_m_s_rad)
    links = []
    for link, spring, damper in zip(model.links, stiffness, damping, strict=True):
        links.append(
            LinkParams(
                length_m=link.length_m,
                mass_kg=link.mass_kg,
                kind="bar" if link.kind == "bar" else "point",
                joint_stiffness_n_m_rad=spring,
                joint_damping_n_m_s_rad=damper,
                initial_x_rad=start_rad,
            )
        )
    return links


def _sample(cart: FreeCart) -> list[float]:
    links = cart.links
    angles_rad = [link.angle_x_rad for link in links]
    rates_rad_s = [link.rate_x_rad_s for link in links]
    return [cart.position_m, *angles_rad, *rates_rad_s]
