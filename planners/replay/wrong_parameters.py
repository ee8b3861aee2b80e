"""Residual vibration of a plan versus parameter error: sensitivity curves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from planners.errors import PlanError, unknown_name
from planners.models.model import Model
from planners.trajectories.cells import exponential_integral, resolve
from planners.trajectories.pieces import ComplexArray, FloatArray, Piece, Smooth
from planners.trajectories.trajectory import Trajectory

SAMPLES_PER_RADIAN = 50.0  # of the fastest mode: error 1e-6 of a peak with a parabola through each
RTOL, ATOL = 1e-9, 1e-11  # of a step of the nonlinear integration: a move ends within 1e-8 rad
MAX_PHASE_RAD = 1e4  # of the fastest mode in a move; longer ones take minutes
WINDOW_S = 8.0  # after the move, in which the curves of source 004 are read


def residual_curve(
    model: Model,
    trajectory: Trajectory,
    parameter: str,
    values: ArrayLike,
    *,
    nonlinear: bool = False,
) -> FloatArray:
    """Compute the residual amplitude [rad] for each value (N,) of a parameter of the load: (N,).

    As residual_amplitudes of those loads. Source 004, section 3.2, shows such curves.
    Raises PlanError for a parameter that the model does not have, for an empty list, and for values
    out of bounds or whose load is too fast.
    """
    return residual_amplitudes(_loads(model, parameter, values), trajectory, nonlinear=nonlinear)


def residual_amplitudes(
    loads: Sequence[Model], trajectory: Trajectory, *, nonlinear: bool = False
) -> FloatArray:
    """Compute the residual amplitude [rad] of the same move on each of N loads of n links: (N,).

    Amplitudes as in Model.amplitude_rad of the load itself. The platform follows the trajectory
    from rest to rest, a step in its speed included; the loads hang at rest before. Small swings are
    integrated exactly, nonlinear ones by Runge-Kutta of order 8, all loads at once.
    Raises PlanError for no loads, loads with different numbers of links, or too fast ones.
    """
    counts = sorted({load.links_count for load in loads})
    if len(counts) != 1:
        raise PlanError(
            f"{len(loads)} loads of {counts} links; must be at least 1, all with the same number "
            "of links: compute loads with other numbers separately"
        )
    for load in loads:
        _check_phase(load, trajectory.duration_s)
    if nonlinear:
        angles, rates = _nonlinear_swings(loads, trajectory)
    else:
        angles, rates = _linear_swings(loads, trajectory)
    return np.array(
        [load.amplitude_rad(th, w) for load, th, w in zip(loads, angles, rates, strict=True)]
    )


def residual_peaks(
    model: Model,
    trajectory: Trajectory,
    parameter: str,
    values: ArrayLike,
    *,
    window_s: float = WINDOW_S,
) -> FloatArray:
    """Compute the largest |angle| [rad] of each link within window_s after the move: (N, n).

    For values (N,) of the parameter and small swings. Raises PlanError as residual_curve does, and
    for a window that is not finite and > 0.
    """
    if not 0.0 < window_s < math.inf:
        raise PlanError(
            f"window_s = {window_s} after the move; must be > 0 and finite: "
            "take some periods of the load"
        )
    loads = _loads(model, parameter, values)
    for load in loads:
        _check_phase(load, trajectory.duration_s + window_s)
    modes = _ModalSwings.from_loads(loads)
    q, n = modes.at_end(trajectory), model.links_count
    fastest_1_s = float(np.abs(modes.eigenvalues_1_s).max())
    t = np.linspace(0.0, window_s, 2 + math.ceil(SAMPLES_PER_RADIAN * window_s * fastest_1_s))
    peaks = np.empty((len(loads), n))
    for k, (mu, shapes) in enumerate(zip(modes.eigenvalues_1_s, modes.mode_shapes, strict=True)):
        waves = q[k, :, None] * np.exp(np.outer(mu, t))  # (2n, samples)
        angle, slope, curvature = ((shapes[:n] * mu**order @ waves).real for order in range(3))
        peaks[k] = _peaks(t, angle, slope, curvature)
    return peaks


def _loads(model: Model, parameter: str, values: ArrayLike) -> list[Model]:
    if parameter not in model.parameters:
        raise unknown_name("parameter", parameter, model.parameters)
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.ndim != 1 or not numbers.size:
        raise PlanError(
            f"values of {parameter} have shape {numbers.shape}; must be one row of at least 1: "
            "list them"
        )
    return [_load(model, parameter, value) for value in numbers.tolist()]


def _load(model: Model, parameter: str, value: float) -> Model:
    if not math.isfinite(value):
        raise PlanError(f"{value} among the values of {parameter}; must be finite: leave it out")
    try:
        return model.with_parameter(parameter, value)
    except PlanError as refused:
        raise PlanError(f"{parameter} = {value:g} gives no valid load: {refused}") from None


def _check_phase(load: Model, time_s: float) -> None:
    phase = time_s * float(np.abs(load.modes().eigenvalues_1_s).max())
    if phase > MAX_PHASE_RAD:
        raise PlanError(
            f"a mode of {load} passes {phase:.3g} rad in {time_s:g} s; "
            f"must be <= {MAX_PHASE_RAD:g}: leave this load out"
        )


def _linear_swings(loads: Sequence[Model], trajectory: Trajectory) -> tuple[FloatArray, FloatArray]:
    modes = _ModalSwings.from_loads(loads)
    states = np.einsum("kij,kj->ki", modes.mode_shapes, modes.at_end(trajectory)).real
    n = loads[0].links_count
    return states[:, :n], states[:, n:]


class _ModalSwings(NamedTuple):
    """Small swings of N loads in modal coordinates of their own: q' = mu q + controllable a."""

    eigenvalues_1_s: ComplexArray  # (N, 2n)
    mode_shapes: ComplexArray  # (N, 2n, 2n)
    controllable: FloatArray  # (N, 2n) 1, or 0 for a mode that the platform does not drive

    @classmethod
    def from_loads(cls, loads: Sequence[Model]) -> _ModalSwings:
        """Collect the modes of the loads."""
        modes = [load.modes() for load in loads]
        return cls(
            eigenvalues_1_s=np.array([m.eigenvalues_1_s for m in modes]),
            mode_shapes=np.array([m.mode_shapes for m in modes]),
            controllable=np.array([m.gains > 0.0 for m in modes], dtype=np.float64),
        )

    def at_end(self, trajectory: Trajectory) -> ComplexArray:
        """Compute q at the end of the trajectory, from rest: (N, 2n).

        q = int a exp(mu (T - t)) dt, by parts mu int v exp(mu (T - t)) dt, so that steps in speed
        count.
        """
        mu = self.eigenvalues_1_s.ravel()
        speed_integral = np.zeros_like(mu)
        end_s = trajectory.duration_s
        for stop_s, piece in zip(trajectory.breaks_s[1:].tolist(), trajectory.pieces, strict=True):
            speed_integral += np.exp(mu * (end_s - stop_s)) * exponential_integral(piece, 1, mu)
        q = (mu * speed_integral).reshape(self.eigenvalues_1_s.shape)
        return np.asarray(self.controllable * q)


