"""The streamer: sends the plan at 100 Hz through the safety gate, and monitors the cable angles.

A reference is the plan at the scheduled tick, not at the instant of waking. A run starts only with
the robot at the start of the move.
"""

from __future__ import annotations

import math

import msgspec

from comms.channels import MS
from comms.messages import (
    AngleSample,
    Command,
    Message,
    Phase,
    Position,
    Reference,
    RobotState,
    Verb,
)
from comms.replies import Replies
from comms.task import NO_STEP, Send, Step
from rig.analysis.identify.errors import AnalysisError
from rig.errors import FAULT, REFUSED
from rig.run.tasks.angle_watch import AngleWatch, WatchedCamera
from rig.run.tasks.controller.phase import ORDERS, Trigger, next_phase, refusal
from rig.run.tasks.pause import BUSY_HINT, PauseMeter
from rig.run.tasks.run_out import RunOut
from rig.run.tasks.safety import Envelope, Gate

PERIOD_NS = 10 * MS
# largest distance to the start of the move; the first window covers the distance in 30 ms
IN_PLACE_M = 0.002


class StreamerSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Plan on the 10 ms grid from t_start, and the bounds on what is sent and received."""

    positions_m: list[Position]  # from t_start on; the last one is repeated until the end
    move_ticks: tuple[int, int]  # first and last tick of the move; (0, 0) = no move
    envelope: Envelope
    cameras: list[WatchedCamera] = []
    robot_stale_ns: int = 100 * MS  # largest age of the robot state, from the start on
    natural_frequency_rad_s: float  # of the model; for the fit of the initial swing
    initial_swing_rad: float  # largest amplitude before the move


class Streamer:
    """Sans-IO task `streamer`."""

    name = "streamer"

    def __init__(self, settings: StreamerSettings) -> None:
        self._settings = settings
        self._gate = Gate(settings.envelope)
        self._run_out = RunOut(settings.envelope, PERIOD_NS * 1e-9, 1)
        self._phase = Phase.IDLE
        self._t_start_ns = 0
        self._seq = 0
        self._replies = Replies(self.name)
        self._tick = -1  # last tick sent
        self._last_sent: Position | None = None
        self._robot: RobotState | None = None
        self._robot_ns = 0  # arrival of the newest robot state
        self._angles = AngleWatch(settings.cameras)
        self._pause = PauseMeter(PERIOD_NS)
        self.late_ticks = 0

    def start(self, t_ns: int) -> Step:
        """Wait for an order."""
        return NO_STEP

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Take an order, an angle or a robot state."""
        if isinstance(message, Command):
            return self._handle_order(message, t_ns)
        if isinstance(message, AngleSample):
            first, _ = self._settings.move_ticks
            is_quiet = self._phase is Phase.RUNNING and self._tick < first
            self._angles.take(channel, message, t_ns, is_quiet=is_quiet)
        elif isinstance(message, RobotState):
            self._robot = message
            self._robot_ns = t_ns
        return NO_STEP

    def on_tick(self, t_ns: int) -> Step:
        """Send the reference of the newest tick due; after a stop it runs out and is repeated."""
        if self._phase is not Phase.RUNNING and self._last_sent is None:
            return NO_STEP
        tick = (t_ns - self._t_start_ns) // PERIOD_NS
        if tick <= self._tick:  # woken early
            return Step(wake_ns=self._t_start_ns + (self._tick + 1) * PERIOD_NS)
        self.late_ticks += tick - self._tick - 1
        self._pause.tick(t_ns)
        reports = self._check(tick, t_ns) if self._phase is Phase.RUNNING else ()
        steps = tick - self._tick
        self._tick = tick
        next_ns = self._t_start_ns + (tick + 1) * PERIOD_NS
        return Step((*self._reference(tick, steps, t_ns), *reports), next_ns)

    def stop(self, t_ns: int) -> Step:
        """Stop sending references."""
        self._phase = next_phase(self._phase, Trigger.STOP)
        self._last_sent = None
        return NO_STEP

    def _reference(self, tick: int, steps: int, t_ns: int) -> tuple[Send, ...]:
        """Send the reference of a tick, so many steps after the one before."""
        t_target_ns = self._t_start_ns + tick * PERIOD_NS
        positions = self._settings.positions_m
        position = positions[min(tick, len(positions) - 1)]
        if self._phase is Phase.RUNNING:
            refused = self._gate.refusal(t_target_ns, position)
            if refused is not None:
                stopped = self._stop(f"safety gate: {refused}{self._pause.note}", FAULT, t_ns)
                return (stopped, *self._reference(tick, steps, t_ns))
            self._last_sent = position
            self._run_out.follow(position, steps)
        elif self._phase is Phase.STOPPED and self._last_sent is not None:
            for _ in range(steps):
                self._last_sent = self._run_out.next()
        if self._last_sent is None:
            return ()
        reference = Reference(
            seq=self._seq, t_ns=t_ns, t_target_ns=t_target_ns, position_m=self._last_sent
        )
        self._seq += 1
        return (Send("reference", reference, t_ns),)

    def _check(self, tick: int, t_ns: int) -> tuple[Send, ...]:
        """Check initial swing and ages of the data; return reports, stop where a check fails."""
        first, _ = self._settings.move_ticks
        reports = self._check_initial_swing(t_ns) if self._tick < first <= tick else ()
        fault = None
        if self._phase is Phase.RUNNING:
            fault = self._stale_robot(t_ns)
            fault = fault or self._angles.stale(t_ns, self._t_start_ns, self._pause)
        if fault is None:
            return reports
        return (*reports, self._stop(fault, FAULT, t_ns))

    def _check_initial_swing(self, t_ns: int) -> tuple[Send, ...]:
        """Report the swing before the move; stop where it exceeds its bound."""
        s = self._settings
        if s.move_ticks == (0, 0) or not self._angles.has_cameras:
            return ()
        try:
            swing_rad, where = self._angles.initial_swing(s.natural_frequency_rad_s)
        except AnalysisError as error:
            text = f"the swing before the start cannot be measured: {error}"
            if s.move_ticks[0] == 0:  # no quiet interval is configured
                return (self._report(text, t_ns),)
            hint = "(experiment.quiet_s), or set it to 0 to start without this check"
            return (self._stop(f"{text} {hint}", REFUSED, t_ns),)
        text = f"the load swings {swing_rad * 1e3:.2f} mrad{where} before the start"
        if swing_rad <= s.initial_swing_rad:
            return (self._report(text, t_ns),)
        bound = f"must be <= {s.initial_swing_rad * 1e3:.2f} mrad"
        allowed_rad = math.ceil(swing_rad * 110) / 100
        hint = f"wait, or allow it with --set safety.initial_swing_rad={allowed_rad:.2f}"
        return (self._stop(f"{text}; {bound}: {hint}", REFUSED, t_ns),)

    def _stale_robot(self, t_ns: int) -> str | None:
        """Describe a robot state that is too old; None while it is fresh."""
        stale_ns = self._settings.robot_stale_ns
        age_ns = t_ns - max(self._robot_ns, self._t_start_ns)
        if age_ns <= stale_ns:
            return None
        return (
            f"no robot state for {age_ns / MS:.0f} ms; "
            f"must be <= {stale_ns / MS:.0f} ms (safety.robot_stale_ms): "
            f"{self._pause.cause(age_ns, 'nothing arrived from the controller')}"
        )

    def _handle_order(self, order: Command, t_ns: int) -> Step:
        refused = refusal(self._phase, order.verb)
        if order.verb is Verb.STATUS and self._phase is Phase.IDLE and self._robot is None:
            refused = "no robot state has arrived: are controller and bench running?"
        if refused is None and order.verb is Verb.START:
            refused = self._start_refusal(order.t_start_ns, t_ns)
        if refused is not None:
            return Step((self._replies.refuse(order, self._phase, t_ns, refused, REFUSED),))
        wake_ns = None
        if order.verb in ORDERS:
            self._phase = next_phase(self._phase, ORDERS[order.verb])
        if order.verb is Verb.START:
            self._t_start_ns = wake_ns = order.t_start_ns
        return Step((self._replies.answer(order, self._phase, t_ns),), wake_ns)

    def _start_refusal(self, t_start_ns: int, t_ns: int) -> str | None:
        """Check that the robot would not jump at t_start; return the reason of a refusal."""
        if t_start_ns < t_ns:
            late_ms = (t_ns - t_start_ns) / MS
            return f"start refused: t_start is {late_ms:.0f} ms past; must lie ahead: {BUSY_HINT}"
        robot = self._robot
        age_ns = t_ns - self._robot_ns
        if robot is None or age_ns > self._settings.robot_stale_ns:
            found = f"is {age_ns / MS:.0f} ms old" if robot else "has not arrived"
            bound = f"must be <= {self._settings.robot_stale_ns / MS:.0f} ms old"
            return (
                f"start refused: the robot state {found}; {bound}: "
                "are controller and bench running?"
            )
        actual_m = robot.actual_m
        first_m = self._settings.positions_m[0]
        distance_m = math.dist(actual_m, first_m)
        if not distance_m <= IN_PLACE_M:  # NaN is refused
            return (
                f"start refused: the robot stands at {_place(actual_m)}, "
                f"the move starts at {_place(first_m)}, {distance_m * 1e3:.1f} mm away; "
                f"must be <= {IN_PLACE_M * 1e3:.0f} mm: "
                "bring the robot there, or set move.start_m to where it stands"
            )
        # makes the gate take the first reference from standstill
        refused = self._gate.refusal(t_start_ns - PERIOD_NS, first_m)
        return refused and f"start refused: safety gate: {refused}"

    def _stop(self, text: str, code: int, t_ns: int) -> Send:
        self._phase = next_phase(self._phase, Trigger.STOP)
        return self._replies.give_up(self._phase, t_ns, text, code)

    def _report(self, text: str, t_ns: int) -> Send:
        return self._replies.tell(self._phase, t_ns, text)


def _place(position_m: Position) -> str:
    return "({:.4f}, {:.4f}, {:.4f}) m".format(*position_m)


def build(settings: bytes) -> Streamer:
    """Make the task from its settings in JSON."""
    return Streamer(msgspec.json.decode(settings, type=StreamerSettings))


if __name__ == "__main__":
    import sys

    from comms.runner import main

    sys.exit(main(build))
