"""Handlers of what the tasks send to the operator: presence, replies, records and telemetry."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

from comms.bus_content import Content, Hello, Record, StreamEnd, Telemetry
from comms.codec import Reject, decode
from comms.frames import with_pixels
from comms.messages import CanMessage, Frame, Message, Reply, RobotState
from comms.records import LinkRow, TaskTiming
from comms.task import Step
from rig.run.recorder import Recorder
from rig.run.runtime.channel_counts import ChannelCounts
from rig.run.runtime.robot_watch import RobotWatch
from rig.run.runtime.roster import Roster
from rig.run.runtime.starvation import Starvation
from rig.run.tasks.operator import Operator


class Inbox:
    """Table of handlers by type of message."""

    def __init__(
        self,
        tasks: Collection[str],
        session: int,
        operator: Operator,
        recorder: Recorder,
        carry_out: Callable[[Step], None],
        robot: RobotWatch,
    ) -> None:
        """carry_out: receives what the operator returns."""
        self.roster = Roster()
        self.counts = ChannelCounts(tasks)
        self.starvation = Starvation()
        self.robot = robot
        self.foreign = 0  # telemetry of no task of this run
        self._session = session
        self._operator = operator
        self._recorder = recorder
        self._carry_out = carry_out
        self._handlers: dict[type, Callable[[str, Any, int], None]] = {
            Hello: self._on_hello,
            StreamEnd: self._on_stream_end,
            Reply: self._on_reply,
            Record: self._on_record,
        }

    def handle(self, sender: str, content: Content, now_ns: int) -> None:
        """Handle one message of a task; telemetry names no sender."""
        if isinstance(content, Telemetry):
            self._log_telemetry(content, now_ns)
        else:
            self._handlers[type(content)](sender, content, now_ns)

    def _on_hello(self, task: str, hello: Hello, now_ns: int) -> None:
        self.roster.present.add(task)

    def _on_stream_end(self, task: str, end: StreamEnd, now_ns: int) -> None:
        self.roster.left.add((task, end.socket))

    def _on_reply(self, task: str, reply: Reply, now_ns: int) -> None:
        self._recorder.message("reply", reply, now_ns)
        self.robot.take_reply(reply)
        self._carry_out(self._operator.on_message("reply", reply, now_ns))

    def _on_record(self, task: str, content: Record, now_ns: int) -> None:
        record = content.record
        if isinstance(record, LinkRow):
            self.counts.add(record.channel, task, record.count)
            return
        if isinstance(record, TaskTiming):
            self.starvation.add(task, record.lateness_ns)
        self._recorder.record(record, now_ns)

    def _log_telemetry(self, telemetry: Telemetry, now_ns: int) -> None:
        message = decode(telemetry.channel, telemetry.data, self._session)
        if isinstance(message, Reject):
            self.foreign += 1
        elif isinstance(message, Frame) and telemetry.pixels is not None:
            frame = with_pixels(message, memoryview(telemetry.pixels))
            if isinstance(frame, Frame):
                self._recorder.picture(telemetry.channel, frame, now_ns)
        elif isinstance(message, Message):
            if isinstance(message, RobotState):
                self.robot.take_state(message)
            elif isinstance(message, CanMessage):
                self.robot.take_frame(message)
            self._recorder.message(telemetry.channel, message, now_ns)
