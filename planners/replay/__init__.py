"""Replay: nonlinear simulation of a plan on the planner's model of the load.

With the momenta p_i = sum_j mass_ij cos(th_i - th_j) th_j' + coupling_i cos(th_i) v the platform's
speed v is the only input (Hamilton's equations of planners.models.model.Equations):

p_i' = -th_i' sum_j mass_ij sin(th_i - th_j) th_j' - coupling_i sin(th_i) (v th_i' + gravity)
       - (springs th + damping th')_i

A step in acceleration is then a step in the second derivative only, and a step in speed is exact,
because p is continuous across it. Imports models, trajectories and planners/problem.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError
from planners.models.model import Equations, Model
from planners.replay.one_link import play_one_link
from planners.replay.several_links import play_several_links
from planners.replay.swing import Swing
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory


def replay(
    model: Model,
    trajectory: Trajectory,
    *,
    angles_rad: ArrayLike | None = None,
    rates_rad_s: ArrayLike | None = None,
    speed_before_m_s: float = 0.0,
    speed_after_m_s: float = 0.0,
) -> Swing:
    """Simulate the swing of the load from the start to the end of the trajectory.

    The load starts at angles and rates (n,), or at rest. speed_before_m_s and speed_after_m_s are
    the platform's outside the move: a difference from the trajectory's own acts as a step in
    speed. One link is integrated by Runge-Kutta of order 4 in plain floats, several by Gauss
    collocation of order 24 (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I,
    1993, II.7), both from one joint of the trajectory to the next.
    Raises PlanError for a start that is not n finite numbers, or a load that rotates too fast for
    the integration.
    """
    equations = model.equations
    angles = _start_values("angles_rad", angles_rad, model)
    rates = _start_values("rates_rad_s", rates_rad_s, model)
    momenta = _momenta(equations, angles, rates, speed_before_m_s)
    play = play_one_link if model.links_count == 1 else play_several_links
    segments = list(play(equations, trajectory, angles, momenta))
    t, angle, momentum, speed = (np.concatenate(parts) for parts in zip(*segments, strict=True))
    # The end stands twice: before and after the step to speed_after_m_s.
    t, speed = np.append(t, t[-1]), np.append(speed, speed_after_m_s)
    angle, momentum = np.vstack([angle, angle[-1]]), np.vstack([momentum, momentum[-1]])
    return Swing(
        np.maximum.accumulate(t), angle, _angular_velocities(equations, angle, momentum, speed)
    )


def _start_values(name: str, values: ArrayLike | None, model: Model) -> FloatArray:
    n = model.links_count
    out = np.zeros(n) if values is None else np.atleast_1d(np.asarray(values, dtype=np.float64))
    if out.shape != (n,) or not np.isfinite(out).all():
        raise PlanError(
            f"{name} = {out.tolist()}; must be {n} finite numbers, one for each link: "
            "leave it out for rest"
        )
    return out


def _momenta(
    equations: Equations, angles: FloatArray, rates: FloatArray, speed: float
) -> FloatArray:
    mass = equations.mass_kg_m2 * np.cos(angles[:, None] - angles)
    return np.asarray(mass @ rates + equations.coupling_kg_m * np.cos(angles) * speed)


def _angular_velocities(
    equations: Equations, angles: FloatArray, momenta: FloatArray, speeds: FloatArray
) -> FloatArray:
    """Compute angular velocities from angles and momenta (N, n) and speeds (N,): (N, n)."""
    c, s = np.cos(angles), np.sin(angles)
    mass = equations.mass_kg_m2 * (c[:, :, None] * c[:, None, :] + s[:, :, None] * s[:, None, :])
    load_momenta = momenta - equations.coupling_kg_m * c * speeds[:, None]
    return np.asarray(np.linalg.solve(mass, load_momenta[:, :, None])[:, :, 0])
