"""One task behind real sockets: admitted, ordered, answered, accounted for, and never left alone with the robot."""

from __future__ import annotations

import gc
import select
import threading
from collections.abc import Callable, Iterator

import pytest
import zmq

from comms import runner
from comms.clock import MonotonicClock, new_run_clock
from comms.codec import Closing, decode, encode, encode_closing
from comms.link import LinkCount, LinkFaults, LinkModel, settle
from comms.messages import AngleSample, Command, JointState, Message, Phase, Reason, Reply, Setpoint, Verb
from comms.operator_bus import Context, Hello, OperatorBus, Record, Tapped
from comms.records import LinkRow, Receipts, Timing
from comms.runner import ORPHANED, WallRunner, Wiring
from comms.task import NOTHING, Send, Step
from comms.udp import UdpReceiver, UdpSender, free_port
from tests.wire_words import SESSION

HOST, MS = "127.0.0.1", 1_000_000
LOOKS, LOOK_MS = 200, 25  # five seconds; only a failure takes them
PACKETS = 40


class Echo:
    """As `bench`: each Setpoint comes back as the JointState of the same number; a tick every 5 ms; replies to orders."""

    name = "bench"

    def __init__(self) -> None:
        self.late_ticks = 0
        self.stopped = False
        self.ticks: list[int] = []

    def start(self, t_ns: int) -> Step:
        return Step(wake_ns=t_ns + 5 * MS)

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        if isinstance(message, Command):
            return Step([Send("reply", self.answer(message, t_ns), t_ns)])
        assert isinstance(message, Setpoint)
        echo = JointState(seq=message.seq, t_ns=t_ns, position_m=message.position_m, velocity_m_s=(0.0, 0.0, 0.0))
        return Step([Send("joint_state", echo, t_ns)])

    def answer(self, order: Command, t_ns: int) -> Reply:
        return Reply(seq=0, t_ns=t_ns, id=order.id, sender="bench", ok=True, phase=Phase.ARMED, text=order.verb.value)

    def on_tick(self, t_ns: int) -> Step:
        self.ticks.append(t_ns)
        return Step(wake_ns=t_ns + 5 * MS)

    def stop(self, t_ns: int) -> Step:
        self.stopped = True
        return NOTHING
