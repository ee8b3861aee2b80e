"""Task `drive`: setpoints or a program onto PDOs, encoders from PDOs, one exchange per SYNC.

The node is configured once it has booted, and enabled when the run is armed. From then on it gets
a target with every SYNC: the newest setpoint, or a point on the way there. What it measured at a
SYNC becomes a joint state of that instant.
"""

from __future__ import annotations

import struct

import msgspec

from comms.channels import MS
from comms.messages import CanMessage, Command, Message, Phase, Setpoint, Verb, axis_state
from comms.replies import Replies
from comms.task import NO_STEP, Send, Step
from rig.errors import FAULT
from rig.run.tasks.controller.phase import ORDERS, next_phase, refusal
from rig.run.tasks.drive import start_up
from rig.run.tasks.drive.program import Program
from rig.run.tasks.drive.sdo_client import SdoClient
from rig.run.tasks.drive.settings import DriveSettings
from rig.run.tasks.drive.state import ERROR_NAMES, QUICK_STOP, NodeState, state_of, towards

NMT, SYNC, EMERGENCY, HEARTBEAT = 0x000, 0x080, 0x080, 0x700
NMT_START, NMT_RESET_NODE = 0x01, 0x81
BOOT_UP, OPERATIONAL = 0x00, 0x05
RESET_PERIOD_NS = 500 * MS  # of the reset until the node boots
SETPOINT_NS = 5 * MS  # from one setpoint to the next
MAX_INCREMENTS = 2**31 - 1


