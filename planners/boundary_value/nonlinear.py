"""Necessary conditions of the nonlinear pendulum: one link, sin and cos of its angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planners.errors import PlanError
from planners.problem import Problem
from planners.trajectories.pieces import FloatArray

NONLINEAR_INPUTS = ("acceleration", "jerk")


@dataclass(frozen=True)
class NonlinearPendulum:
    """Hamiltonian system of the nonlinear pendulum under min 1/2 int (x'Qx + r u^2) dt.

    th'' = -gravity sin th - damping th' - coupling cos(th) a. x = [position, speed, th, th'], and a
    last for the jerk model, lag a' = u - a; z = [x; costates p]; points in columns. a, or for the
    jerk model u, minimises H = 1/2 (x'Qx + r u^2) + p'x' (Pontryagin's principle; source 004,
    section 2.1).
    """

    coupling_1_m: float  # 1 / length for a point mass
    gravity_1_s2: float  # omega_0^2
    damping_1_s: float
    lag_s: float | None  # None: the acceleration is the input
    q: FloatArray  # (n,) diagonal of Q
    r: float

    @property
    def states_count(self) -> int:
        """Number of states n."""
        return 4 if self.lag_s is None else 5

    def input(self, z: FloatArray) -> FloatArray:
        """Compute the u that minimises H: (2n, N) -> (N,)."""
        if self.lag_s is None:
            return self.acceleration(z)
        return np.asarray(-z[9] / (self.lag_s * self.r))

    def acceleration(self, z: FloatArray) -> FloatArray:
        """Compute the acceleration of the platform: (2n, N) -> (N,)."""
        if self.lag_s is None:
            return np.asarray(-self._input_gradient(z) / self.r)
        return np.asarray(z[4])

    def rhs(self, z: FloatArray) -> FloatArray:
        """Compute z': (2n, N) -> (2n, N)."""
        n = self.states_count
        a = self.acceleration(z)
        th, w = z[2:4]
        _, pth, pw = self._costates(z)
        sin, cos = np.sin(th), np.cos(th)
        out = np.zeros_like(z)
        out[0] = z[1]
        out[1] = a
        out[2] = w
        out[3] = -self.gravity_1_s2 * sin - self.damping_1_s * w - self.coupling_1_m * cos * a
        out[n:] = -self.q[:, None] * z[:n]
        out[n + 1] -= z[n]
        out[n + 2] += (self.gravity_1_s2 * cos - self.coupling_1_m * a * sin) * pw
        out[n + 3] += self.damping_1_s * pw - pth
        if self.lag_s is not None:
            out[4] = (self.input(z) - a) / self.lag_s
            out[9] += z[9] / self.lag_s - self._input_gradient(z)
        return out

    def jacobian(self, z: FloatArray) -> FloatArray:
        """Compute dz'/dz: (2n, N) -> (2n, 2n, N)."""
        n, k = self.states_count, self.coupling_1_m
        a = self.acceleration(z)
        th, pw = z[2], self._costates(z)[2]
        sin, cos = np.sin(th), np.cos(th)
        da, dg = self._gradients(z)
        out = np.zeros((2 * n, 2 * n, z.shape[1]))
        out[0, 1] = out[2, 3] = 1.0
        out[1] = da
        out[3] = -k * cos * da
        out[3, 2] += -self.gravity_1_s2 * cos + k * sin * a
        out[3, 3] -= self.damping_1_s
        out[range(n, 2 * n), range(n)] = -self.q[:, None]
        out[n + 1, n] -= 1.0
        out[n + 2] += -k * sin * pw * da
        out[n + 2, 2] += -(self.gravity_1_s2 * sin + k * a * cos) * pw
        out[n + 2, n + 3] += self.gravity_1_s2 * cos - k * a * sin
        out[n + 3, n + 3] += self.damping_1_s
        out[n + 3, n + 2] -= 1.0
        if self.lag_s is not None:
            out[4, 4] = -1.0 / self.lag_s
            out[4, 9] = -1.0 / (self.lag_s**2 * self.r)
            out[9] -= dg
            out[9, 9] += 1.0 / self.lag_s
        return out

    def _costates(self, z: FloatArray) -> FloatArray:
        """Select the costates of speed, angle and rate: (3, N)."""
        return z[self.states_count + 1 : self.states_count + 4]

    def _input_gradient(self, z: FloatArray) -> FloatArray:
        """Compute the derivative of p'x' by the acceleration: (N,)."""
        pv, _, pw = self._costates(z)
        return np.asarray(pv - self.coupling_1_m * np.cos(z[2]) * pw)

    def _gradients(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute the gradients of the acceleration and of _input_gradient: (2n, N) each."""
        n, k = self.states_count, self.coupling_1_m
        dg, da = np.zeros_like(z), np.zeros_like(z)
        dg[2] = k * np.sin(z[2]) * z[n + 3]
        dg[n + 1] = 1.0
        dg[n + 3] = -k * np.cos(z[2])
        if self.lag_s is None:
            return -dg / self.r, dg
        da[4] = 1.0
        return da, dg


def nonlinear_pendulum(problem: Problem) -> NonlinearPendulum:
    """Derive the necessary conditions of a nonlinear problem with one link.

    Raises PlanError for several links, a force as input, and robust parameters.
    """
    _check(problem)
    e = problem.model.equations
    inertia, coupling = float(e.mass_kg_m2[0, 0]), float(e.coupling_kg_m[0])
    return NonlinearPendulum(
        coupling_1_m=coupling / inertia,
        gravity_1_s2=e.gravity_m_s2 * coupling / inertia,
        damping_1_s=float(e.damping_n_m_s_rad[0, 0]) / inertia,
        lag_s=problem.lag_s if problem.input == "jerk" else None,
        q=np.array([problem.state_weights.get(name, 0.0) for name in problem.states]),
        r=problem.input_weight,
    )


def _check(problem: Problem) -> None:
    if problem.model.links_count != 1:
        raise PlanError(
            f"nonlinear = True with {problem.model.links_count} links; must be 1 link: plan with "
            "nonlinear = False and look at the plan's residual_swing_nonlinear_rad"
        )
    if problem.input not in NONLINEAR_INPUTS:
        raise PlanError(
            f"nonlinear = True with input = {problem.input!r}; "
            f"must be one of {', '.join(NONLINEAR_INPUTS)}: take one of these"
        )
    if problem.robust:
        raise PlanError(
            f"nonlinear = True with robust = {problem.robust}; must be (): sensitivities are those "
            "of the linear model, so plan with nonlinear = False or without robust"
        )
