"""What swing a plan leaves on a load that is not the one it was made for: curves over one wrong parameter."""

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

SAMPLES_PER_RADIAN = 50.0  # of the fastest mode: a parabola through each leaves 1e-6 of a peak
RELATIVE, ABSOLUTE = (
    1e-9,
    1e-11,
)  # of a step of the nonlinear integration: a move ends within 1e-8 rad
LONGEST_RAD = 1e4  # of the fastest mode: what is longer takes minutes
WINDOW_S = 8.0  # after the move, in which the source's curves are read


def residual_curve(
    model: Model,
    trajectory: Trajectory,
    parameter: str,
    values: ArrayLike,
    *,
    nonlinear: bool = False,
) -> FloatArray:
    """Amplitude [rad] that is left at the end of the move when `parameter` of the real load has each of the values (N,).

    What residual_amplitudes says of those loads: (N,). Source 004, section 3.2, shows such curves.
    Raises PlanError for a parameter the model does not have, for values that are none or make no load or too fast a one.
    """
    return residual_amplitudes(_loads(model, parameter, values), trajectory, nonlinear=nonlinear)


def residual_amplitudes(
    loads: Sequence[Model], trajectory: Trajectory, *, nonlinear: bool = False
) -> FloatArray:
    """Amplitude [rad] that the same move leaves on each of N loads of n links, each its own (Model.amplitude_rad): (N,).

    The platform follows the trajectory from rest to rest, a step in its speed included; the loads hang still before.
    Small swings are integrated exactly, nonlinear ones by Runge-Kutta of order 8, all loads at once.
    Raises PlanError for loads that are none, of unlike numbers of links, or too fast.
    """
    counts = sorted({load.links_count for load in loads})
    if len(counts) != 1:
        raise PlanError(
            f"{len(loads)} loads of {counts} links; must be at least 1 and all of as many: ask for others apart"
        )
    for load in loads:
        _check_phase(load, trajectory.duration_s)
    angles, rates = _replayed(loads, trajectory) if nonlinear else _swings_after(loads, trajectory)
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
    """Largest |angle| [rad] of each link within window_s after the move, small swings: (N, n) for values (N,).

    Raises PlanError as residual_curve does, and for a window that is not finite and > 0.
    """
    if not 0.0 < window_s < math.inf:
        raise PlanError(
            f"window_s = {window_s} after the move; must be > 0 and finite: take some periods of the load"
        )
    loads = _loads(model, parameter, values)
    for load in loads:
        _check_phase(load, trajectory.duration_s + window_s)
    modes = _Modal.of(loads)
    q, n = modes.after(trajectory), model.links_count
    t = np.linspace(
        0.0,
        window_s,
        2 + math.ceil(SAMPLES_PER_RADIAN * window_s * float(np.abs(modes.eigenvalues_1_s).max())),
    )
    peaks = np.empty((len(loads), n))
    for k, (rates, shapes) in enumerate(zip(modes.eigenvalues_1_s, modes.mode_shapes, strict=True)):
        waves = q[k, :, None] * np.exp(np.outer(rates, t))  # (2n, samples)
        angle, slope, bend = ((shapes[:n] * rates**order @ waves).real for order in range(3))
        peaks[k] = _highest(t, angle, slope, bend)
    return peaks


def _loads(model: Model, parameter: str, values: ArrayLike) -> list[Model]:
    if parameter not in model.parameters:
        raise unknown_name("parameter", parameter, model.parameters)
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.ndim != 1 or not numbers.size:
        raise PlanError(
            f"values of {parameter} have shape {numbers.shape}; must be one row of at least 1: list them"
        )
    return [_load(model, parameter, value) for value in numbers.tolist()]


def _load(model: Model, parameter: str, value: float) -> Model:
    if not math.isfinite(value):
        raise PlanError(f"{value} among the values of {parameter}; must be finite: leave it out")
    try:
        return model.with_parameter(parameter, value)
    except PlanError as refused:
        raise PlanError(f"{parameter} = {value:g} makes no load: {refused}") from None


def _check_phase(load: Model, time_s: float) -> None:
    phase = time_s * float(np.abs(load.modes().eigenvalues_1_s).max())
    if phase > LONGEST_RAD:
        raise PlanError(
            f"a mode of {load} passes {phase:.3g} rad in {time_s:g} s; must be <= {LONGEST_RAD:g}: leave it out"
        )


def _swings_after(loads: Sequence[Model], trajectory: Trajectory) -> tuple[FloatArray, FloatArray]:
    modes = _Modal.of(loads)
    states = np.einsum("kij,kj->ki", modes.mode_shapes, modes.after(trajectory)).real
    n = loads[0].links_count
    return states[:, :n], states[:, n:]