def _peaks(
    t: FloatArray, angle: FloatArray, slope: FloatArray, curvature: FloatArray
) -> FloatArray:
    """Find the largest |angle| of each row (n,).

    Of the samples, and of the vertices of their parabolas within half a sample.
    """
    shift = np.divide(-slope, curvature, out=np.zeros_like(angle), where=curvature != 0.0)
    is_vertex = (
        (angle * curvature < 0.0)
        & (np.abs(shift) <= t[1] / 2)
        & (t + shift >= 0.0)
        & (t + shift <= t[-1])
    )
    rise = np.where(is_vertex, np.abs(slope * shift) / 2, 0.0)
    return np.asarray((np.abs(angle) + rise).max(axis=1))


def _nonlinear_swings(
    loads: Sequence[Model], trajectory: Trajectory
) -> tuple[FloatArray, FloatArray]:
    swing = _NonlinearLoads(loads)
    state = np.zeros(2 * swing.coupling.size)
    for piece in trajectory.pieces:
        state = swing.integrate(piece, state)
    angles, momenta = swing.split(state)
    return angles, swing.rates(angles, momenta, 0.0)


class _NonlinearLoads:
    """N loads of n links under one platform, in angles and momenta: the speed v is the only input.

    p_i = sum_j mass_ij cos(th_i - th_j) th_j' + coupling_i cos(th_i) v,
    p_i' = -th_i' (sum_j mass_ij sin(th_i - th_j) th_j' + coupling_i sin(th_i) v) - forces_i with
    the forces of gravity, springs and dampers: Hamilton's equations of
    planners.models.model.Equations.
    """

    def __init__(self, loads: Sequence[Model]) -> None:
        each = [load.equations for load in loads]
        self.mass = np.array([e.mass_kg_m2 for e in each])  # (N, n, n)
        self.springs = np.array([e.springs_n_m_rad for e in each])
        self.damping = np.array([e.damping_n_m_s_rad for e in each])
        self.coupling = np.array([e.coupling_kg_m for e in each])  # (N, n)
        self.weight = np.array([e.gravity_m_s2 * e.coupling_kg_m for e in each])

    def split(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Split a flat state into angles and momenta: (N, n) each."""
        angles, momenta = state.reshape(2, *self.coupling.shape)
        return angles, momenta

    def rates(self, angles: FloatArray, momenta: FloatArray, speed_m_s: float) -> FloatArray:
        """Compute the angular velocities (N, n)."""
        inertia = self.mass * np.cos(angles[:, :, None] - angles[:, None, :])
        right = momenta - speed_m_s * self.coupling * np.cos(angles)
        if angles.shape[1] == 1:
            return np.asarray(right / inertia[:, :, 0])
        return np.asarray(np.linalg.solve(inertia, right[:, :, None])[:, :, 0])

    def integrate(self, piece: Piece, state: FloatArray) -> FloatArray:
        """Integrate the flat state from the start to the end of a piece."""
        from scipy.integrate import solve_ivp

        speed, order = (piece, 1) if isinstance(piece, Smooth) else (piece.derivative(), 0)

        def rhs(t: float, x: FloatArray) -> FloatArray:
            return self.rhs(x, float(speed.at(np.asarray(t), order)))

        # No step may skip a motion that begins late in the piece.
        max_step_s = 2.0 * float(resolve(piece, 1).halves_s.max())
        with np.errstate(over="ignore", invalid="ignore"):  # of a load that diverges
            done = solve_ivp(
                rhs,
                (0.0, piece.duration_s),
                state,
                "DOP853",
                rtol=RTOL,
                atol=ATOL,
                max_step=max_step_s,
            )
        if not done.success:
            t = done.t[-1]
            raise PlanError(
                f"speed = {float(piece.at(t, 1)):.3g} m/s at {t:.6g} s of a piece; must be small "
                f"enough for the integration ({done.message.rstrip('.').lower()}): "
                "give the move more time"
            )
        return np.asarray(done.y[:, -1])

    def rhs(self, state: FloatArray, speed_m_s: float) -> FloatArray:
        """Compute d/dt of a flat state."""
        angles, momenta = self.split(state)
        rates = self.rates(angles, momenta, speed_m_s)
        sines = np.sin(angles)
        mass_sines = self.mass * np.sin(angles[:, :, None] - angles[:, None, :])
        twist = _multiply(mass_sines, rates)
        springs, dampers = _multiply(self.springs, angles), _multiply(self.damping, rates)
        forces = self.weight * sines + springs + dampers
        momentum_rates = -rates * (twist + speed_m_s * self.coupling * sines) - forces
        return np.concatenate([rates.ravel(), momentum_rates.ravel()])


def _multiply(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Multiply the matrix (N, n, n) of each load by its vector (N, n)."""
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])
