"""Bench task: encoder readings, frames and truth from setpoints.

The time stamps are exact, however late the task runs.
"""

from __future__ import annotations

from collections import Counter, deque

from comms.channels import MS
from comms.messages import (
    Command,
    Frame,
    LinkMotion,
    Message,
    Phase,
    Position,
    Setpoint,
    Truth,
    Velocity,
    axis_state,
)
from comms.replies import Replies
from comms.task import NO_STEP, Send, Step
from sim_rig.bench import Bench
from sim_rig.input_check import InputCheck
from sim_rig.params import BenchParams
from sim_rig.shutter import Exposure, Shutter

# sample time of the digital drives; the arrival time of a setpoint within it has no effect
DRIVE_SAMPLE_NS = 1 * MS
TICK_NS = 5 * MS  # encoders are read on this grid of the run clock
TRUTH_NS = 10 * MS  # a multiple of TICK_NS
# longest simulated time in one call, to bound the number of frames; the next wake is immediate
MAX_CATCH_UP_NS = 250 * MS
NEVER_NS = 2**63
FAULT_CODE = 5  # exit code of a run in which the robot stopped by itself


class BenchTask:
    """Task (comms.task.Task) of the simulated robot, load and camera.

    The simulation starts with `start`, which releases the load at rest from its initial swing. The
    integration stops only at ticks, exposures and samples of the drives, so the result does not
    depend on the wake-up times of the task.
    """

    name = "bench"

    def __init__(self, params: BenchParams) -> None:
        self.late_ticks = 0  # encoder readings that were skipped because a newer one was due
        self._params = params
        self._bench = Bench(params)
        # draws its noisy screens once, here
        self._shutter = Shutter(params) if params.view.rate_hz > 0.0 else None
        self._tick_ns = 0
        # (effective from [ns], position): arrived, not yet sampled by the drives
        self._setpoints: deque[tuple[int, Position]] = deque()
        self._setpoint_m = params.start_m
        self._phase = Phase.IDLE
        self._check = InputCheck(params.input, params.start_m) if params.input else None
        self._sent: Counter[str] = Counter()
        self._replies = Replies(self.name)

    def start(self, t_ns: int) -> Step:
        """Release the load; a tick at t_ns itself is served at once."""
        self._bench = Bench(self._params, t_ns)
        if self._shutter is not None:
            self._shutter.begin(t_ns)
        self._tick_ns = t_ns + -t_ns % TICK_NS
        return self.on_tick(t_ns)

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Process a setpoint or a command.

        A setpoint takes effect at the next sample of the drives; one outside the bounds of the
        input stops the robot. Stop is acknowledged; the simulation keeps integrating.
        """
        if isinstance(message, Setpoint):
            return self._take_setpoint(message, t_ns)
        if isinstance(message, Command):
            text = f"{self.late_ticks} late ticks"
            return Step([self._replies.answer(message, self._phase, t_ns, text)])
        return NO_STEP

    def on_tick(self, t_ns: int) -> Step:
        """Simulate up to t_ns and send what is due, in the order of time.

        Of several encoder readings only the newest is sent.
        """
        bench, shutter, setpoints = self._bench, self._shutter, self._setpoints
        end_ns = min(t_ns, bench.t_ns + MAX_CATCH_UP_NS)
        sends: list[Send] = []
        readings = 0
        while True:
            shutter_ns = shutter.next_ns if shutter else NEVER_NS
            setpoint_ns = setpoints[0][0] if setpoints else NEVER_NS
            due_ns = min(self._tick_ns, shutter_ns, setpoint_ns)
            if due_ns > end_ns:
                break
            bench.advance(max(due_ns, bench.t_ns))
            if due_ns == self._tick_ns:
                read_ns, position_m, velocity_m_s = due_ns, bench.position_m, bench.velocity_m_s
                readings += 1
                self._tick_ns += TICK_NS
                if due_ns % TRUTH_NS == 0:
                    sends.append(Send("truth", self._truth(due_ns, position_m, velocity_m_s), t_ns))
            if shutter and due_ns == shutter_ns and (exposure := shutter.sample(bench)):
                sends.append(Send("frame_1", self._frame(exposure, shutter.exposure_ns), t_ns))
            if setpoints and due_ns == setpoint_ns:
                bench.set_setpoint(setpoints.popleft()[1])
        if readings:
            self.late_ticks += readings - 1
            seq = self._seq("joint_state")
            reading = axis_state(seq, read_ns, position_m, velocity_m_s)
            sends.append(Send("joint_state", reading, t_ns))
        wake_ns = min(self._tick_ns, shutter.closes_ns) if shutter else self._tick_ns
        return Step(sends, max(wake_ns, t_ns))

    def _take_setpoint(self, message: Setpoint, t_ns: int) -> Step:
        """Queue a setpoint; stop at the one before where it is outside the bounds."""
        if self._phase is Phase.FAULT:
            return NO_STEP
        self._phase = Phase.RUNNING
        position_m = message.position_m
        if position_m is None:
            text = f"setpoint of {message.count} joints in {message.space.value}"
            return self._stop_by_itself(f"{text}; must be x, y, z in m", t_ns)
        if self._check is not None:
            excess = self._check.excess(message.seq, message.t_ns, position_m)
            if excess is not None and self._check.stops:
                return self._stop_by_itself(f"setpoint outside the envelope: {excess}", t_ns)
        if position_m != self._setpoint_m:  # unchanged: no stop of the integration
            self._setpoint_m = position_m
            effective_ns = t_ns - t_ns % DRIVE_SAMPLE_NS + DRIVE_SAMPLE_NS
            self._setpoints.append((effective_ns, position_m))
        return NO_STEP

    def _stop_by_itself(self, text: str, t_ns: int) -> Step:
        self._phase = Phase.FAULT
        text = f"{text}; the robot stopped by itself"
        return Step([self._replies.give_up(self._phase, t_ns, text, FAULT_CODE)])

    def stop(self, t_ns: int) -> Step:
        """Do nothing; no shutdown action."""
        return NO_STEP

    def _truth(self, t_ns: int, position_m: Position, velocity_m_s: Velocity) -> Truth:
        link = LinkMotion(
            angle_x_rad=self._bench.angle_rad,
            angle_y_rad=0.0,
            rate_x_rad_s=self._bench.angular_velocity_rad_s,
            rate_y_rad_s=0.0,
        )
        return Truth(
            seq=self._seq("truth"),
            t_ns=t_ns,
            position_m=position_m,
            velocity_m_s=velocity_m_s,
            links=(link,),
        )

    def _frame(self, exposure: Exposure, exposure_ns: int) -> Frame:
        height, width = exposure.pixels.shape
        return Frame(
            seq=self._seq("frame_1"),
            t_ns=exposure.start_ns + exposure_ns,
            t_exposure_start_ns=exposure.start_ns,
            exposure_ns=exposure_ns,
            row_ns=0,
            camera=self._params.camera.name,
            encoding="mono8",
            height=height,
            width=width,
            pixels=exposure.pixels,
        )

    def _seq(self, channel: str) -> int:
        """Return the next sequence number of a channel, from 0."""
        seq = self._sent[channel]
        self._sent[channel] = seq + 1
        return seq
