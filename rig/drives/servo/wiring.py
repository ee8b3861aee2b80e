"""Loops of named blocks: what bears the same name is connected."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from planners.trajectories.pieces import ComplexArray
from rig.drives.servo.loops import LoopAnalysis, analyse_loop, continuous_equivalents
from rig.drives.servo.two_mass import TwoMass

SETPOINT = ["setpoint_angle", "setpoint_speed", "setpoint_acceleration"]
TORQUES = [
    "motor_torque",
    "load_torque",
]  # disturbances of every loop, at the motor's side of the gear
STATES = ["motor_angle", "motor_speed", "load_angle", "load_speed"]
CANCELLED_REL = 1e-7  # a mode that the setpoint reaches less than this (1 = fully) is cancelled


class ControlLoop(NamedTuple):
    """opened at the plant's input, L = P C with negative feedback; closed from setpoint and disturbances to the joint.

    control.StateSpace both, continuous or sampled. closed keeps modes that a notch cancels. setpoint and output name its
    main channel.
    """

    opened: Any
    closed: Any
    setpoint: str
    output: str

    @property
    def analysis(self) -> LoopAnalysis:
        """Poles (hidden ones too), zeros of the main channel, margins at the plant's input, condition of the eigenvectors."""
        return analyse_loop(self.opened, self.closed[self.output, self.setpoint])

    @property
    def controllable_poles_1_s(self) -> ComplexArray:
        """Those that the setpoint reaches."""
        return self._poles(hidden=False)

    @property
    def cancelled_poles_1_s(self) -> ComplexArray:
        """Those that a notch cancels: the setpoint never moves them, a disturbance does (Popov-Belevitch-Hautus test)."""
        return self._poles(hidden=True)

    def _poles(self, *, hidden: bool) -> ComplexArray:
        from scipy.linalg import matrix_balance

        column = self.closed.find_input(self.setpoint)
        balanced, scale = matrix_balance(self.closed.A, permute=False)
        push = self.closed.B[:, column] / np.diag(scale)
        found, left = np.linalg.eig(balanced.T)
        reach = np.abs(left.T @ push) / np.linalg.norm(push)
        kept = np.asarray(found[(reach < CANCELLED_REL) == hidden], dtype=np.complex128)
        return continuous_equivalents(kept, self.closed.dt)


def position_loop(joint: TwoMass, controller: list[Any], period_s: float = 0.0) -> ControlLoop:
    """Blocks from setpoint_angle, setpoint_speed, setpoint_acceleration and motor_angle or motor_speed to drive_torque, around
    the joint; with a sample time, sampled blocks around a joint whose torque is held.
    """
    import control

    blocks = [*controller, plant(joint, period_s)]
    closed = interconnect([*blocks, input_disturbance()], [*SETPOINT, *TORQUES], STATES)
    forward = interconnect(blocks, [*SETPOINT, "torque"], ["drive_torque"])
    return ControlLoop(
        -control.ss(forward["drive_torque", "torque"]), closed, "setpoint_angle", "motor_angle"
    )


def plant(joint: TwoMass, period_s: float = 0.0) -> Any:
    """joint.plant from torque and load_torque; with a sample time, both held for it."""
    import control

    plant = control.sample_system(joint.plant, period_s, method="zoh") if period_s else joint.plant
    return control.ss(plant, inputs=["torque", "load_torque"], outputs=STATES)


def rename(system: Any | None, source: str, target: str) -> Any:
    """The block under its names; without one what comes goes through."""
    import control

    passing = control.ss([], [], [], [[1.0]])
    return control.ss(passing if system is None else system, inputs=source, outputs=target)


def input_disturbance() -> Any:
    """The drive's torque and a disturbance of the motor, in one."""
    import control

    return control.summing_junction(["drive_torque", "motor_torque"], "torque")


def interconnect(blocks: list[Any], inputs: list[str], outputs: list[str]) -> Any:
    """Connect what bears the same name (control.StateSpace)."""
    import control

    whole = control.interconnect(blocks, inputs=inputs, outputs=outputs, check_unused=False)
    return control.ss(whole, inputs=inputs, outputs=outputs)
