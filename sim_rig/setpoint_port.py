"""Port of a robot that takes setpoints: they are checked, queued, and sampled by its drives."""

from __future__ import annotations

from collections import deque

from comms.channels import MS
from comms.messages import (
    JointState,
    JointValues,
    Message,
    Phase,
    Position,
    Setpoint,
    axis_state,
)
from comms.replies import Replies
from comms.task import Send
from sim_rig.bench import SimulatedPlant
from sim_rig.input_check import InputCheck
from sim_rig.params import BenchParams

# sample time of the digital drives; the arrival time of a setpoint within it has no effect
DRIVE_SAMPLE_NS = 1 * MS
TICK_NS = 5 * MS  # encoders are read on this grid of the run clock
NEVER_NS = 2**63
FAULT_CODE = 5  # exit code of a run in which the robot stopped by itself


class SetpointPort:
    """Setpoints in, encoder readings out; stops by itself at a setpoint outside the bounds."""

    expected = "x, y, z in m"
    takes_effect_at_once = False  # it is queued until the next sample of the drives

    def __init__(self, params: BenchParams, replies: Replies) -> None:
        self.phase = Phase.IDLE
        self.late = 0
        self._replies = replies
        self._check = InputCheck(params.input, params.start_m) if params.input else None
        self._tick_ns = 0
        # (effective from [ns], values of the joints): arrived, not yet sampled by the drives
        self._setpoints: deque[tuple[int, JointValues]] = deque()
        self._setpoint: JointValues | None = None
        self._seq = 0
        self._reading: JointState | None = None

    def begin(self, t_ns: int) -> None:
        """Start the grid of the readings."""
        self._tick_ns = t_ns + -t_ns % TICK_NS

    def next_ns(self) -> int:
        """Return the next instant of a reading or of a setpoint."""
        return min(self._tick_ns, self._setpoints[0][0] if self._setpoints else NEVER_NS)

    def wake_ns(self) -> int:
        """Return the instant of the next reading; setpoints are served then, too."""
        return self._tick_ns

    def read(self, t_ns: int, bench: SimulatedPlant) -> None:
        """Read the encoders where that is due."""
        if t_ns == self._tick_ns:
            self.late += self._reading is not None
            self._reading = self._measured(t_ns, bench)
            self._tick_ns += TICK_NS

    def apply(self, t_ns: int, bench: SimulatedPlant) -> list[Send]:
        """Give the drives the setpoint that they sample now."""
        while self._setpoints and self._setpoints[0][0] == t_ns:
            self._give(self._setpoints.popleft()[1], bench)
        return []

    def take(self, message: Message, t_ns: int, bench: SimulatedPlant) -> list[Send]:
        """Queue a setpoint; stop at the one before where it is outside the bounds."""
        if not isinstance(message, Setpoint) or self.phase is Phase.FAULT:
            return []
        self.phase = Phase.RUNNING
        try:
            position_m = self._position_m(message)
        except ValueError as error:
            return self._stop_by_itself(f"setpoint out of reach: {error}", t_ns)
        if position_m is None:
            text = f"setpoint of {message.count} joints in {message.space.value}"
            return self._stop_by_itself(f"{text}; must be {self.expected}", t_ns)
        if self._check is not None:
            excess = self._check.excess(message.seq, message.t_ns, position_m)
            if excess is not None and self._check.stops:
                return self._stop_by_itself(f"setpoint outside the envelope: {excess}", t_ns)
        if message.values != self._setpoint:  # unchanged: no stop of the integration
            self._setpoint = message.values
            effective_ns = t_ns - t_ns % DRIVE_SAMPLE_NS + DRIVE_SAMPLE_NS
            self._setpoints.append((effective_ns, message.values))
        return []

    def flush(self, t_ns: int) -> list[Send]:
        """Send the newest reading."""
        if self._reading is None:
            return []
        reading, self._reading = self._reading, None
        return [Send("joint_state", reading, t_ns)]

    def _position_m(self, setpoint: Setpoint) -> Position | None:
        """Compute the position that a setpoint asks for; None where it is for another robot.

        Raises ValueError for one out of reach.
        """
        return setpoint.position_m

    def _give(self, values: JointValues, bench: SimulatedPlant) -> None:
        """Give the drives the values of a setpoint."""
        bench.set_setpoint((values[0], values[1], values[2]))

    def _measured(self, t_ns: int, bench: SimulatedPlant) -> JointState:
        """Read the encoders."""
        self._seq += 1
        return axis_state(self._seq - 1, t_ns, bench.position_m, bench.velocity_m_s)

    def _stop_by_itself(self, text: str, t_ns: int) -> list[Send]:
        self.phase = Phase.FAULT
        text = f"{text}; the robot stopped by itself"
        return [self._replies.give_up(self.phase, t_ns, text, FAULT_CODE)]
