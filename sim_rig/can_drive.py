"""Drive on the field bus, motor side: a ball-screw axis moved by the torque of a drive logic."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from comms.messages import Position, Velocity
from sim_rig.ball_screw_axis import BallScrewAxis
from sim_rig.ball_screw_params import BallScrewParams
from sim_rig.drive_faults import DriveFault
from sim_rig.drive_logic import SAMPLE_NS, DriveLogic, DriveReading, PoweredLogic
from sim_rig.robot import Velocities
from sim_rig.vectors import Vector


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
        self._load_n: Callable[[Vector], Vector] | None = None
        self._axis = BallScrewAxis(params, measures_error=False)
        self._drive = PoweredLogic(make_logic, t_ns, faults)
        self._tau_m_rad = params.tau_m_rad
        self._home_m = home_m
        self._torque_n_m = 0.0
        self._truth = self._axis.truth()
        self._sample(t_ns)

    @property
    def drive(self) -> PoweredLogic:
        """Drive with its frames."""
        return self._drive

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

    def carry(self, force_n: Callable[[Vector], Vector]) -> None:
        """Take the load: its force on the table [N], of the acceleration of the table [m/s^2]."""
        self._load_n = force_n

    def advance(self, t_ns: int, step_ns: int, steps: int) -> Velocities:
        """Integrate steps from t_ns; return the velocities along x, y, z [m/s], (2 steps + 1,).

        The drive is sampled at the end of each whole millisecond.
        """
        step_s = step_ns * 1e-9
        force_n = 0.0
        velocities = [self._truth.velocity_m_s]
        for _ in range(steps):
            if self._load_n is not None:
                force_n = self._load_n((self._truth.acceleration_m_s2, 0.0, 0.0))[0]
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
        still = [0.0] * len(velocities)
        return velocities, still, still

    def _sample(self, t_ns: int) -> None:
        drive = self._drive
        drive.begin_faults(t_ns, self._truth.velocity_m_s)
        reading = self._axis.read()
        sensors = DriveReading(
            reading.motor_angle_rad + drive.step_m / self._tau_m_rad + drive.step_rad,
            reading.negative_switch,
            reading.positive_switch,
        )
        self._torque_n_m = drive.sample(t_ns, sensors)