class _Modal(NamedTuple):
    """Small swings of N loads, each in modes of its own: q' = rates q + reached a."""

    eigenvalues_1_s: ComplexArray  # (N, 2n)
    mode_shapes: ComplexArray  # (N, 2n, 2n)
    reached: FloatArray  # (N, 2n) 1, or 0 for a mode the platform cannot move

    @classmethod
    def of(cls, loads: Sequence[Model]) -> _Modal:
        modes = [load.modes() for load in loads]
        reached = np.array([m.gains > 0.0 for m in modes], dtype=np.float64)
        return cls(
            np.array([m.eigenvalues_1_s for m in modes]),
            np.array([m.mode_shapes for m in modes]),
            reached,
        )

    def after(self, trajectory: Trajectory) -> ComplexArray:
        """q at the end: int a exp(rate (T - t)) dt, by parts rate int v exp(rate (T - t)) dt, so that steps in speed count."""
        rates = self.eigenvalues_1_s.ravel()
        total, end = np.zeros_like(rates), trajectory.duration_s
        for stop, piece in zip(trajectory.breaks_s[1:].tolist(), trajectory.pieces, strict=True):
            total += np.exp(rates * (end - stop)) * exponential_integral(piece, 1, rates)
        return np.asarray(self.reached * (rates * total).reshape(self.eigenvalues_1_s.shape))


def _highest(t: FloatArray, angle: FloatArray, slope: FloatArray, bend: FloatArray) -> FloatArray:
    """Largest |angle| of each row (n,): of the samples, and of the crowns of their parabolas that lie nearest to them."""
    shift = np.divide(-slope, bend, out=np.zeros_like(angle), where=bend != 0.0)
    crown = (
        (angle * bend < 0.0)
        & (np.abs(shift) <= t[1] / 2)
        & (t + shift >= 0.0)
        & (t + shift <= t[-1])
    )
    rise = np.where(crown, np.abs(slope * shift) / 2, 0.0)
    return np.asarray((np.abs(angle) + rise).max(axis=1))


def _replayed(loads: Sequence[Model], trajectory: Trajectory) -> tuple[FloatArray, FloatArray]:
    swing = _Nonlinear(loads)
    state = np.zeros(2 * swing.coupling.size)
    for piece in trajectory.pieces:
        state = swing.over(piece, state)
    angles, momenta = swing.parts(state)
    return angles, swing.rates(angles, momenta, 0.0)


class _Nonlinear:
    """N loads of n links under one platform, with momenta for rates: the speed v is then the only input.

    p_i = sum_j mass_ij cos(th_i - th_j) th_j' + coupling_i cos(th_i) v,
    p_i' = -th_i' (sum_j mass_ij sin(th_i - th_j) th_j' + coupling_i sin(th_i) v) - (what Equations names as forces),
    which are Hamilton's equations of planners.models.model.Equations.
    """

    def __init__(self, loads: Sequence[Model]) -> None:
        each = [load.equations for load in loads]
        self.mass = np.array([e.mass_kg_m2 for e in each])  # (N, n, n)
        self.springs = np.array([e.springs_n_m_rad for e in each])
        self.damping = np.array([e.damping_n_m_s_rad for e in each])
        self.coupling = np.array([e.coupling_kg_m for e in each])  # (N, n)
        self.weight = np.array([e.gravity_m_s2 * e.coupling_kg_m for e in each])

    def parts(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angles and momenta, (N, n) each, of a flat state."""
        angles, momenta = state.reshape(2, *self.coupling.shape)
        return angles, momenta

    def rates(self, angles: FloatArray, momenta: FloatArray, speed_m_s: float) -> FloatArray:
        """Angular velocities (N, n)."""
        inertia = self.mass * np.cos(angles[:, :, None] - angles[:, None, :])
        right = momenta - speed_m_s * self.coupling * np.cos(angles)
        if angles.shape[1] == 1:
            return np.asarray(right / inertia[:, :, 0])
        return np.asarray(np.linalg.solve(inertia, right[:, :, None])[:, :, 0])

    def over(self, piece: Piece, state: FloatArray) -> FloatArray:
        """The flat state at the end of a piece, from that at its start."""
        from scipy.integrate import solve_ivp

        speed, order = (piece, 1) if isinstance(piece, Smooth) else (piece.derivative(), 0)

        def slope(t: float, x: FloatArray) -> FloatArray:
            return self.slope(x, float(speed.at(np.asarray(t), order)))

        longest = 2.0 * float(
            resolve(piece, 1).halves_s.max()
        )  # no step passes over a motion that begins late
        with np.errstate(over="ignore", invalid="ignore"):  # of a load that runs away
            done = solve_ivp(
                slope,
                (0.0, piece.duration_s),
                state,
                "DOP853",
                rtol=RELATIVE,
                atol=ABSOLUTE,
                max_step=longest,
            )
        if not done.success:
            t = done.t[-1]
            raise PlanError(
                f"speed = {float(piece.at(t, 1)):.3g} m/s at {t:.6g} s of a piece; must be one the load can be followed at "
                f"({done.message.rstrip('.').lower()}): give the move more time"
            )
        return np.asarray(done.y[:, -1])

    def slope(self, state: FloatArray, speed_m_s: float) -> FloatArray:
        """d/dt of a flat state."""
        angles, momenta = self.parts(state)
        rates, sines = self.rates(angles, momenta, speed_m_s), np.sin(angles)
        twist = _each(self.mass * np.sin(angles[:, :, None] - angles[:, None, :]), rates)
        forces = self.weight * sines + _each(self.springs, angles) + _each(self.damping, rates)
        pull = -rates * (twist + speed_m_s * self.coupling * sines) - forces
        return np.concatenate([rates.ravel(), pull.ravel()])


def _each(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Each load's matrix (N, n, n) on its vector (N, n)."""
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])
