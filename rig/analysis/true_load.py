"""Swing of a simulated load of several links, or across the plane of the camera, from the truth."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from comms.messages import Truth
from planners.errors import PlanError
from planners.models.chain import ChainModel, Link
from rig.analysis.run_log import RunLog
from rig.analysis.summary import Quantities

PPM = 1e-6

FloatArray = npt.NDArray[np.float64]


class TrueMotion(NamedTuple):
    """Angles and rates of the links in the planes x and y."""

    t_s: FloatArray  # (N,)
    angles_rad: FloatArray  # (N, n, 2)
    rates_rad_s: FloatArray  # (N, n, 2)

    @property
    def tilt_rad(self) -> FloatArray:
        """Angle of each link against the vertical (N, n)."""
        return np.asarray(np.arctan(np.hypot(*np.moveaxis(np.tan(self.angles_rad), -1, 0))))


def true_motion(run: RunLog) -> TrueMotion:
    """Read the motion of the links; empty arrays without a truth."""
    truth = [one for one in run.log.read("/truth", Truth) if one.links]
    t_s = np.array([one.t_ns * 1e-9 for one in truth])
    angles = [[(a.angle_x_rad, a.angle_y_rad) for a in one.links] for one in truth]
    rates = [[(a.rate_x_rad_s, a.rate_y_rad_s) for a in one.links] for one in truth]
    count = len(truth[0].links) if truth else 0
    shape = (len(truth), count, 2)
    return TrueMotion(t_s, np.array(angles).reshape(shape), np.array(rates).reshape(shape))


def pushed_after(run: RunLog) -> bool:
    """Tell if the simulated load was pushed, or its cable changed, after the move had settled."""
    if run.t_start_s is None:
        return False
    settled_s = run.t_settled_s - run.t_start_s
    end_s = run.plan.duration_s
    events = [*run.plant_params.get("pushes", ()), *run.plant_params.get("length_changes", ())]
    ends_s = [(one["at_s"], one["at_s"] + one.get("duration_s", 0.0)) for one in events]
    return any(begin < end_s and end > settled_s for begin, end in ends_s)


def is_beyond_a_pendulum(run: RunLog, motion: TrueMotion) -> bool:
    """Tell if the load has several links, or swung across the plane x."""
    plant = run.plant_params
    return bool(plant.get("links") or plant.get("length_changes")) or bool(
        np.any(motion.angles_rad[..., 1])
    )


def true_load(run: RunLog, motion: TrueMotion) -> Quantities:
    """Compute the quantities of the simulated load.

    Residual swing: amplitude of the planned metric at its instant, of both planes. Peak: largest
    angle of a link against the vertical. Where a camera sees the swing across, both are of the main
    plane alone. Frequency: that of the lowest mode. Raises no error for a load whose modes are not
    known: it has a peak alone.
    """
    found = Quantities()
    model = _model(run.plant_params)
    if model is not None:
        slowest = float(np.abs(model.modes().eigenvalues_1_s).min())
        found.natural_frequency_hz = slowest / (2.0 * math.pi)
        found.damping_ratio = model.damping_ratio
        if model.links_count == 1:
            found.cable_length_m = model.links[0].length_m
    t_s = motion.t_s
    if run.t_start_s is None or t_s.size < 2 or t_s[-1] < run.t_settled_s:
        return found
    end_s = run.t_settled_s if run.plan.time_s > 0 else run.t_move_s + run.plan.watch_s
    shown = (t_s >= run.t_move_s) & (t_s <= end_s)
    is_seen_across = run.across_camera is not None
    if shown.any():
        angles = (
            np.abs(motion.angles_rad[..., run.main_plane]) if is_seen_across else motion.tilt_rad
        )
        found.peak_swing_rad = float(angles[shown].max())
    if model is not None:
        planes = (run.main_plane,) if is_seen_across else (0, 1)
        amplitudes = [_amplitude_rad(run, model, motion, plane) for plane in planes]
        found.residual_swing_rad = math.hypot(*amplitudes)
    return found


def true_amplitude_rad(run: RunLog, motion: TrueMotion, plane: int) -> float | None:
    """Compute the residual swing in a plane, 0 = x, 1 = y; None for a load of unknown modes.

    The truth must reach the instant of the residual swing.
    """
    model = _model(run.plant_params)
    return None if model is None else _amplitude_rad(run, model, motion, plane)


def true_rate(run: RunLog, rate: Any) -> Any:
    """Convert a rate per second of the clock of the rig, as the log has it, to true seconds."""
    return rate * (1.0 + PPM * run.plant_params.get("clock_ppm", 0.0))


def _amplitude_rad(run: RunLog, model: ChainModel, motion: TrueMotion, plane: int) -> float:
    from scipy.interpolate import CubicHermiteSpline

    angles, rates = motion.angles_rad[..., plane], motion.rates_rad_s[..., plane]
    curve = CubicHermiteSpline(motion.t_s, angles, rates)
    at_s = run.t_settled_s
    return model.amplitude_rad(curve(at_s), true_rate(run, curve(at_s, 1)))


def _model(plant: dict[str, Any]) -> ChainModel | None:
    """Make the linear model of the simulated load; None where it is beyond that model."""
    links, load = plant.get("links") or [], plant.get("load") or {}
    if not links:
        pendulum = plant["pendulum"]
        links = [{"length_m": pendulum["length_m"], "mass_kg": pendulum["mass_kg"]}]
        links[0]["length_m"] += sum(one["change_m"] for one in plant.get("length_changes") or [])
        load = {key: pendulum[key] for key in ("gravity_m_s2", "damping_ratio")}
    if links[0].get("joint_stiffness_n_m_rad"):
        return None  # a spring at the platform
    try:
        return ChainModel(
            links=tuple(
                Link(one["length_m"], one["mass_kg"], one.get("kind", "point")) for one in links
            ),
            stiffness_n_m_rad=tuple(one.get("joint_stiffness_n_m_rad", 0.0) for one in links[1:]),
            tip_mass_kg=load.get("tip_mass_kg", 0.0),
            gravity_m_s2=load.get("gravity_m_s2", 9.81),
            damping_ratio=load.get("damping_ratio", 0.0),
        )
    except PlanError:
        return None
