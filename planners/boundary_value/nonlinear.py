"""The true pendulum's necessary conditions: one link, sin and cos of its angle kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planners.errors import PlanError
from planners.problem import Problem
from planners.trajectories.pieces import FloatArray

INPUTS = ("acceleration", "jerk")


@dataclass(frozen=True)
class TruePendulum:
    """Hamiltonian system of th'' = -weight sin th - damping th' - reach cos(th) a under min 1/2 int (x'Qx + r u^2) dt.

    x = [position, speed, th, th'], and a last for the jerk model, lag a' = u - a; z = [x; costates p]; points in columns.
    a, or for the jerk model u, minimises H = 1/2 (x'Qx + r u^2) + p'x' (Pontryagin's principle; source 004, section 2.1).
    """

    reach_1_m: float  # of a point mass 1 / length
    weight_1_s2: float
    damping_1_s: float
    lag_s: float | None  # None: the acceleration is the input
    q: FloatArray  # (n,) diagonal of Q
    r: float

    @property
    def states_count(self) -> int:
        """n."""
        return 4 if self.lag_s is None else 5

    def input(self, z: FloatArray) -> FloatArray:
        """u where H is least: (2n, N) -> (N,)."""
        return self.acceleration(z) if self.lag_s is None else -z[9] / (self.lag_s * self.r)

    def acceleration(self, z: FloatArray) -> FloatArray:
        """Of the platform: (2n, N) -> (N,)."""
        return -self._push(z) / self.r if self.lag_s is None else z[4]

    def slope(self, z: FloatArray) -> FloatArray:
        """z': (2n, N) -> (2n, N)."""
        n, a, (th, w), (_, pth, pw) = (
            self.states_count,
            self.acceleration(z),
            z[2:4],
            self._costates(z),
        )
        sin, cos = np.sin(th), np.cos(th)
        out = np.zeros_like(z)
        out[0], out[1], out[2] = z[1], a, w
        out[3] = -self.weight_1_s2 * sin - self.damping_1_s * w - self.reach_1_m * cos * a
        out[n:] = -self.q[:, None] * z[:n]
        out[n + 1] -= z[n]
        out[n + 2] += (self.weight_1_s2 * cos - self.reach_1_m * a * sin) * pw
        out[n + 3] += self.damping_1_s * pw - pth
        if self.lag_s is not None:
            out[4] = (self.input(z) - a) / self.lag_s
            out[9] += z[9] / self.lag_s - self._push(z)
        return out

    def jacobian(self, z: FloatArray) -> FloatArray:
        """dz'/dz: (2n, N) -> (2n, 2n, N)."""
        n, a, th, pw = self.states_count, self.acceleration(z), z[2], self._costates(z)[2]
        sin, cos, k = np.sin(th), np.cos(th), self.reach_1_m
        da, push = self._slopes(z)
        out = np.zeros((2 * n, 2 * n, z.shape[1]))
        out[0, 1] = out[2, 3] = 1.0
        out[1] = da
        out[3] = -k * cos * da
        out[3, 2] += -self.weight_1_s2 * cos + k * sin * a
        out[3, 3] -= self.damping_1_s
        out[range(n, 2 * n), range(n)] = -self.q[:, None]
        out[n + 1, n] -= 1.0
        out[n + 2] += -k * sin * pw * da
        out[n + 2, 2] += -(self.weight_1_s2 * sin + k * a * cos) * pw
        out[n + 2, n + 3] += self.weight_1_s2 * cos - k * a * sin
        out[n + 3, n + 3] += self.damping_1_s
        out[n + 3, n + 2] -= 1.0
        if self.lag_s is not None:
            out[4, 4], out[4, 9] = -1.0 / self.lag_s, -1.0 / (self.lag_s**2 * self.r)
            out[9] -= push
            out[9, 9] += 1.0 / self.lag_s
        return out

    def _costates(self, z: FloatArray) -> FloatArray:
        """Of speed, angle and rate: (3, N)."""
        return z[self.states_count + 1 : self.states_count + 4]

    def _push(self, z: FloatArray) -> FloatArray:
        """What a unit of acceleration adds to p'x': (N,)."""
        pv, _, pw = self._costates(z)
        return np.asarray(pv - self.reach_1_m * np.cos(z[2]) * pw)

    def _slopes(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gradients of the acceleration and of _push: (2n, N) each."""
        n, k = self.states_count, self.reach_1_m
        push, da = np.zeros_like(z), np.zeros_like(z)
        push[2] = k * np.sin(z[2]) * z[n + 3]
        push[n + 1] = 1.0
        push[n + 3] = -k * np.cos(z[2])
        if self.lag_s is None:
            return -push / self.r, push
        da[4] = 1.0
        return da, push


def true_pendulum(problem: Problem) -> TruePendulum:
    """Of a nonlinear problem with one link. Raises PlanError for what these conditions do not cover."""
    _check(problem)
    e = problem.model.equations
    inertia, coupling = float(e.mass_kg_m2[0, 0]), float(e.coupling_kg_m[0])
    return TruePendulum(
        reach_1_m=coupling / inertia,
        weight_1_s2=e.gravity_m_s2 * coupling / inertia,
        damping_1_s=float(e.damping_n_m_s_rad[0, 0]) / inertia,
        lag_s=problem.lag_s if problem.input == "jerk" else None,
        q=np.array([problem.state_weights.get(name, 0.0) for name in problem.states]),
        r=problem.input_weight,
    )


def _check(problem: Problem) -> None:
    if problem.model.links_count != 1:
        raise PlanError(
            f"nonlinear = True with {problem.model.links_count} links; must be 1 link: plan with nonlinear = False and "
            "look at the plan's residual_swing_nonlinear_rad"
        )
    if problem.input not in INPUTS:
        raise PlanError(
            f"nonlinear = True with input = {problem.input!r}; must be one of {', '.join(INPUTS)}: take one of these"
        )
    if problem.robust:
        raise PlanError(
            f"nonlinear = True with robust = {problem.robust}; must be (): sensitivities are those of the linear model, "
            "so plan with nonlinear = False or without robust"
        )
