"""Logic of a drive on the field bus, as the motor side calls it, and the faults around it.

The logic - protocol, state machine and controller of the drive - is not part of the plant; it comes
from outside as an object with five calls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from sim_rig.drive_faults import POWER_STAGE_CODE, DriveFault, FaultSchedule

SAMPLE_NS = 1_000_000  # of the drive


class NodeFrame(NamedTuple):
    """Frame that the node sends, with the instant at which it is ready."""

    t_ns: int
    can_id: int
    data: bytes


class DriveReading(NamedTuple):
    """Sensors of a sample."""

    motor_angle_rad: float
    negative_switch: bool = False  # closed
    positive_switch: bool = False
    load_acceleration_rad_s2: float | None = None  # None without an accelerometer


class DriveLogic(Protocol):
    """Logic of a drive: frames and sensor readings in, frames and torque out."""

    def start(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Power on; return CAN-ID and data of the frames that are sent."""

    def frame(
        self, can_id: int, data: bytes, is_remote: bool, t_ns: int
    ) -> list[tuple[int, bytes]]:
        """Take a frame from the bus; return the frames that are sent because of it."""

    def sample(self, t_ns: int, reading: DriveReading) -> float:
        """Take the sensors of a sample; return the torque [N m] to hold until the next one."""

    def fail(self, code: int) -> None:
        """Take a fault of the power stage, with its error code (CiA 402)."""

    def time(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Return the frames that are due: heartbeats, emergencies, time-outs."""


class PoweredLogic:
    """Logic of a drive with its faults: resets, failures, encoder steps, silence."""

    def __init__(
        self, make_logic: Callable[[], DriveLogic], t_ns: int, faults: Sequence[DriveFault]
    ) -> None:
        """make_logic: makes the logic, powered on at t_ns and after each reset of the node."""
        self.frames: list[NodeFrame] = []  # not yet taken
        self._make_logic = make_logic
        self._logic = make_logic()
        self._faults = FaultSchedule(faults)
        self._keep(t_ns, self._logic.start(t_ns))

    @property
    def step_m(self) -> float:
        """Sum of the steps of the encoder so far, as travel."""
        return self._faults.step_m

    @property
    def step_rad(self) -> float:
        """Sum of the steps of the encoder so far, as angle of the motor."""
        return self._faults.step_rad

    def take(self, can_id: int, data: bytes, is_remote: bool, t_ns: int) -> None:
        """Give the logic a frame that arrived at t_ns, up to which the plant was advanced."""
        self._keep(t_ns, self._logic.frame(can_id, data, is_remote, t_ns))

    def begin_faults(self, t_ns: int, speed: float) -> None:
        """Let the faults of this sample begin; speed: of the load [m/s or rad/s]."""
        for fault in self._faults.due(t_ns, speed):
            if fault.kind == "node_reset":
                self._logic = self._make_logic()
                self._keep(t_ns, self._logic.start(t_ns))
            elif fault.kind == "drive_fault":
                self._logic.fail(POWER_STAGE_CODE)

    def sample(self, t_ns: int, reading: DriveReading) -> float:
        """Give the logic the sensors; return the torque [N m]."""
        torque_n_m = self._logic.sample(t_ns, reading)
        self._keep(t_ns, self._logic.time(t_ns))
        return torque_n_m

    def _keep(self, t_ns: int, frames: list[tuple[int, bytes]]) -> None:
        if self._faults.is_silent(t_ns):
            return
        self.frames += [NodeFrame(t_ns, can_id, data) for can_id, data in frames]
