"""Experiment file that runs the load on a sized axis: `rig run` takes what `rig size` chose."""

from __future__ import annotations

import math

from rig.errors import ConfigError
from rig.studies.sizing.judgement import Judgement

END_M = 0.02  # from an end switch to its stop
USUAL_TORQUE_N_M = 3.8  # where the sizing names no motor

TEXT = """\
# Ball screw {name}, judged {verdict} by `rig size`. The drive is designed for the same figures as
# the bench has; a truth that differs is a change of [bench.robot].{slope}
[experiment]
name = "sized_axis"
kind = "move"
planner = "matrix_exponential"
quiet_s = 3.5
watch_s = 10

[move]
distance_m = {distance_m:.6g}
time_s = 1.5

[limits]
speed_m_s = {speed_m_s:.6g}

[safety]
position_min_m = {lower_m:.6g}
position_max_m = {upper_m:.6g}

[links.frame_1]
delay_ms = 8
[links.reference]
delay_ms = 1

[drive]
lead_m = {lead_m:.9g}
rotary_inertia_kg_m2 = {inertia_kg_m2:.6g}
moving_mass_kg = {vibrating_kg:.6g}
axial_stiffness_n_m = {stiffness_n_m:.6g}
rated_torque_n_m = {rated_n_m:.6g}
torque_limit_n_m = {peak_n_m:.6g}

[bench.robot]
kind = "ball_screw"
lead_m = {lead_m:.9g}
rotary_inertia_kg_m2 = {inertia_kg_m2:.6g}
table_mass_kg = {mass_kg:.6g}
screw_axial_mass_kg = {axial_kg:.6g}
axial_stiffness_n_m = {stiffness_n_m:.6g}
coulomb_force_n = {friction_n:.6g}
preload_drag_n_m = {drag_n_m:.6g}
efficiency = {efficiency:.6g}
torque_limit_n_m = {peak_n_m:.6g}
speed_limit_m_s = {speed_m_s:.6g}
negative_stop_m = {negative_stop_m:.6g}
negative_switch_m = {lower_m:.6g}
positive_switch_m = {upper_m:.6g}
positive_stop_m = {positive_stop_m:.6g}

[bench.pendulum]
length_m = 1.0
damping_ratio = 0.000237
"""


def experiment_text(judged: Judgement) -> str:
    """Write the experiment of the judged screw; its travel is centred, half to each side.

    Raises ConfigError for a constant force on the axis, which the simulated axis does not know.
    """
    axis, screw = judged.sizing.axis, judged.judged.screw
    if axis.load.force_n:
        raise ConfigError(
            f"[axis] force_n = {axis.load.force_n:g}; must be 0 for --experiment: "
            "the simulated axis has mass, slope and friction alone"
        )
    transmission = axis.transmission_for(judged.judged.candidate)
    half_m = 0.5 * axis.mounting.length_m
    motor = axis.motor
    axial_kg = screw.mass_kg / 3.0  # of a rod with one end fixed (Rayleigh)
    upper_m = half_m - END_M
    return TEXT.format(
        name=judged.judged.candidate.name,
        verdict=judged.verdict,
        distance_m=min(0.2, 0.5 * upper_m),
        speed_m_s=judged.allowed.speed_m_s,
        lower_m=-upper_m,
        upper_m=upper_m,
        negative_stop_m=-half_m,
        positive_stop_m=half_m,
        lead_m=screw.lead_m,
        inertia_kg_m2=transmission.inertia_kg_m2(screw),
        vibrating_kg=axis.load.mass_kg + axial_kg,
        mass_kg=axis.load.mass_kg,
        axial_kg=axial_kg,
        stiffness_n_m=axis.stiffness_n_m(screw),
        rated_n_m=motor.continuous_torque_n_m if motor else USUAL_TORQUE_N_M / 3.0,
        peak_n_m=motor.peak_torque_n_m if motor else USUAL_TORQUE_N_M,
        friction_n=axis.load.friction_n,
        drag_n_m=transmission.drag_torque_n_m or 0.0,
        efficiency=transmission.efficiency,
        slope=_slope_note(math.degrees(axis.load.slope_rad)),
    )


def _slope_note(slope_deg: float) -> str:
    """Say that a slope is left out: the bench has no brake that holds the table."""
    if not slope_deg:
        return ""
    return (
        f" The slope of {slope_deg:g} degrees is left out:\n"
        "# there is no brake, and the table would slide while the drive is off."
    )