class DriveTask:
    """Sans-IO master of one drive along X."""

    name = "drive"

    def __init__(self, settings: DriveSettings) -> None:
        self.late_ticks = 0  # SYNCs that were skipped because the next one was due
        self._s = settings
        self._program = Program(settings.program, settings.sync_ns) if settings.program else None
        self._sdo = SdoClient(settings.node_id)
        self._replies = Replies(self.name)
        self._phase = Phase.IDLE
        self._tick = 0
        self._beat_tick = 0  # of the next heartbeat
        self._reset_ns = 0
        self._heard_ns: int | None = None  # newest heartbeat of the node
        self._has_booted = False
        self._is_operational = False  # configured and started
        self._is_enabling = False  # since the order to arm
        self._is_stopping = False  # quick stop
        self._state = NodeState.NOT_READY
        self._position: int | None = None  # newest measurement [increments]
        self._target = 0  # of the next SYNC [increments]
        self._torque_offset = 0  # of the next SYNC [permille]
        self._goal = 0  # newest setpoint [increments]
        self._syncs_left = 0  # until the target is there
        self._setpoint_ns: int | None = None  # arrival of the newest one
        self._sync_ns = 0  # instant of the newest SYNC
        self._arm_order: Command | None = None
        self._frames = 0
        self._states = 0

    def start(self, t_ns: int) -> Step:
        """Begin to look for the node."""
        self._tick = t_ns // self._s.sync_ns + 1
        return Step(wake_ns=self._tick * self._s.sync_ns)

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Take a frame of the node, a setpoint or an order."""
        if isinstance(message, CanMessage):
            return Step(self._take_frame(message, t_ns))
        if isinstance(message, Setpoint):
            return Step(self._take_setpoint(message, t_ns))
        if isinstance(message, Command):
            return Step(self._take_order(message, t_ns))
        return NO_STEP

    def on_tick(self, t_ns: int) -> Step:
        """Exchange with the node: target, SYNC, heartbeat; configuration where it is not done."""
        s = self._s
        tick = t_ns // s.sync_ns
        self.late_ticks += tick - self._tick
        self._tick = tick + 1
        sends = self._watch(t_ns)
        if not self._is_operational:
            sends += self._configure(t_ns)
        else:
            self._sync_ns = t_ns
            self._approach(t_ns)
            data = self._motion(self._control_word())
            sends.append(self._frame(start_up.RPDO + s.node_id, data, t_ns))
            sends.append(self._frame(SYNC, b"", t_ns))
        if tick >= self._beat_tick:  # a skipped SYNC delays it, and no more
            self._beat_tick = tick + s.heartbeat_ns // s.sync_ns
            beat = bytes([OPERATIONAL])
            sends.append(self._frame(HEARTBEAT + start_up.MASTER_ID, beat, t_ns))
        return Step(sends, self._tick * s.sync_ns)

    def stop(self, t_ns: int) -> Step:
        """Switch the drive off; one that moves brakes first, as the option of 605A says."""
        if not self._is_operational:
            return NO_STEP
        data = self._motion(QUICK_STOP)
        return Step(
            [
                self._frame(start_up.RPDO + self._s.node_id, data, t_ns),
                self._frame(SYNC, b"", t_ns),
            ]
        )

    def _configure(self, t_ns: int) -> list[Send]:
        """Reset the node until it boots, then send the next request of the configuration."""
        if not self._has_booted:
            if t_ns < self._reset_ns:
                return []
            self._reset_ns = t_ns + RESET_PERIOD_NS
            return [self._frame(NMT, bytes([NMT_RESET_NODE, self._s.node_id]), t_ns)]
        if self._sdo.is_done:
            self._is_operational = True
            return [self._frame(NMT, bytes([NMT_START, self._s.node_id]), t_ns)]
        request = self._sdo.next(t_ns)
        return [] if request is None else [self._frame(*request, t_ns)]

    def _watch(self, t_ns: int) -> list[Send]:
        """Look for a node that fell silent, and for setpoints that do not arrive any more."""
        if not self._is_operational or self._phase is Phase.FAULT:
            return []
        silent_ns = t_ns - (self._heard_ns or 0)
        if silent_ns > self._s.silent_ns:
            bound = f"must be <= {self._s.silent_ns / MS:.0f} ms"
            text = f"no heartbeat of node {self._s.node_id} for {silent_ns / MS:.0f} ms; {bound}"
            return self._fail(f"{text}: look for its power and for the bus", t_ns)
        if self._phase is not Phase.RUNNING or self._setpoint_ns is None:
            return []
        age_ns = t_ns - self._setpoint_ns
        if age_ns <= self._s.setpoint_stale_ns:
            return []
        bound = f"must be <= {self._s.setpoint_stale_ns / MS:.0f} ms"
        text = f"no setpoint for {age_ns / MS:.0f} ms; {bound}: the controller does not send"
        return self._fail(text, t_ns)

    def _approach(self, t_ns: int) -> None:
        """Move the target as the program says, or over the SYNCs to the newest setpoint."""
        self._torque_offset = 0
        if self._program is not None and self._phase is Phase.RUNNING:
            step = self._program.step_at(t_ns)
            self._target, self._torque_offset = step or (self._target, 0)
        elif self._syncs_left:
            self._target += round((self._goal - self._target) / self._syncs_left)
            self._syncs_left -= 1

    def _control_word(self) -> int:
        if self._is_stopping:
            return QUICK_STOP
        return towards(self._state, self._is_enabling)

    def _take_frame(self, frame: CanMessage, t_ns: int) -> list[Send]:
        node = self._s.node_id
        if frame.is_extended or frame.is_remote:
            return []
        if frame.can_id == HEARTBEAT + node and frame.data:
            return self._take_heartbeat(frame.data[0], t_ns)
        if frame.can_id == self._sdo.response_id:
            self._sdo.take(frame.data)
        elif frame.can_id == start_up.TPDO_MOTION + node and len(frame.data) == 8:
            return self._take_motion(frame.data, t_ns)
        elif frame.can_id == start_up.TPDO_STATUS + node and len(frame.data) >= 2:
            return self._take_status(frame.data, t_ns)
        elif frame.can_id == EMERGENCY + node and len(frame.data) == 8:
            return self._take_emergency(frame.data, t_ns)
        return []

    def _take_heartbeat(self, state: int, t_ns: int) -> list[Send]:
        was_operational = self._is_operational
        self._heard_ns = t_ns
        if state != BOOT_UP:
            return self._take_node_state(state, t_ns)
        self._is_operational = False
        self._has_booted = True
        self._state = NodeState.NOT_READY
        self._position = None
        self._sdo.start(start_up.accesses(self._s))
        if was_operational and self._phase is not Phase.IDLE:
            return self._fail(f"node {self._s.node_id} has restarted", t_ns)
        return []

    def _take_node_state(self, state: int, t_ns: int) -> list[Send]:
        """Start a node again that has missed it; fail where one leaves while it is enabled."""
        if not self._is_operational or state == OPERATIONAL or self._phase is Phase.FAULT:
            return []
        if self._is_enabling:
            text = f"node {self._s.node_id} left the state operational: its state is 0x{state:02X}"
            return self._fail(text, t_ns)
        return [self._frame(NMT, bytes([NMT_START, self._s.node_id]), t_ns)]

    def _take_motion(self, data: bytes, t_ns: int) -> list[Send]:
        self._position, velocity = struct.unpack("<ii", data)
        if not self._is_enabling:
            self._target = self._position  # bumpless: enabled where it stands
            self._syncs_left = 0
        if self._program is not None:
            return []  # no controller takes it
        x_m = self._position / self._s.increments_per_unit
        v_m_s = velocity / self._s.velocity_units_per_unit_s
        state = axis_state(self._states, self._sync_ns, (x_m, 0.0, 0.0), (v_m_s, 0.0, 0.0))
        self._states += 1
        return [Send("joint_state", state, t_ns)]

    def _take_status(self, data: bytes, t_ns: int) -> list[Send]:
        before, self._state = self._state, state_of(int.from_bytes(data[:2], "little"))
        if self._state is NodeState.ENABLED and self._arm_order is not None:
            order, self._arm_order = self._arm_order, None
            return [self._replies.answer(order, self._phase, t_ns)]
        left = before is NodeState.ENABLED and self._state is not NodeState.ENABLED
        if left and not self._is_stopping and self._phase in (Phase.ARMED, Phase.RUNNING):
            return self._fail(f"the drive left operation: {self._state.value}", t_ns)
        return []

    def _take_emergency(self, data: bytes, t_ns: int) -> list[Send]:
        code = int.from_bytes(data[:2], "little")
        if code == 0 or self._phase is Phase.FAULT:  # error reset
            return []
        text = f"emergency of node {self._s.node_id}: error 0x{code:04X}, register 0x{data[2]:02X}"
        text += ERROR_NAMES.get(code, "")
        return self._fail(text, t_ns)

    def _take_setpoint(self, setpoint: Setpoint, t_ns: int) -> list[Send]:
        if self._phase is Phase.FAULT:
            return []
        position_m = setpoint.position_m
        if position_m is None or position_m[1] or position_m[2]:
            return self._fail("a setpoint beside the axis; must be x alone, in m", t_ns)
        increments = round(position_m[0] * self._s.increments_per_unit)
        self._goal = max(-MAX_INCREMENTS, min(MAX_INCREMENTS, increments))
        self._syncs_left = max(1, SETPOINT_NS // self._s.sync_ns)
        self._setpoint_ns = t_ns
        return []

    def _take_order(self, order: Command, t_ns: int) -> list[Send]:
        reason = self._refusal(order.verb)
        if reason:
            return [self._replies.refuse(order, self._phase, t_ns, reason)]
        if order.verb in ORDERS:
            # after a stop the drive stays enabled, and the controller lets the setpoint run out
            self._phase = next_phase(self._phase, ORDERS[order.verb])
        if order.verb is Verb.ESTOP or (order.verb is Verb.STOP and self._program is not None):
            self._is_stopping = True
        if order.verb is Verb.START and self._program is not None:
            self._program.begin(order.t_start_ns, self._target)
        if order.verb is Verb.ARM:
            self._is_enabling = True
            if self._state is not NodeState.ENABLED:
                self._arm_order = order  # answered once the drive is enabled
                return []
        return [self._replies.answer(order, self._phase, t_ns)]

    def _refusal(self, verb: Verb) -> str | None:
        """Check an order; return the reason of a refusal, None if it is allowed."""
        is_ready = self._is_operational and self._position is not None
        if verb in (Verb.STATUS, Verb.ARM) and not is_ready:
            return self._missing()
        return refusal(self._phase, verb)

    def _missing(self) -> str:
        """Say why the node cannot be enabled yet."""
        if self._sdo.error:
            return f"node {self._s.node_id}: {self._sdo.error}"
        if not self._has_booted:
            return f"node {self._s.node_id} does not answer on the bus: look for power and bit rate"
        return f"node {self._s.node_id} is being configured"

    def _motion(self, control_word: int) -> bytes:
        data = struct.pack("<Hi", control_word, self._target)
        return data if self._program is None else data + struct.pack("<h", self._torque_offset)

    def _fail(self, text: str, t_ns: int) -> list[Send]:
        self._phase = Phase.FAULT
        self._is_stopping = True
        return [self._replies.give_up(self._phase, t_ns, text, FAULT)]

    def _frame(self, can_id: int, data: bytes, t_ns: int) -> Send:
        message = CanMessage(
            seq=self._frames,
            t_ns=t_ns,
            can_id=can_id,
            is_extended=False,
            is_remote=False,
            length=len(data),
            data=data,
        )
        self._frames += 1
        return Send("can_down", message, t_ns)


def build(settings: bytes) -> DriveTask:
    """Make the task from its settings in JSON."""
    return DriveTask(msgspec.json.decode(settings, type=DriveSettings))
