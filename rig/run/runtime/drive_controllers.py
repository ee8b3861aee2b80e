"""Controllers of the drive by name, designed for the model of `[drive]`."""

from __future__ import annotations

import math
from collections.abc import Callable

from rig.drives.servo.cascade import Cascade, CascadeController
from rig.drives.servo.estimator import Noise, sampled_kalman
from rig.drives.servo.lqg import StateSpaceController
from rig.drives.servo.setpoint import DriveController
from rig.drives.servo.state_feedback import Feedback, lq
from rig.drives.servo.two_mass import TwoMass
from rig.run.drive_section import AxisDriveSection

TORQUE_NOISE_N2_M2_S = 1e-4


def axis_model(drive: AxisDriveSection) -> TwoMass:
    """Compute rotary inertia, screw and table as two masses, seen from the motor."""
    square = drive.tau_m_rad**2
    load_inertia = drive.moving_mass_kg * square
    stiffness = drive.axial_stiffness_n_m * square
    critical = 2.0 * math.sqrt(stiffness * load_inertia)
    return TwoMass(
        motor_inertia_kg_m2=drive.rotary_inertia_kg_m2,
        load_inertia_kg_m2=load_inertia,
        stiffness_n_m_rad=stiffness,
        elastic_damping_n_m_s_rad=drive.elastic_damping_ratio * critical,
    )


def _cascade(drive: AxisDriveSection, period_s: float) -> DriveController:
    inertia = axis_model(drive).rigid_inertia_kg_m2
    design = Cascade(
        speed_gain_n_m_s_rad=drive.speed_loop_rad_s * inertia,
        reset_time_s=10.0 / drive.speed_loop_rad_s,
        position_gain_1_s=drive.position_loop_rad_s,
        torque_limit_n_m=drive.torque_limit_n_m,
        feed_forward_inertia_kg_m2=inertia,
    )
    return CascadeController(design, period_s)


def lq_feedback(drive: AxisDriveSection) -> Feedback:
    """Design the feedback whose slow poles are those of Butterworth (third order).

    A rigid inertia J with integral action has them at the radius w where the integral weighs
    (J w^3)^2 and the torque 1. w is the geometric mean of the crossovers of the cascade.
    """
    model = axis_model(drive)
    radius_rad_s = math.sqrt(drive.speed_loop_rad_s * drive.position_loop_rad_s)
    integral_gain = model.rigid_inertia_kg_m2 * radius_rad_s**3
    # motor angle, motor speed, load angle, load speed and integral of the angle
    weights = (0.0, 0.0, 0.0, 0.0, integral_gain**2)
    return lq(model, weights, 1.0)


def _lqg(drive: AxisDriveSection, period_s: float) -> DriveController:
    model = axis_model(drive)
    noise = Noise(
        motor_torque_n2_m2_s=TORQUE_NOISE_N2_M2_S,
        load_torque_n2_m2_s=TORQUE_NOISE_N2_M2_S,
        encoder_counts_per_rev=drive.encoder_counts_per_rev,
    )
    return StateSpaceController(
        model,
        lq_feedback(drive),
        sampled_kalman(model, noise, period_s),
        period_s,
        torque_limit_n_m=drive.torque_limit_n_m,
        feed_forward="rigid",
    )


CONTROLLERS: dict[str, Callable[[AxisDriveSection, float], DriveController]] = {
    "cascade": _cascade,
    "lqg": _lqg,
}
