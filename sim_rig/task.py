"""Bench task: encoder readings, frames and truth from setpoints.

The time stamps are exact, however late the task runs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Protocol

from comms.channels import MS
from comms.messages import Command, Frame, LinkMotion, Message, Phase, Truth, Verb
from comms.replies import Replies
from comms.task import NO_STEP, Send, Step
from sim_rig.bench import Bench, SimulatedPlant
from sim_rig.params import BenchParams
from sim_rig.quattro_port import QuattroPort
from sim_rig.setpoint_port import SetpointPort
from sim_rig.shutter import Exposure, Shutter
from sim_rig.spatial_chain import LoadEvent

MakeBench = Callable[[int], SimulatedPlant]  # of the start time [ns]
TRUTH_NS = 10 * MS
JOINT_TRUTH_NS = MS  # of an elastic joint, whose load oscillates at 17 Hz
# longest simulated time in one call, to bound the number of frames; the next wake is immediate
MAX_CATCH_UP_NS = 250 * MS
NEVER_NS = 2**63
EXIT_FAULT = 5  # of a run that ends by a fault


class RobotPort(Protocol):
    """Port of the robot of the bench: setpoints and orders in, states out."""

    phase: Phase
    takes_effect_at_once: bool  # the bench is brought to the arrival of a message before it
    late: int  # readings that were skipped because a newer one was due

    def begin(self, t_ns: int) -> None:
        """Start the grid of the readings."""

    def next_ns(self) -> int:
        """Return the next instant at which the port has something to do."""

    def wake_ns(self) -> int:
        """Return the next instant at which the task must be awake for the port."""

    def read(self, t_ns: int, bench: SimulatedPlant) -> None:
        """Take a reading that is due at t_ns, before anything changes there."""

    def apply(self, t_ns: int, bench: SimulatedPlant) -> list[Send]:
        """Apply what takes effect at t_ns; return what is sent because of it."""

    def take(self, message: Message, t_ns: int, bench: SimulatedPlant) -> list[Send]:
        """Take a message that arrived at t_ns; the bench may still be before that instant."""

    def flush(self, t_ns: int) -> list[Send]:
        """Send the newest reading of a call."""


class BenchTask:
    """Task (comms.task.Task) of the simulated robot, load and camera.

    The simulation starts with `start`, which releases the load at rest from its initial swing. The
    integration stops only at exposures and at the instants of the port, so the result does not
    depend on the wake-up times of the task.
    """

    name = "bench"

    def __init__(
        self,
        params: BenchParams,
        make_bench: MakeBench | None = None,
        port: RobotPort | None = None,
    ) -> None:
        """make_bench, port: of another robot than the Cartesian one that takes setpoints."""
        self._params = params
        self._replies = Replies(self.name)
        if params.quattro is not None:
            quattro = QuattroPort(params, params.quattro, self._replies)
            make_bench, port = quattro.make_bench, quattro
        self._make_bench: MakeBench = make_bench or (lambda t_ns: Bench(params, t_ns))
        self._bench = self._make_bench(0)
        # draw their noisy screens once, here
        self._shutters: list[Shutter] = []
        if params.view.rate_hz > 0.0:
            self._shutters = [Shutter(params, camera) for camera in range(len(params.cameras))]
        self._port: RobotPort = port or SetpointPort(params, self._replies)
        self._truth_ns = 0
        self._truth_period_ns = TRUTH_NS if params.joint is None else JOINT_TRUTH_NS
        self._sent: Counter[str] = Counter()
        self._is_broken = False  # by an event of the load

    @property
    def late_ticks(self) -> int:
        """Encoder readings that were skipped because a newer one was due."""
        return self._port.late

    def start(self, t_ns: int) -> Step:
        """Release the load; a tick at t_ns itself is served at once."""
        self._bench = self._make_bench(t_ns)
        self._bench.await_run()
        for shutter in self._shutters:
            shutter.begin(t_ns)
        self._truth_ns = t_ns + -t_ns % self._truth_period_ns
        self._port.begin(t_ns)
        return self.on_tick(t_ns)

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Process a message to the robot, or a command.

        Stop is acknowledged; the simulation keeps integrating.
        """
        if isinstance(message, Command):
            if message.verb is Verb.START:
                self._bench.start_run(message.t_start_ns)
            text = f"{self.late_ticks} late ticks"
            return Step([self._replies.answer(message, self._port.phase, t_ns, text)])
        if self._is_broken:
            return NO_STEP
        if not self._port.takes_effect_at_once:
            return Step(self._port.take(message, t_ns, self._bench))
        step = self.on_tick(t_ns)
        try:
            answers = self._port.take(message, t_ns, self._bench)
        except LoadEvent as event:
            answers = self._break_off(event, t_ns)
        return step._replace(sends=[*step.sends, *answers])

    def on_tick(self, t_ns: int) -> Step:
        """Simulate up to t_ns and send what is due, in the order of time.

        Of several encoder readings only the newest is sent. After an event of the load that it
        cannot continue, the simulation ends.
        """
        if self._is_broken:
            return NO_STEP
        sends: list[Send] = []
        try:
            wake_ns = self._simulate(t_ns, sends)
        except LoadEvent as event:
            return Step([*sends, *self._break_off(event, t_ns)])
        return Step(sends, max(wake_ns, t_ns))

    def _simulate(self, t_ns: int, sends: list[Send]) -> int:
        """Simulate up to t_ns, append what is sent, and return the next wake."""
        bench, port = self._bench, self._port
        end_ns = min(t_ns, bench.t_ns + MAX_CATCH_UP_NS)
        while True:
            due_ns = min(self._truth_ns, port.next_ns())
            for shutter in self._shutters:
                due_ns = min(due_ns, shutter.next_ns)
            if due_ns > end_ns:
                break
            bench.advance(max(due_ns, bench.t_ns))
            port.read(due_ns, bench)
            if due_ns == self._truth_ns:
                self._truth_ns += self._truth_period_ns
                sends.append(Send("truth", self._truth(due_ns), t_ns))
            for number, shutter in enumerate(self._shutters, start=1):
                if due_ns == shutter.next_ns and (exposure := shutter.sample(bench)):
                    channel = f"frame_{number}"
                    sends.append(Send(channel, self._frame(channel, exposure), t_ns))
            sends += port.apply(due_ns, bench)
        sends += port.flush(t_ns)
        wake_ns = min(self._truth_ns, port.wake_ns())
        for shutter in self._shutters:
            wake_ns = min(wake_ns, shutter.closes_ns)
        return wake_ns

    def stop(self, t_ns: int) -> Step:
        """Do nothing; no shutdown action."""
        return NO_STEP

    def _break_off(self, event: LoadEvent, t_ns: int) -> list[Send]:
        self._is_broken = True
        return [self._replies.give_up(self._port.phase, t_ns, str(event), EXIT_FAULT)]

    def _truth(self, t_ns: int) -> Truth:
        links = tuple(LinkMotion(**link._asdict()) for link in self._bench.links)
        return Truth(
            seq=self._seq("truth"),
            t_ns=t_ns,
            position_m=self._bench.position_m,
            velocity_m_s=self._bench.velocity_m_s,
            links=links,
        )

    def _frame(self, channel: str, exposure: Exposure) -> Frame:
        pixels = exposure.pixels
        return Frame(
            seq=self._seq(channel),
            t_ns=exposure.start_ns + exposure.exposure_ns + exposure.readout_ns,
            t_exposure_start_ns=exposure.start_ns,
            exposure_ns=exposure.exposure_ns,
            row_ns=exposure.row_ns,
            camera=exposure.camera,
            encoding="mono8" if pixels.ndim == 2 else "bgr8",
            height=pixels.shape[0],
            width=pixels.shape[1],
            pixels=pixels,
        )

    def _seq(self, channel: str) -> int:
        """Return the next sequence number of a channel, from 0."""
        seq = self._sent[channel]
        self._sent[channel] = seq + 1
        return seq
