"""Port of the Quattro: setpoints and encoder readings are angles of its four joints."""

from __future__ import annotations

from comms.messages import (
    JointState,
    JointValues,
    Position,
    Setpoint,
    Space,
    joint_state,
)
from comms.replies import Replies
from sim_rig.bench import Bench, SimulatedPlant
from sim_rig.params import BenchParams
from sim_rig.quattro import QuattroPlatform
from sim_rig.quattro_geometry import PlatePose, nominal_legs, pose_of
from sim_rig.quattro_params import QuattroParams
from sim_rig.setpoint_port import SetpointPort

JOINTS = 4


class QuattroPort(SetpointPort):
    """Setpoint port, and maker of the plant behind it.

    Its check of the envelope takes the position from the nominal geometry, as the robot knows it.
    """

    expected = f"{JOINTS} joints in rad"

    def __init__(self, params: BenchParams, quattro: QuattroParams, replies: Replies) -> None:
        super().__init__(params, replies)
        self._params = params
        self._quattro = quattro
        self._legs = nominal_legs(quattro)
        x_m, y_m, z_m = params.start_m
        self._pose = PlatePose(x_m, y_m, z_m + quattro.home_z_m, 0.0)  # of the newest setpoint
        self._place_m: Position = params.start_m
        self._platform: QuattroPlatform | None = None
        self._joints_rad = self._rates_rad_s = (0.0,) * JOINTS  # newest reading
        self._was_still = False  # at that reading

    def make_bench(self, t_ns: int) -> Bench:
        """Make the plant at t_ns."""
        self._was_still = False
        self._platform = QuattroPlatform(self._quattro, self._params.start_m)
        return Bench(self._params, t_ns, self._platform)

    def _position_m(self, setpoint: Setpoint) -> Position | None:
        if setpoint.space is not Space.RADIANS or setpoint.count != JOINTS:
            return None
        if setpoint.values == self._setpoint:
            return self._place_m
        self._pose = pose = pose_of(self._legs, setpoint.values[:JOINTS], self._pose)
        self._place_m = pose.x_m, pose.y_m, pose.z_m - self._quattro.home_z_m
        return self._place_m

    def _give(self, values: JointValues, bench: SimulatedPlant) -> None:
        if self._platform is not None:
            self._platform.set_joint_setpoint(values[:JOINTS])

    def _measured(self, t_ns: int, bench: SimulatedPlant) -> JointState:
        platform = self._platform
        if platform is not None and not (platform.still and self._was_still):
            self._joints_rad, self._rates_rad_s = platform.joints_rad, platform.joint_rates_rad_s
            self._was_still = platform.still
        self._seq += 1
        return joint_state(self._seq - 1, t_ns, self._joints_rad, self._rates_rad_s)
