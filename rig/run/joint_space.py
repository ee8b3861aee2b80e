"""Check of a plan in the joints of the robot, before a run: reach, joint limits and joint speed."""

from __future__ import annotations

from comms.plan_record import PlanRecord
from planners.errors import PlanError
from planners.kinematics.placement import WorkspacePlacement
from planners.kinematics.quattro import QuattroPose
from rig.errors import ConfigError, Refused
from rig.run.controller_section import RobotSection
from rig.run.tasks.controller.joints import RobotSettings


def check_joint_space(record: PlanRecord, robot: RobotSettings, section: RobotSection) -> None:
    """Raise Refused naming place, instant and reason of the first sample that the robot cannot do.

    Kinematics of the controller: belief. A robot of axes has no joints of its own.
    """
    if robot.kinematics != "quattro":
        return
    try:
        placement = WorkspacePlacement(home=QuattroPose(0.0, 0.0, robot.home_z_m, 0.0))
    except PlanError as error:
        raise ConfigError(f"[robot] home_z_m = {robot.home_z_m:g}: {error}") from error
    period_s = record.period_ns * 1e-9
    before = None
    for k, position in enumerate(record.positions_m):
        at_s = k * period_s - record.quiet_s
        where = f"at ({position[0]:.3f}, {position[1]:.3f}, {position[2]:.3f}) m, {at_s:.2f} s into"
        try:
            joints = placement.joints_of(position)
        except PlanError as error:
            raise Refused(f"the robot cannot follow the plan {where} the move: {error}") from error
        if before is not None:
            fastest = max(abs(a - b) for a, b in zip(joints, before, strict=True)) / period_s
            if fastest > section.joint_speed_rad_s:
                raise Refused(
                    f"the robot cannot follow the plan {where} the move: a joint turns at "
                    f"{fastest:.3g} rad/s; must be <= {section.joint_speed_rad_s:g} rad/s "
                    "([robot] joint_speed_rad_s): give the move more time"
                )
        before = joints
