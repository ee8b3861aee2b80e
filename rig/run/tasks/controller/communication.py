"""The communication task: takes the newest reference, knows how old it is, and words the robot's state."""

from __future__ import annotations

from comms.messages import JointState, Phase, Position, Reference, RobotState
from comms.task import Send


class Communication:
    """What came in last, and what goes out about the robot."""

    def __init__(self) -> None:
        self.reference: Reference | None = None
        self.reference_ns = 0  # arrival
        self.joints: JointState | None = None
        self.joints_ns = 0
        self._seq = 0

    def take_reference(self, reference: Reference, t_ns: int) -> None:
        """Keep it when it is for a later instant than the one held."""
        self.reference_ns = t_ns
        if self.reference is None or reference.t_target_ns > self.reference.t_target_ns:
            self.reference = reference

    def take_joints(self, joints: JointState, t_ns: int) -> None:
        """Keep what the encoders read."""
        self.joints, self.joints_ns = joints, t_ns

    def state(self, commanded_m: Position, phase: Phase, t_ns: int) -> tuple[Send, ...]:
        """The robot's state for the streamer and for the vision task; nothing while the robot is unknown."""
        if self.joints is None:
            return ()
        state = RobotState(
            seq=self._seq,
            t_ns=t_ns,
            t_actual_ns=self.joints.t_ns,
            commanded_m=commanded_m,
            actual_m=self.joints.position_m,
            actual_velocity_m_s=self.joints.velocity_m_s,
            phase=phase,
        )
        self._seq += 1
        return (Send("robot_state", state, t_ns), Send("platform", state, t_ns))
