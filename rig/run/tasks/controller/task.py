"""The controller task: communication and interpolation on one 5 ms grid, under one phase."""

from __future__ import annotations

import msgspec

from comms.channels import MS
from comms.messages import Command, JointState, Message, Phase, Position, Reference, Setpoint, Verb
from comms.replies import Replies
from comms.task import NO_STEP, Send, Step
from rig.errors import FAULT
from rig.run.tasks.controller.communication import Communication
from rig.run.tasks.controller.interpolator import TICK_NS, Interpolator
from rig.run.tasks.controller.phase import ORDERS, Trigger, next_phase, refusal

STATE_EVERY = 2  # ticks: setpoints at 200 Hz, state at 100 Hz


class ControllerSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How long the controller rides through holes: of references, and of what the encoders read."""

    reference_stale_ns: int
    robot_stale_ns: int = 100 * MS


class ControllerTask:
    """Sans-IO task `controller`. Outside RUNNING the setpoint stays where it is."""

    name = "controller"

    def __init__(self, settings: ControllerSettings) -> None:
        self._stale_ns, self._robot_stale_ns = settings.reference_stale_ns, settings.robot_stale_ns
        self._phase = Phase.IDLE
        self._io = Communication()
        self._interpolator: Interpolator | None = None
        self._t_start_ns = 0
        self._setpoint: Position | None = None
        self._seq = 0
        self._replies = Replies(self.name)
        self._tick = 0  # next grid instant is _tick * TICK_NS
        self.late_ticks = 0

    def start(self, t_ns: int) -> Step:
        """Ticks run from the first on; setpoints only once armed."""
        self._tick = t_ns // TICK_NS + 1
        return Step(wake_ns=self._tick * TICK_NS)

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """References, encoder readings, orders."""
        if isinstance(message, Reference):
            self._io.take_reference(message, t_ns)
        elif isinstance(message, JointState):
            self._io.take_joints(message, t_ns)
        elif isinstance(message, Command):
            return self._obey(message, t_ns)
        return NO_STEP

    def on_tick(self, t_ns: int) -> Step:
        """The setpoint of the newest grid instant that is due, and the state at every other one."""
        tick = t_ns // TICK_NS
        self.late_ticks += tick - self._tick
        self._tick = tick + 1
        news = self._watch(t_ns)
        sends = (*self._set(tick * TICK_NS, t_ns), *news)
        if tick % STATE_EVERY == 0:
            sends += self._io.state(self._commanded(), self._phase, t_ns)
        return Step(sends, self._tick * TICK_NS)

    def stop(self, t_ns: int) -> Step:
        """The last setpoint stays with the servos."""
        self._phase = next_phase(self._phase, Trigger.STOP)
        return NO_STEP

    def _set(self, grid_ns: int, t_ns: int) -> tuple[Send, ...]:
        if self._setpoint is None:
            return ()
        if self._phase is Phase.RUNNING and self._interpolator and grid_ns >= self._t_start_ns:
            newest = self._io.reference.position_m if self._io.reference else None
            self._setpoint = self._interpolator.setpoint(grid_ns, newest)
        message = Setpoint(seq=self._seq, t_ns=t_ns, position_m=self._setpoint)
        self._seq += 1
        return (Send("setpoint", message, t_ns),)

    def _watch(self, t_ns: int) -> tuple[Send, ...]:
        """Notice peers that fell silent."""
        if self._phase not in (Phase.ARMED, Phase.RUNNING):
            return ()
        silent_ns = t_ns - self._io.joints_ns
        if silent_ns > self._robot_stale_ns:
            bound = f"must be <= {self._robot_stale_ns / MS:.0f} ms (safety.robot_stale_ms)"
            text = f"no joint state for {silent_ns / MS:.0f} ms; {bound}: is the bench running?"
            return self._happen(Trigger.ROBOT_STALE, text, t_ns)
        silent_ns = t_ns - max(self._io.reference_ns, self._t_start_ns)
        if self._phase is Phase.RUNNING and silent_ns > self._stale_ns:
            text = (
                f"no reference for {silent_ns / MS:.0f} ms; must be <= {self._stale_ns / MS:.0f} ms "
                "(safety.reference_stale_ms): the robot stays where it is"
            )
            return self._happen(Trigger.REFERENCE_STALE, text, t_ns)
        return ()

    def _happen(self, happening: Trigger, text: str, t_ns: int) -> tuple[Send, ...]:
        self._phase = next_phase(self._phase, happening)
        return (self._replies.give_up(self._phase, t_ns, text, FAULT),)

    def _obey(self, order: Command, t_ns: int) -> Step:
        why = self._refusal(order, t_ns)
        if why is not None:
            return Step((self._replies.refuse(order, self._phase, t_ns, why),))
        if order.verb in ORDERS:
            self._phase = next_phase(self._phase, ORDERS[order.verb])
        if order.verb is Verb.ARM and self._io.joints is not None:
            self._setpoint = self._io.joints.position_m  # bumpless: the goal is where the robot is
        if order.verb is Verb.START and self._setpoint is not None:
            self._t_start_ns = order.t_start_ns
            self._interpolator = Interpolator(order.t_start_ns, self._setpoint)
        return Step((self._replies.answer(order, self._phase, t_ns),))

    def _refusal(self, order: Command, t_ns: int) -> str | None:
        unknown = self._io.joints is None or t_ns - self._io.joints_ns > self._robot_stale_ns
        if unknown and order.verb in (Verb.STATUS, Verb.ARM):
            return "the robot's encoders are silent: is the bench running?"
        return refusal(self._phase, order.verb)

    def _commanded(self) -> Position:
        if self._setpoint is not None:
            return self._setpoint
        return self._io.joints.position_m if self._io.joints else (0.0, 0.0, 0.0)


def build(settings: bytes) -> ControllerTask:
    """The task from its settings in JSON."""
    return ControllerTask(msgspec.json.decode(settings, type=ControllerSettings))
