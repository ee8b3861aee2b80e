"""Simulated Quattro robot: plate on four arms, moved by the servos of its joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from comms.messages import Position, Velocity
from sim_rig.quattro_geometry import JointAngles, PlatePose, joint_angles, nominal_legs, pose_of
from sim_rig.quattro_motion import QuattroMotion
from sim_rig.quattro_params import QuattroParams
from sim_rig.quattro_servo import SAMPLE_NS, SAMPLE_S, QuattroServos, encoder_angles
from sim_rig.robot import Velocities
from sim_rig.vectors import Vector

REST_SAMPLES = 50  # quiet ones before the robot is at rest
REST_CHANGE_RAD = 2e-6  # largest change of a joint over the quiet samples
REST_CHANGE_COUNTS = 2.0  # the same for a coarse encoder
REST_ERROR_RAD = 2e-5  # largest distance from the setpoint; a swinging load of 0.7 kg gives 1e-5
REST_ERROR_COUNTS = 4.0


class QuattroPlatform:
    """Platform on a Quattro: x right, y depth, z up, with its home at 0.

    Runge-Kutta steps of at most 1 ms, which end on the samples of the servos; a torque is held over
    a sample. At rest, nothing is computed: drives and dry friction hold the joints. A load that
    pulls with 1 N would move it by less than 0.02 mm; one that moves it further keeps it awake.
    """

    def __init__(
        self,
        params: QuattroParams,
        start_m: Position = (0.0, 0.0, 0.0),
        payload_kg: float = 0.0,
    ) -> None:
        """start_m: position at rest at the start, as the servos know it.

        payload_kg: load at the plate, known to the servos; its force may come from `carry` instead.
        Raises ValueError for a start out of reach.
        """
        self._params = params
        self._motion = QuattroMotion(params, payload_kg)
        start = self._plate_pose(start_m)
        self._servos = QuattroServos(params, payload_kg, start)
        nominal = nominal_legs(params)
        if nominal != self._motion.legs:
            start = pose_of(self._motion.legs, joint_angles(nominal, start), start)
        self._motion.pose = start
        self._torques_n_m = self._servos.holding_torques_n_m
        self._sampled_rad = self._quiet_rad = self.joints_rad
        self._rates_rad_s: JointAngles = (0.0, 0.0, 0.0, 0.0)
        self._quiet = REST_SAMPLES
        self._force_n: Callable[[Vector], Vector] | None = None

    @property
    def position_m(self) -> Position:
        """Actual position (x, y, z)."""
        x_m, y_m, z_m, _ = self._motion.pose
        return x_m, y_m, z_m - self._params.home_z_m

    @property
    def velocity_m_s(self) -> Velocity:
        """Actual velocity (x, y, z)."""
        vx_m_s, vy_m_s, vz_m_s, _ = self._motion.rates
        return vx_m_s, vy_m_s, vz_m_s

    @property
    def angle_rad(self) -> float:
        """Actual angle of the plate about z."""
        return self._motion.pose[3]

    @property
    def joints_rad(self) -> JointAngles:
        """Joint angles as the encoders read them now."""
        joints_rad = joint_angles(self._motion.legs, PlatePose(*self._motion.pose))
        return encoder_angles(joints_rad, self._params.count_rad)

    @property
    def joint_rates_rad_s(self) -> JointAngles:
        """Joint rates as the drives read them: encoder steps of the last sample over 1 ms."""
        return self._rates_rad_s

    @property
    def torques_n_m(self) -> JointAngles:
        """Motor torques at the joints during the last sample."""
        return self._torques_n_m

    @property
    def still(self) -> bool:
        """True if the robot is at rest and stays there until its setpoint changes."""
        return self._quiet >= REST_SAMPLES

    def set_setpoint(self, setpoint_m: Position) -> None:
        """Set the setpoints of the joints to a position, as steps at the present time.

        Inverse kinematics of the nominal geometry, plate angle 0. Raises ValueError out of reach.
        """
        if self._servos.set_position(self._plate_pose(setpoint_m)):
            self._quiet = 0

    def set_joint_setpoint(self, joints_rad: Sequence[float]) -> None:
        """Set the setpoints of the four joints, as steps at the present time.

        Raises ValueError for angles at which the forearms do not reach the plate.
        """
        if self._servos.set_joints(joints_rad):
            self._quiet = 0

    def carry(self, force_n: Callable[[Vector], Vector]) -> None:
        """Take the load: its force [N], weight included, linear in the acceleration [m/s2].

        It is evaluated at the start of each call of `advance`, and replaces the payload.
        """
        self._force_n = force_n

    def advance(self, t_ns: int, step_ns: int, steps: int) -> Velocities:
        """Integrate steps from t_ns; return the velocities along x, y and z, (2 steps + 1,).

        The first is at the start, then one at the middle and one at the end of each step. Raises
        ValueError for a step across a sample of the servos (whole milliseconds).
        """
        _check_step(t_ns, step_ns, steps)
        self._take_load()
        vx, vy, vz = ([velocity] for velocity in self.velocity_m_s)
        step_s = step_ns * 1e-9
        for _ in range(steps):
            if t_ns % SAMPLE_NS == 0 and not self.still:
                self._sample()
            middle = (0.0, 0.0, 0.0)
            if not self.still:
                middle = self._motion.advance(self._torques_n_m, step_s)
            for velocities, half, end in zip((vx, vy, vz), middle, self.velocity_m_s, strict=True):
                velocities.append(half)
                velocities.append(end)
            t_ns += step_ns
        return vx, vy, vz

    def _sample(self) -> None:
        """Read the encoders and set the torques, or come to rest after quiet samples."""
        joints_rad = self.joints_rad
        pairs = zip(joints_rad, self._sampled_rad, strict=True)
        r0, r1, r2, r3 = ((new - old) / SAMPLE_S for new, old in pairs)
        self._sampled_rad, self._rates_rad_s = joints_rad, (r0, r1, r2, r3)
        self._quiet = self._quiet + 1 if self._is_quiet() else 0
        if self.still:
            self._motion.rates = (0.0, 0.0, 0.0, 0.0)
            self._rates_rad_s = (0.0, 0.0, 0.0, 0.0)
        else:
            self._torques_n_m = self._servos.torques(joints_rad, self._rates_rad_s)

    def _is_quiet(self) -> bool:
        """Check that references rest at their setpoints, and joints near the first quiet reading.

        The mean speed that is lost on coming to rest is below 0.05 mm/s by default.
        """
        joints_rad = self._sampled_rad
        if self._quiet == 0:
            self._quiet_rad = joints_rad
        count_rad = self._params.count_rad
        changes = zip(joints_rad, self._quiet_rad, strict=True)
        change_rad = max(abs(q - first) for q, first in changes)
        error_rad = self._servos.setpoint_error_rad(joints_rad)
        return (
            self._servos.settled
            and change_rad <= max(REST_CHANGE_RAD, REST_CHANGE_COUNTS * count_rad)
            and error_rad <= max(REST_ERROR_RAD, REST_ERROR_COUNTS * count_rad)
        )

    def _take_load(self) -> None:
        """Pass the force of the load and its apparent masses to the equations of motion."""
        if self._force_n is None or self.still:
            return
        at_rest_n = self._force_n((0.0, 0.0, 0.0))
        along_x_n = self._force_n((1.0, 0.0, 0.0))
        along_y_n = self._force_n((0.0, 1.0, 0.0))
        along_z_n = self._force_n((0.0, 0.0, 1.0))
        masses_kg = (
            at_rest_n[0] - along_x_n[0],
            at_rest_n[0] - along_y_n[0],
            at_rest_n[0] - along_z_n[0],
            at_rest_n[1] - along_y_n[1],
            at_rest_n[1] - along_z_n[1],
            at_rest_n[2] - along_z_n[2],
        )
        self._motion.set_load(at_rest_n, masses_kg)

    def _plate_pose(self, position_m: Position) -> PlatePose:
        """Compute the nominal pose of a platform position."""
        x_m, y_m, z_m = position_m
        return PlatePose(x_m, y_m, z_m + self._params.home_z_m, 0.0)


def _check_step(t_ns: int, step_ns: int, steps: int) -> None:
    """Check that each step ends at or before the next sample of the servos."""
    left_ns = SAMPLE_NS - t_ns % SAMPLE_NS
    if not 0 < step_ns <= left_ns or (steps > 1 and SAMPLE_NS % step_ns):
        raise ValueError(
            f"step_ns = {step_ns} at t_ns = {t_ns}; must be > 0 and <= {left_ns} ns, to the next "
            "sample of the servos: divide the step"
        )
