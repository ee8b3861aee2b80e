"""Communication of the controller: newest reference and its age, and the robot state it sends."""

from __future__ import annotations

from comms.messages import Phase, Position, Reference, RobotState
from comms.task import Send
from rig.run.tasks.controller.joints import PlatformState


class Communication:
    """Newest reference and platform state with their arrival, and the robot state made of them."""

    def __init__(self, cameras: int) -> None:
        """cameras: number of vision tasks in the run."""
        self._channels = ("robot_state", *(f"platform_{k + 1}" for k in range(cameras)))
        self.reference: Reference | None = None
        self.reference_ns = 0  # arrival
        self.platform: PlatformState | None = None
        self.platform_ns = 0  # arrival
        self._seq = 0

    def take_reference(self, reference: Reference, t_ns: int) -> None:
        """Keep a reference whose target lies later than that of the one kept."""
        self.reference_ns = t_ns
        if self.reference is None or reference.t_target_ns > self.reference.t_target_ns:
            self.reference = reference

    def take_platform(self, platform: PlatformState, t_ns: int) -> None:
        """Keep the motion that the encoders measured."""
        self.platform = platform
        self.platform_ns = t_ns

    def state(self, commanded_m: Position, phase: Phase, t_ns: int) -> tuple[Send, ...]:
        """Send the robot state to streamer and vision tasks, after the first measurement."""
        if self.platform is None:
            return ()
        state = RobotState(
            seq=self._seq,
            t_ns=t_ns,
            t_actual_ns=self.platform.t_ns,
            commanded_m=commanded_m,
            actual_m=self.platform.position_m,
            actual_velocity_m_s=self.platform.velocity_m_s,
            phase=phase,
        )
        self._seq += 1
        return tuple(Send(channel, state, t_ns) for channel in self._channels)
