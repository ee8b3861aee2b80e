"""Interconnection of blocks by signal name."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from planners.trajectories.pieces import ComplexArray
from rig.drives.servo.loops import LoopAnalysis, analyse_loop, continuous_equivalents
from rig.drives.servo.two_mass import TwoMass

SETPOINT = ["setpoint_angle", "setpoint_speed", "setpoint_acceleration"]
TORQUES = ["motor_torque", "load_torque"]  # disturbances, at the motor side of the gear
STATES = ["motor_angle", "motor_speed", "load_angle", "load_speed"]
CANCELLED_REL = 1e-7  # a mode less controllable from the setpoint (1 = fully) is cancelled


class ControlLoop(NamedTuple):
    """Opened and closed form of one loop, control.StateSpace, continuous or sampled.

    opened is the loop transfer function L = P C at the plant input, with negative feedback; closed
    goes from setpoint and disturbances to the joint, and keeps modes that a notch cancels. setpoint
    and output name its main channel.
    """

    opened: Any
    closed: Any
    setpoint: str
    output: str

    @property
    def analysis(self) -> LoopAnalysis:
        """Analysis of the loop: margins at the plant input, condition number.

        Poles of the closed loop, cancelled ones too; zeros of the main channel.
        """
        return analyse_loop(self.opened, self.closed[self.output, self.setpoint])

    @property
    def controllable_poles_1_s(self) -> ComplexArray:
        """Poles that are controllable from the setpoint."""
        return self._poles(cancelled=False)

    @property
    def cancelled_poles_1_s(self) -> ComplexArray:
        """Poles that a notch cancels.

        Not controllable from the setpoint, but excited by a disturbance (PBH test).
        """
        return self._poles(cancelled=True)

    def _poles(self, *, cancelled: bool) -> ComplexArray:
        from scipy.linalg import matrix_balance

        column = self.closed.find_input(self.setpoint)
        balanced, scale = matrix_balance(self.closed.A, permute=False)
        input_column = self.closed.B[:, column] / np.diag(scale)
        eigenvalues, left = np.linalg.eig(balanced.T)
        measure = np.abs(left.T @ input_column) / np.linalg.norm(input_column)
        kept = np.asarray(eigenvalues[(measure < CANCELLED_REL) == cancelled], dtype=np.complex128)
        return continuous_equivalents(kept, self.closed.dt)


def position_loop(joint: TwoMass, controller: list[Any], period_s: float = 0.0) -> ControlLoop:
    """Close a position loop around the joint.

    The blocks of the controller go from setpoint_angle, setpoint_speed, setpoint_acceleration and
    motor_angle or motor_speed to drive_torque. With a sample time: sampled blocks around a joint
    whose torque is held.
    """
    import control

    blocks = [*controller, plant(joint, period_s)]
    closed = interconnect([*blocks, input_disturbance()], [*SETPOINT, *TORQUES], STATES)
    forward = interconnect(blocks, [*SETPOINT, "torque"], ["drive_torque"])
    return ControlLoop(
        -control.ss(forward["drive_torque", "torque"]), closed, "setpoint_angle", "motor_angle"
    )


def plant(joint: TwoMass, period_s: float = 0.0) -> Any:
    """Name the signals of joint.plant for a loop.

    Inputs torque and load_torque; with a sample time both are held.
    """
    import control

    system = joint.plant
    if period_s:
        system = control.sample_system(system, period_s, method="zoh")
    return control.ss(system, inputs=["torque", "load_torque"], outputs=STATES)


def rename(system: Any | None, source: str, target: str) -> Any:
    """Name input and output of a block; None is a gain of 1."""
    import control

    if system is None:
        system = control.ss([], [], [], [[1.0]])
    return control.ss(system, inputs=source, outputs=target)


def input_disturbance() -> Any:
    """Add a disturbance torque on the motor to the torque of the drive."""
    import control

    return control.summing_junction(["drive_torque", "motor_torque"], "torque")


def interconnect(blocks: list[Any], inputs: list[str], outputs: list[str]) -> Any:
    """Interconnect blocks by signal name (control.StateSpace)."""
    import control

    system = control.interconnect(blocks, inputs=inputs, outputs=outputs, check_unused=False)
    return control.ss(system, inputs=inputs, outputs=outputs)
