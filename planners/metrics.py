"""What a planned move amounts to: swing on the linear and the nonlinear model, speed, acceleration, travel."""

from __future__ import annotations

import cmath

from planners.cells import exponential_integral
from planners.models.pendulum import PendulumModel
from planners.problem import Metrics, Problem
from planners.replay import replay
from planners.trajectory import Trajectory


def measure(problem: Problem, trajectory: Trajectory) -> Metrics:
    """The metrics of a trajectory offered for a problem; residuals count from the goal state's swing."""
    model = problem.model
    _, v0, angle0, rate0 = problem.start().tolist()
    _, v1, angle1, rate1 = problem.goal().tolist()
    swing = replay(model, trajectory, angle_rad=angle0, angular_velocity_rad_s=rate0, speed_before_m_s=v0, speed_after_m_s=v1)
    angle, rate = swing_after(model, trajectory, angle0, rate0, v0, v1)
    low, high = trajectory.extent(0)
    return Metrics(
        peak_swing_rad=swing.peak_rad(),
        residual_swing_rad=model.amplitude_rad(angle - angle1, rate - rate1),
        residual_swing_nonlinear_rad=model.amplitude_rad(
            float(swing.angle_rad[-1]) - angle1, float(swing.angular_velocity_rad_s[-1]) - rate1
        ),
        peak_speed_m_s=trajectory.peak(1).value,
        rms_speed_m_s=trajectory.rms(1),
        peak_acceleration_m_s2=trajectory.peak(2).value,
        rms_acceleration_m_s2=trajectory.rms(2),
        travel_m=high - low,
        acceleration_continuous=trajectory.continuous(2),
    )


def swing_after(
    model: PendulumModel,
    trajectory: Trajectory,
    angle_rad: float = 0.0,
    angular_velocity_rad_s: float = 0.0,
    speed_before_m_s: float = 0.0,
    speed_after_m_s: float = 0.0,
) -> tuple[float, float]:
    """Angle [rad] and its rate [rad/s] on the linear model at the end of the trajectory, to rounding.

    With mu the swing's eigenvalue, q = theta' - conj(mu) theta obeys q' = mu q - a/l; the acceleration is taken in
    parts, int a exp(-mu t) = [v exp(-mu t)] + mu int v exp(-mu t), so that steps in speed count too.
    """
    mu, end = model.swing_rate_1_s, trajectory.duration_s
    push = speed_after_m_s - speed_before_m_s * cmath.exp(mu * end)
    for start, piece in zip(trajectory.breaks_s.tolist(), trajectory.pieces, strict=False):
        push += mu * cmath.exp(mu * (end - start)) * exponential_integral(piece, 1, mu)
    q = (angular_velocity_rad_s - mu.conjugate() * angle_rad) * cmath.exp(mu * end) - push / model.length_m
    angle = q.imag / mu.imag
    return angle, q.real + mu.real * angle
