"""Friction compensation of the comparison controllers, `[compensators] friction_compensation`."""

from __future__ import annotations

import math
from typing import Any

from rig.drives.servo.disturbance_design import ObserverDesign
from rig.drives.servo.friction import FrictionCompensated, FrictionDesign
from rig.drives.servo.nominal import LowPass, Nominal
from rig.drives.servo.setpoint import DriveController
from rig.errors import ConfigError
from rig.run.joint.sections import JointDesign

OBSERVER_TIME_SHARE = 0.1  # time constant of Q over that of the adaptation


def compensate_friction(
    spec: JointDesign, controller: DriveController, setpoint_filter: Any | None = None
) -> DriveController:
    """Add friction compensation to a controller if the file asks for it.

    Nominal model: the rigid joint, as the inverse of the elastic one oscillates. Raises ConfigError
    without a torque limit, of which the compensation may use a share.
    """
    c = spec.compensators
    if not c.friction_compensation:
        return controller
    limit_n_m = spec.drive.torque_limit_n_m
    if not math.isfinite(limit_n_m):
        raise ConfigError(
            "[compensators] friction_compensation = true without a torque limit; must have one, as "
            "friction_torque_share is a share of it: give torque_limit_n_m in [drive]"
        )
    low_pass = LowPass(time_constant_s=OBSERVER_TIME_SHARE * c.friction_time_s)
    design = FrictionDesign(
        observer=ObserverDesign(low_pass=low_pass, nominal=Nominal.rigid_joint(spec.joint)),
        time_constant_s=c.friction_time_s,
        deadband_rad_s=c.friction_deadband_rad_s,
        max_torque_n_m=c.friction_torque_share * limit_n_m,
    )
    return FrictionCompensated(controller, design, spec.drive.period_s, limit_n_m, setpoint_filter)
