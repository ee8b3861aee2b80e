"""The controller task: communication and interpolation on one 5 ms grid, with one phase."""

from __future__ import annotations

import msgspec

from comms.channels import MS
from comms.messages import (
    Command,
    JointState,
    Message,
    Phase,
    Position,
    Reference,
    Verb,
)
from comms.replies import Replies
from comms.task import NO_STEP, Send, Step
from planners.errors import PlanError
from rig.errors import FAULT
from rig.run.tasks.controller.communication import Communication
from rig.run.tasks.controller.following import FollowingWatch
from rig.run.tasks.controller.interpolator import POLICIES, Interpolator, PolicySettings
from rig.run.tasks.controller.joints import RobotSettings, robot_joints
from rig.run.tasks.controller.phase import ORDERS, Trigger, next_phase, refusal
from rig.run.tasks.controller.setpoint_gate import SetpointGate
from rig.run.tasks.grid import TICK_NS, TICK_S, TICKS, slowed_by_pause
from rig.run.tasks.pause import PauseMeter
from rig.run.tasks.run_out import RunOut
from rig.run.tasks.safety import Envelope

TICKS_PER_STATE = 2  # setpoints at 200 Hz, state at 100 Hz
COUNTING_POLICY = "source"  # setpoints outside the envelope are counted, they do not stop the robot
# of [safety] and [limits] without a key
DEFAULT_ENVELOPE = Envelope(
    position_min_m=-0.25, position_max_m=0.25, speed_m_s=1.1, acceleration_m_s2=5.5
)


class ControllerSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Longest gaps of references and of joint states; interpolator policy and its bounds."""

    reference_stale_ns: int
    robot_stale_ns: int = 100 * MS
    policy: str = "bounded"  # of POLICIES
    playout_ns: int = 100 * MS  # of the policy buffer
    envelope: Envelope = DEFAULT_ENVELOPE
    servo_lag_ns: int = 20 * MS
    following_error_m: float = 0.02  # largest one, for longer than following_error_ns
    following_error_ns: int = 50 * MS
    robot: RobotSettings = RobotSettings()
    cameras: int = 1  # of the run; each has a vision task that is sent the state


class ControllerTask:
    """Sans-IO task `controller`.

    Outside RUNNING the setpoint is held; a controlled stop, and one of the setpoint gate, lets it
    run out to rest before.
    """

    name = "controller"

    def __init__(self, settings: ControllerSettings) -> None:
        self._settings = settings
        self._joints = robot_joints(settings.robot)
        self._reference_stale_ns = settings.reference_stale_ns
        self._robot_stale_ns = settings.robot_stale_ns
        self._phase = Phase.IDLE
        self._io = Communication(settings.cameras)
        self._interpolator: Interpolator | None = None
        self._gate: SetpointGate | None = None
        self._following = FollowingWatch(
            settings.servo_lag_ns, settings.following_error_m, settings.following_error_ns
        )
        self._run_out = RunOut(settings.envelope, TICK_S, TICKS)
        # description of the newest joint state where it is not that of this robot
        self._unusable = ""
        self._t_start_ns = 0
        self._setpoint: Position | None = None
        self._is_running_out = False  # in FAULT, after a setpoint that the gate refused
        self._seq = 0
        self._replies = Replies(self.name)
        self._tick = 0  # next grid instant is _tick * TICK_NS
        self._pause = PauseMeter(TICK_NS)
        self.late_ticks = 0

    def start(self, t_ns: int) -> Step:
        """Begin to tick; setpoints are sent once the controller is armed."""
        self._tick = t_ns // TICK_NS + 1
        return Step(wake_ns=self._tick * TICK_NS)

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Take a reference, a joint state or an order."""
        if isinstance(message, Reference):
            self._io.take_reference(message, t_ns)
        elif isinstance(message, JointState):
            self._take_joints(message, t_ns)
        elif isinstance(message, Command):
            return self._handle_order(message, t_ns)
        return NO_STEP

    def _take_joints(self, joints: JointState, t_ns: int) -> None:
        platform = self._joints.platform(joints)
        if platform is None:
            self._unusable = (
                f"joint states of {joints.count} joints in {joints.space.value}; must be "
                f"{self._joints.expected}: the robot of the bench is not that of the controller"
            )
            return
        self._unusable = ""
        self._io.take_platform(platform, t_ns)
        self._following.take_platform(platform)

    def on_tick(self, t_ns: int) -> Step:
        """Send the setpoint of the newest grid instant due, and the state at every second one."""
        tick = t_ns // TICK_NS
        skipped = tick - self._tick
        self.late_ticks += skipped
        self._tick = tick + 1
        if skipped > 0:
            self._run_out.slow_down(slowed_by_pause(skipped))
        self._pause.tick(t_ns)
        faults = self._check_ages(t_ns) or self._check_following(t_ns)
        sends = (*self._next_setpoint(tick * TICK_NS, t_ns), *faults)
        if tick % TICKS_PER_STATE == 0:
            sends += self._io.state(self._commanded(), self._phase, t_ns)
        return Step(sends, self._tick * TICK_NS)

    def stop(self, t_ns: int) -> Step:
        """Stop; the servos hold the last setpoint."""
        self._phase = next_phase(self._phase, Trigger.STOP)
        return NO_STEP

    def _next_setpoint(self, grid_ns: int, t_ns: int) -> tuple[Send, ...]:
        if self._setpoint is None:
            return ()
        reports = self._advance(grid_ns, t_ns)
        if self._phase is Phase.STOPPED or self._is_running_out:
            self._setpoint = self._run_out.next() or self._setpoint
        else:
            self._run_out.follow(self._setpoint)
        try:
            message = self._joints.setpoint(self._seq, t_ns, self._setpoint)
        except PlanError as error:
            text = f"setpoint out of reach: {error}; the robot stops"
            return (*reports, *self._fail(Trigger.ENVELOPE_LEFT, text, t_ns))
        self._seq += 1
        self._following.add_setpoint(t_ns, self._setpoint)
        return (Send("setpoint", message, t_ns), *reports)

    def _advance(self, grid_ns: int, t_ns: int) -> tuple[Send, ...]:
        """Take the next setpoint of the interpolator through the gate."""
        is_moving = self._phase is Phase.RUNNING and grid_ns >= self._t_start_ns
        if not is_moving or self._interpolator is None or self._gate is None:
            return ()
        position = self._interpolator.setpoint(grid_ns, self._io.reference)
        excess = self._gate.excess(grid_ns // TICK_NS, position)
        if excess is not None and self._settings.policy != COUNTING_POLICY:
            text = f"setpoint gate: {excess}; the robot stops{self._pause.note}"
            self._is_running_out = True
            return self._fail(Trigger.ENVELOPE_LEFT, text, t_ns)
        self._setpoint = position
        if excess is None or self._gate.excesses > 1:
            return ()
        text = f"setpoints leave the envelope, policy '{COUNTING_POLICY}' goes on: {excess}"
        return (self._replies.tell(self._phase, t_ns, text),)

    def _check_ages(self, t_ns: int) -> tuple[Send, ...]:
        """Stop when joint states or references have not arrived for too long."""
        if self._phase not in (Phase.ARMED, Phase.RUNNING):
            return ()
        age_ns = t_ns - self._io.platform_ns
        if age_ns > self._robot_stale_ns:
            bound = f"must be <= {self._robot_stale_ns / MS:.0f} ms (safety.robot_stale_ms)"
            missing = self._unusable or "nothing arrived from the bench"
            cause = self._pause.cause(age_ns, missing)
            text = f"no joint state for {age_ns / MS:.0f} ms; {bound}: {cause}"
            return self._fail(Trigger.ROBOT_STALE, text, t_ns)
        age_ns = t_ns - max(self._io.reference_ns, self._t_start_ns)
        if self._phase is Phase.RUNNING and age_ns > self._reference_stale_ns:
            bound = f"must be <= {self._reference_stale_ns / MS:.0f} ms (safety.reference_stale_ms)"
            cause = self._pause.cause(age_ns, "nothing arrived from the streamer")
            text = f"no reference for {age_ns / MS:.0f} ms; {bound}; the robot holds: {cause}"
            return self._fail(Trigger.REFERENCE_STALE, text, t_ns)
        return ()

    def _check_following(self, t_ns: int) -> tuple[Send, ...]:
        """Stop when the encoders are too far from the delayed setpoint for too long."""
        fault = self._following.fault(self._io.platform)
        if fault is None or self._phase not in (Phase.ARMED, Phase.RUNNING):
            return ()
        text = f"{fault}; the robot holds: look for a blocked axis or a second sender of setpoints"
        return self._fail(Trigger.NOT_FOLLOWING, text, t_ns)

    def _fail(self, trigger: Trigger, text: str, t_ns: int) -> tuple[Send, ...]:
        self._phase = next_phase(self._phase, trigger)
        return (self._replies.give_up(self._phase, t_ns, text, FAULT),)

    def _handle_order(self, order: Command, t_ns: int) -> Step:
        refused = self._refusal(order, t_ns)
        if refused is not None:
            return Step((self._replies.refuse(order, self._phase, t_ns, refused),))
        if order.verb is Verb.ESTOP:
            self._is_running_out = False
        if order.verb in ORDERS:
            self._phase = next_phase(self._phase, ORDERS[order.verb])
        if order.verb is Verb.ARM and self._io.platform is not None:
            # bumpless: the goal is the actual position
            self._setpoint = self._io.platform.position_m
        if order.verb is Verb.START and self._setpoint is not None:
            self._t_start_ns = order.t_start_ns
            policy = POLICIES[self._settings.policy]
            envelope = self._settings.envelope
            bounds = PolicySettings(envelope, self._settings.playout_ns)
            self._interpolator = policy(order.t_start_ns, self._setpoint, bounds)
            first_tick = order.t_start_ns // TICK_NS
            self._gate = SetpointGate(envelope, first_tick - 1, self._setpoint)
        return Step((self._replies.answer(order, self._phase, t_ns),))

    def _refusal(self, order: Command, t_ns: int) -> str | None:
        stale = self._io.platform is None or t_ns - self._io.platform_ns > self._robot_stale_ns
        if stale and order.verb in (Verb.STATUS, Verb.ARM):
            return self._unusable or (
                "no joint state arrives from the encoders; see bench.log in the folder of the run"
            )
        return refusal(self._phase, order.verb)

    def _commanded(self) -> Position:
        if self._setpoint is not None:
            return self._setpoint
        return self._io.platform.position_m if self._io.platform else (0.0, 0.0, 0.0)


def build(settings: bytes) -> ControllerTask:
    """Make the task from its settings in JSON."""
    return ControllerTask(msgspec.json.decode(settings, type=ControllerSettings))
