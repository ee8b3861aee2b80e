"""Robot as the operator sees it: phase of the controller and reading of the encoders."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any

from comms.channels import MS
from comms.messages import CanMessage, Phase, Reply, RobotState
from rig.run.tasks.drive.settings import DriveSettings
from rig.run.tasks.drive.start_up import TPDO_MOTION
from rig.run.tasks.operator import Operator, Stage

REST_SPEED_M_S = 0.002
REST_ERROR_M = 0.001  # encoders to setpoint
REST_SPEED_RAD_S = 1.0  # of the motor of a joint; a step of its encoder within 1 ms: 0.8 rad/s
ENCODER_AGE_NS = 100 * MS
STOP_PHASES = (Phase.STOPPED, Phase.FAULT)


class RobotWatch:
    """Newest phase of the controller, from its replies and states, and newest robot state."""

    phase_of = "controller"  # task whose phase counts

    def __init__(self, operator: Operator) -> None:
        self._operator = operator
        self._phase: Phase | None = None
        self._phase_ns = -1  # time stamp of the message that carried the phase
        self._state: RobotState | None = None

    def take_reply(self, reply: Reply) -> None:
        """Take the phase of a reply of the controller."""
        if reply.sender == self.phase_of:
            self._take_phase(reply.phase, reply.t_ns)

    def take_state(self, state: RobotState) -> None:
        """Take a robot state; an older one than the newest is left out."""
        self._take_phase(state.phase, state.t_ns)
        if self._state is None or state.t_ns > self._state.t_ns:
            self._state = state

    def take_frame(self, frame: CanMessage) -> None:
        """Take a frame of the field bus, which a controller reads already."""

    def status(self) -> dict[str, Any]:
        """Describe the robot for `rig stop`: stage, phase, speed and if it is stopped at rest."""
        return {
            "stage": self._operator.stage.value,
            "phase": self._phase and self._phase.value,
            **self._speed(),
            "at_rest": self._is_stopped() and self._is_standing(),
        }

    def _speed(self) -> dict[str, float | None]:
        state = self._state
        return {"speed_m_s": None if state is None else math.hypot(*state.actual_velocity_m_s)}

    def _take_phase(self, phase: Phase, t_ns: int) -> None:
        if t_ns >= self._phase_ns:
            self._phase, self._phase_ns = phase, t_ns

    def _is_stopped(self) -> bool:
        """Tell if the controller has stopped, or was never started in a run that is closed."""
        return self._phase in STOP_PHASES or self._is_closed_unstarted()

    def _is_standing(self) -> bool:
        """Tell if the encoders show rest, by a reading of the time after the stop."""
        state = self._state
        if state is None:
            return self._is_closed_unstarted()
        is_newer = state.t_ns >= self._phase_ns or self._operator.stage is Stage.CLOSED
        is_fresh = state.t_ns - state.t_actual_ns <= ENCODER_AGE_NS
        speed_m_s = math.hypot(*state.actual_velocity_m_s)
        error_m = math.dist(state.commanded_m, state.actual_m)
        is_slow = speed_m_s <= REST_SPEED_M_S and error_m <= REST_ERROR_M
        return is_newer and is_fresh and is_slow

    def _is_closed_unstarted(self) -> bool:
        return self._operator.stage is Stage.CLOSED and self._operator.t_start_ns is None


class JointWatch(RobotWatch):
    """The same of an elastic joint, which has no controller before its drive."""

    phase_of = "drive"

    def __init__(self, operator: Operator, drive: DriveSettings) -> None:
        super().__init__(operator)
        self._drive = drive
        self._motor_rad_s: float | None = None
        self._motor_ns = -1  # time stamp of the newest speed

    def take_frame(self, frame: CanMessage) -> None:
        """Take the speed of the motor from its PDO."""
        if frame.can_id == TPDO_MOTION + self._drive.node_id and len(frame.data) == 8:
            _, velocity = struct.unpack("<ii", frame.data)
            self._motor_rad_s = velocity / self._drive.velocity_units_per_unit_s
            self._motor_ns = frame.t_ns

    def _speed(self) -> dict[str, float | None]:
        return {"speed_rad_s": self._motor_rad_s}

    def _is_standing(self) -> bool:
        if self._motor_rad_s is None:
            return self._is_closed_unstarted()
        is_newer = self._motor_ns >= self._phase_ns or self._operator.stage is Stage.CLOSED
        return is_newer and abs(self._motor_rad_s) <= REST_SPEED_RAD_S


def robot_watch(settings: Mapping[str, Any], operator: Operator) -> RobotWatch:
    """Make the watch of a run from the settings of its tasks."""
    if "controller" not in settings and "drive" in settings:
        return JointWatch(operator, settings["drive"])
    return RobotWatch(operator)
