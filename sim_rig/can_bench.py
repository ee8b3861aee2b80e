"""Bench whose robot is a node on the field bus: its port, and the plant behind it."""

from __future__ import annotations

from collections.abc import Callable

from comms.channels import MS
from comms.messages import CanMessage, Message, Phase
from comms.task import Send
from sim_rig.ball_screw_params import BallScrewParams
from sim_rig.bench import Bench, SimulatedPlant
from sim_rig.can_drive import ScrewPlatform
from sim_rig.drive_logic import SAMPLE_NS, DriveLogic, PoweredLogic
from sim_rig.joint_bench import JointBench
from sim_rig.params import BenchParams

TICK_NS = 5 * MS  # heartbeats and emergencies of the node leave on this grid


class CanBench:
    """Port of the node (frames in, frames out), and maker of the plant behind it.

    The phase is that of a plant, which runs from its start.
    """

    takes_effect_at_once = True  # a frame reaches the node at its arrival

    def __init__(self, params: BenchParams, make_logic: Callable[[], DriveLogic]) -> None:
        """make_logic: makes the logic of the drive; called at each start."""
        self.phase = Phase.RUNNING
        self.late = 0
        self._params = params
        self._make_logic = make_logic
        self._drive: PoweredLogic | None = None
        self._tick_ns = 0
        self._seq = 0

    def make_bench(self, t_ns: int) -> SimulatedPlant:
        """Make the plant, powered on at t_ns."""
        p = self._params
        if p.joint is not None:
            joint = JointBench(p.joint, p.seed, self._make_logic, t_ns, p.drive_faults)
            self._drive = joint.drive
            return joint
        axis = p.axis or BallScrewParams()
        platform = ScrewPlatform(axis, self._make_logic, p.home_m, t_ns, p.drive_faults)
        self._drive = platform.drive
        return Bench(p, t_ns, platform)

    def begin(self, t_ns: int) -> None:
        """Start the grid."""
        self._tick_ns = t_ns + -t_ns % TICK_NS

    def next_ns(self) -> int:
        """Return the next instant of the grid."""
        return self._tick_ns

    def wake_ns(self) -> int:
        """Return the next instant of the grid."""
        return self._tick_ns

    def read(self, t_ns: int, bench: SimulatedPlant) -> None:
        """Do nothing: the node reads its sensors itself."""

    def apply(self, t_ns: int, bench: SimulatedPlant) -> list[Send]:
        """Advance the grid."""
        if t_ns == self._tick_ns:
            self._tick_ns += TICK_NS
        return []

    def take(self, message: Message, t_ns: int, bench: SimulatedPlant) -> list[Send]:
        """Give the node a frame, after the samples before it; the answer leaves at once."""
        if not isinstance(message, CanMessage) or message.is_extended or self._drive is None:
            return []
        sampled_ns = min(t_ns - t_ns % SAMPLE_NS, self._tick_ns)  # no further than the task is
        bench.advance(max(sampled_ns, bench.t_ns))
        self._drive.take(message.can_id, message.data, message.is_remote, t_ns)
        return self.flush(t_ns)

    def flush(self, t_ns: int) -> list[Send]:
        """Send what the node has sent since the last call."""
        if self._drive is None:
            return []
        frames, self._drive.frames = self._drive.frames, []
        sends = []
        for frame in frames:
            message = CanMessage(
                seq=self._seq,
                t_ns=frame.t_ns,
                can_id=frame.can_id,
                is_extended=False,
                is_remote=False,
                length=len(frame.data),
                data=frame.data,
            )
            self._seq += 1
            sends.append(Send("can_up", message, t_ns))
        return sends
