"""Drive on the field bus, motor side: a ball-screw axis moved by the torque of a drive logic.

The logic - protocol, state machine and controller of the drive - is not part of the plant; it comes
from outside as an object with four calls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from comms.messages import Position, Velocity
from sim_rig.ball_screw_axis import AxisReading, BallScrewAxis
from sim_rig.ball_screw_params import BallScrewParams
from sim_rig.drive_faults import POWER_STAGE_CODE, DriveFault, FaultSchedule

SAMPLE_NS = 1_000_000  # of the drive


class NodeFrame(NamedTuple):
    """Frame that the node sends, with the instant at which it is ready."""

    t_ns: int
    can_id: int
    data: bytes


class DriveLogic(Protocol):
    """Logic of a drive: frames and sensor readings in, frames and torque out."""

    def start(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Power on; return CAN-ID and data of the frames that are sent."""

    def frame(
        self, can_id: int, data: bytes, is_remote: bool, t_ns: int
    ) -> list[tuple[int, bytes]]:
        """Take a frame from the bus; return the frames that are sent because of it."""

    def sample(self, t_ns: int, reading: AxisReading) -> float:
        """Take the sensors of a sample; return the torque [N m] to hold until the next one."""

    def fail(self, code: int) -> None:
        """Take a fault of the power stage, with its error code (CiA 402)."""

    def time(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Return the frames that are due: heartbeats, emergencies, time-outs."""


class ScrewPlatform:
    """Platform along X on a ball-screw axis; y and z stand at home."""

    def __init__(
        self,
        params: BallScrewParams,
        make_logic: Callable[[], DriveLogic],
        home_m: Position,
        t_ns: int,
        faults: Sequence[DriveFault] = (),
    ) -> None:
        """make_logic: makes the logic, powered on at t_ns and after each reset of the node."""
        self.frames: list[NodeFrame] = []  # not yet taken
        self._pull_n: Callable[[float], float] | None = None
        self._axis = BallScrewAxis(params, measures_error=False)
        self._make_logic = make_logic
        self._logic = make_logic()
        self._faults = FaultSchedule(faults)
        self._tau_m_rad = params.tau_m_rad
        self._home_m = home_m
        self._torque_n_m = 0.0
        self._truth = self._axis.truth()
        self._keep(t_ns, self._logic.start(t_ns))
        self._sample(t_ns)

    @property
    def position_m(self) -> Position:
        """Actual position (x, y, z)."""
        x, y, z = self._home_m
        return x + self._truth.position_m, y, z

    @property
    def velocity_m_s(self) -> Velocity:
        """Actual velocity (x, y, z)."""
        return self._truth.velocity_m_s, 0.0, 0.0

    @property
    def still(self) -> bool:
        """False: the drive is sampled at rest, too."""
        return False

    def set_setpoint(self, setpoint_m: Position) -> None:
        """Do nothing: the drive takes its setpoints from the bus."""

    def carry(self, pull_n: Callable[[float], float]) -> None:
        """Take the load: its force on the table [N], of the acceleration of the table [m/s^2]."""
        self._pull_n = pull_n

    def take(self, can_id: int, data: bytes, is_remote: bool, t_ns: int) -> None:
        """Give the logic a frame that arrived at t_ns, up to which the bench was advanced."""
        self._keep(t_ns, self._logic.frame(can_id, data, is_remote, t_ns))

    def advance(self, t_ns: int, step_ns: int, steps: int) -> tuple[list[float], list[float]]:
        """Integrate steps from t_ns; return the velocities along x and z [m/s], (2 steps + 1,).

        The drive is sampled at the end of each whole millisecond.
        """
        step_s = step_ns * 1e-9
        force_n = 0.0
        velocities = [self._truth.velocity_m_s]
        for _ in range(steps):
            if self._pull_n is not None:
                force_n = self._pull_n(self._truth.acceleration_m_s2)
            before = self._truth
            self._axis.advance(self._torque_n_m, step_s, force_n)
            self._truth = self._axis.truth()
            # the swing, at 1 Hz, does not see how the speed changes within a millisecond
            velocities += (
                (before.velocity_m_s + self._truth.velocity_m_s) / 2,
                self._truth.velocity_m_s,
            )
            t_ns += step_ns
            if t_ns % SAMPLE_NS == 0:
                self._sample(t_ns)
        return velocities, [0.0] * len(velocities)

    def _sample(self, t_ns: int) -> None:
        for fault in self._faults.due(t_ns, self._truth.velocity_m_s):
            if fault.kind == "node_reset":
                self._logic = self._make_logic()
                self._keep(t_ns, self._logic.start(t_ns))
            elif fault.kind == "drive_fault":
                self._logic.fail(POWER_STAGE_CODE)
        reading = self._axis.read()
        if self._faults.step_m:
            angle_rad = reading.motor_angle_rad + self._faults.step_m / self._tau_m_rad
            reading = reading._replace(motor_angle_rad=angle_rad)
        self._torque_n_m = self._logic.sample(t_ns, reading)
        self._keep(t_ns, self._logic.time(t_ns))

    def _keep(self, t_ns: int, frames: list[tuple[int, bytes]]) -> None:
        if self._faults.is_silent(t_ns):
            return
        self.frames += [NodeFrame(t_ns, can_id, data) for can_id, data in frames]
