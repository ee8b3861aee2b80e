"""The streamer: plays the plan at 100 Hz, each reference through the safety gate, and watches the angle.

It always sends the plan at the scheduled tick, not at the instant it woke, and starts only with the robot in place.
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
from rig.analysis.identify.swing import initial_swing_rad
from rig.errors import FAULT, REFUSED
from rig.run.tasks.controller.phase import ORDERS, Trigger, next_phase, refusal
from rig.run.tasks.safety import Envelope, Gate

PERIOD_NS = 10 * MS
IN_PLACE_M = (
    0.002  # farther from the start of the move than this, the robot would be pulled there in 30 ms
)


class StreamerSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The plan on the 10 ms grid from t_start, and what must hold while it is played."""

    positions_m: list[Position]  # from t_start on; the last one is repeated until the end
    move_ticks: tuple[int, int]  # first and last tick of the move; (0, 0) = nothing moves
    envelope: Envelope
    angle_stale_ns: int  # 0 = no camera
    robot_stale_ns: int = 100 * MS  # older news of the robot's place do not let a plan start
    natural_frequency_rad_s: float  # belief, to tell a swinging load before the start
    initial_swing_rad: float  # more than this before the start is refused


class Streamer:
    """Sans-IO task `streamer`."""

    name = "streamer"

    def __init__(self, settings: StreamerSettings) -> None:
        self._settings = settings
        self._gate = Gate(settings.envelope)
        self._phase = Phase.IDLE
        self._t_start_ns = 0
        self._seq = 0
        self._replies = Replies(self.name)
        self._tick = -1  # last tick sent
        self._held: Position | None = None
        self._robot: RobotState | None = None
        self._robot_ns = 0  # its arrival
        self._angle_ns = 0  # arrival of the newest valid angle
        self._blind = ""  # why the newest angle was not valid
        self._quiet: list[tuple[float, float]] = []  # (t_s, angle_rad) before the move
        self.late_ticks = 0

    def start(self, t_ns: int) -> Step:
        """Nothing to do before the operator speaks."""
        return NO_STEP

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Orders, angles, where the robot stands."""
        if isinstance(message, Command):
            return self._obey(message, t_ns)
        if isinstance(message, AngleSample):
            self._see(message, t_ns)
        elif isinstance(message, RobotState):
            self._robot, self._robot_ns = message, t_ns
        return NO_STEP

    def on_tick(self, t_ns: int) -> Step:
        """Send the reference of the newest tick that is due; once stopped, the last one sent, again and again."""
        if self._phase is not Phase.RUNNING and self._held is None:
            return NO_STEP
        tick = (t_ns - self._t_start_ns) // PERIOD_NS
        if tick <= self._tick:  # woken early
            return Step(wake_ns=self._t_start_ns + (self._tick + 1) * PERIOD_NS)
        self.late_ticks += tick - self._tick - 1
        news = self._checks(tick, t_ns) if self._phase is Phase.RUNNING else ()
        self._tick = tick
        return Step(
            (*self._reference(tick, t_ns), *news), self._t_start_ns + (tick + 1) * PERIOD_NS
        )

    def stop(self, t_ns: int) -> Step:
        """No more references."""
        self._phase, self._held = next_phase(self._phase, Trigger.STOP), None
        return NO_STEP

    def _reference(self, tick: int, t_ns: int) -> tuple[Send, ...]:
        t_target_ns = self._t_start_ns + tick * PERIOD_NS
        positions = self._settings.positions_m
        position = positions[min(tick, len(positions) - 1)]
        if self._phase is Phase.RUNNING:
            outside = self._gate.refusal(t_target_ns, position)
            if outside is not None:
                return (
                    self._stop(f"safety gate: {outside}", FAULT, t_ns),
                    *self._reference(tick, t_ns),
                )
            self._held = position
        if self._held is None:
            return ()
        reference = Reference(
            seq=self._seq, t_ns=t_ns, t_target_ns=t_target_ns, position_m=self._held
        )
        self._seq += 1
        return (Send("reference", reference, t_ns),)

    def _checks(self, tick: int, t_ns: int) -> tuple[Send, ...]:
        """What there is to say at this tick; a check that fails stops the play."""
        first, _ = self._settings.move_ticks
        news = self._before_the_move(t_ns) if self._tick < first <= tick else ()
        trouble = self._trouble(t_ns) if self._phase is Phase.RUNNING else None
        return news if trouble is None else (*news, self._stop(trouble, FAULT, t_ns))

    def _before_the_move(self, t_ns: int) -> tuple[Send, ...]:
        """Say how much the load swings; refuse to start a move with a load that swings too much."""
        s = self._settings
        if s.move_ticks == (0, 0) or s.angle_stale_ns == 0:
            return ()
        try:
            t_s, angle_rad = zip(*self._quiet, strict=True) if self._quiet else ((), ())
            swing = initial_swing_rad(t_s, angle_rad, s.natural_frequency_rad_s)
        except AnalysisError as error:
            said = f"cannot tell whether the load swings before the start: {error}"
            if s.move_ticks[0] == 0:  # no quiet time was asked for
                return (self._tell(said, t_ns),)
            return (
                self._stop(
                    f"{said} (experiment.quiet_s), or set it to 0 to start unseen", REFUSED, t_ns
                ),
            )
        said = f"the load swings {swing * 1e3:.2f} mrad before the start"
        if swing <= s.initial_swing_rad:
            return (self._tell(said, t_ns),)
        hint = f"wait, or allow it with --set safety.initial_swing_rad={math.ceil(swing * 110) / 100:.2f}"
        bound = f"must be <= {s.initial_swing_rad * 1e3:.2f} mrad"
        return (self._stop(f"{said}; {bound}: {hint}", REFUSED, t_ns),)

    def _trouble(self, t_ns: int) -> str | None:
        stale_ns = self._settings.angle_stale_ns
        silent_ns = t_ns - max(self._angle_ns, self._t_start_ns)
        if stale_ns == 0 or silent_ns <= stale_ns:
            return None
        why = f"last reason: {self._blind}" if self._blind else "no picture arrived"
        return (
            f"no valid cable angle for {silent_ns / MS:.0f} ms; must be <= {stale_ns / MS:.0f} ms ({why}): "
            "check camera, screen and calibration"
        )

    def _see(self, sample: AngleSample, t_ns: int) -> None:
        if not sample.valid or sample.angle_rad is None:
            self._blind = sample.reason.value
            return
        self._angle_ns, self._blind = t_ns, ""
        if self._phase is Phase.RUNNING and self._tick < self._settings.move_ticks[0]:
            self._quiet.append((sample.t_valid_ns * 1e-9, sample.angle_rad))

    def _obey(self, order: Command, t_ns: int) -> Step:
        why = refusal(self._phase, order.verb)
        if order.verb is Verb.STATUS and self._phase is Phase.IDLE and self._robot is None:
            why = "the robot's state has not come yet: are controller and bench running?"
        if why is None and order.verb is Verb.START:
            why = self._not_ready(order.t_start_ns, t_ns)
        if why is not None:
            return Step((self._replies.refuse(order, self._phase, t_ns, why, REFUSED),))
        wake_ns = None
        if order.verb in ORDERS:
            self._phase = next_phase(self._phase, ORDERS[order.verb])
        if order.verb is Verb.START:
            self._t_start_ns = wake_ns = order.t_start_ns
        return Step((self._replies.answer(order, self._phase, t_ns),), wake_ns)

    def _not_ready(self, t_start_ns: int, t_ns: int) -> str | None:
        """Why the robot would jump if the plan started now; None when it would not."""
        if t_start_ns < t_ns:
            late_ms = (t_ns - t_start_ns) / MS
            return f"start refused: t_start is {late_ms:.0f} ms past; must lie ahead: is this machine too busy?"
        if self._robot is None or t_ns - self._robot_ns > self._settings.robot_stale_ns:
            last = f"is {(t_ns - self._robot_ns) / MS:.0f} ms old" if self._robot else "never came"
            bound = f"must be <= {self._settings.robot_stale_ns / MS:.0f} ms old"
            return f"start refused: the robot's state {last}; {bound}: are controller and bench running?"
        here, first = self._robot.actual_m, self._settings.positions_m[0]
        if not math.dist(here, first) <= IN_PLACE_M:
            return (
                f"start refused: the robot stands at {_place(here)}, the move starts at {_place(first)}, "
                f"{math.dist(here, first) * 1e3:.1f} mm away; must be <= {IN_PLACE_M * 1e3:.0f} mm: "
                "bring the robot there, or set move.start_m to where it stands"
            )
        outside = self._gate.refusal(
            t_start_ns - PERIOD_NS, first
        )  # the first reference is judged from standstill there
        return outside and f"start refused: safety gate: {outside}"

    def _stop(self, text: str, code: int, t_ns: int) -> Send:
        self._phase = next_phase(self._phase, Trigger.STOP)
        return self._replies.give_up(self._phase, t_ns, text, code)

    def _tell(self, text: str, t_ns: int) -> Send:
        return self._replies.tell(self._phase, t_ns, text)


def _place(position_m: Position) -> str:
    return "({:.4f}, {:.4f}, {:.4f}) m".format(*position_m)


def build(settings: bytes) -> Streamer:
    """The task from its settings in JSON."""
    return Streamer(msgspec.json.decode(settings, type=StreamerSettings))


if __name__ == "__main__":
    import sys

    from comms.runner import main

    sys.exit(main(build))
