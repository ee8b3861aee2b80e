"""Metrics of a planned move: linear and nonlinear swing, speed, acceleration, travel."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from planners.models.model import Model
from planners.problem import Metrics, Problem
from planners.replay import replay
from planners.trajectories.cells import exponential_integral
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory


def measure(problem: Problem, trajectory: Trajectory) -> Metrics:
    """Compute the metrics of a trajectory; residuals count from the swing of the goal state."""
    model, n = problem.model, problem.model.links_count
    (_, v0), angles0, rates0 = np.split(problem.start()[: 2 + 2 * n], [2, 2 + n])
    (_, v1), angles1, rates1 = np.split(problem.goal()[: 2 + 2 * n], [2, 2 + n])
    ends = {"speed_before_m_s": float(v0), "speed_after_m_s": float(v1)}
    swing = replay(model, trajectory, angles_rad=angles0, rates_rad_s=rates0, **ends)
    angles, rates = swing_after(model, trajectory, angles0, rates0, **ends)
    low, high = trajectory.extent(0)
    peak_rad, linear_rad, nonlinear_rad = (
        swing.peak_rad(),
        model.amplitude_rad(angles - angles1, rates - rates1),
        model.amplitude_rad(
            swing.angle_rad[-1] - angles1, swing.angular_velocity_rad_s[-1] - rates1
        ),
    )
    if problem.axis == "z":  # a load that hangs at rest keeps hanging
        peak_rad = linear_rad = nonlinear_rad = 0.0
    return Metrics(
        peak_swing_rad=peak_rad,
        residual_swing_rad=linear_rad,
        residual_swing_nonlinear_rad=nonlinear_rad,
        peak_speed_m_s=trajectory.peak(1).value,
        rms_speed_m_s=trajectory.rms(1),
        peak_acceleration_m_s2=trajectory.peak(2).value,
        rms_acceleration_m_s2=trajectory.rms(2),
        travel_m=high - low,
        acceleration_continuous=trajectory.continuous(2),
    )


def swing_after(
    model: Model,
    trajectory: Trajectory,
    angles_rad: ArrayLike = 0.0,
    rates_rad_s: ArrayLike = 0.0,
    *,
    speed_before_m_s: float = 0.0,
    speed_after_m_s: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Compute the swing at the end of the trajectory on the linear model, exact to rounding.

    Returns angles [rad] and their rates [rad/s], (n,) each. Each mode obeys q' = mu q + a; the
    acceleration is integrated by parts, int a exp(-mu t) = [v exp(-mu t)] + mu int v exp(-mu t),
    so that steps in speed count too.
    """
    modes, n = model.modes(), model.links_count
    end_s = trajectory.duration_s
    start = np.concatenate([np.broadcast_to(angles_rad, n), np.broadcast_to(rates_rad_s, n)])
    mu = modes.eigenvalues_1_s
    speed_integral = np.zeros_like(mu)  # int v exp(mu (end - t)) dt
    for stop_s, piece in zip(trajectory.breaks_s[1:].tolist(), trajectory.pieces, strict=True):
        speed_integral += np.exp(mu * (end_s - stop_s)) * exponential_integral(piece, 1, mu)
    free = np.exp(mu * end_s) * (modes.left_eigenvectors @ start - speed_before_m_s)
    q = free + speed_after_m_s + mu * speed_integral
    swing = (modes.mode_shapes @ q).real
    return swing[:n], swing[n:]
