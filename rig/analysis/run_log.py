"""A run's log as arrays: what was planned, commanded, done, seen and (simulated) true, on the run clock in seconds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from comms.errors import LogError
from comms.mcap_log import Log, read_log
from comms.messages import AngleSample, Command, Reference, RobotState, Truth, Verb
from comms.plan_record import PlanRecord
from comms.records import CompressedImage, Event, FrameStamp, LinkRow, Receipts, TaskTiming
from rig.analysis.facts import RunFacts, read_facts

FloatArray = npt.NDArray[np.float64]
SETTLE_S = 0.30  # after the planned end: the platform lags the plan by about 60 ms


@dataclass(frozen=True)
class RunLog:
    """Everything analysis and report need of one run; raises LogError when the file is no run of ours."""

    log: Log

    @classmethod
    def open(cls, path: Path) -> RunLog:
        """Read run.mcap, complete or cut short."""
        run = cls(read_log(path))
        for name in ("experiment.json", "plan.json"):
            if name not in run.log.attachments:
                raise LogError(f"{path}: cut before '{name}': nothing to analyse it by")
        try:
            _ = run.facts, run.plan, run.world
        except msgspec.MsgspecError as error:
            raise LogError(
                f"{path}: an attachment cannot be read ({error}): damaged, or of another version"
            ) from error
        return run

    @property
    def folder(self) -> Path:
        """Where the log lies."""
        return self.log.path.parent

    @cached_property
    def facts(self) -> RunFacts:
        """The keys of the experiment that the analysis needs. Raises LogError naming one that is missing."""
        return read_facts(self.log.attachments["experiment.json"], self.log.path)

    @cached_property
    def plan(self) -> PlanRecord:
        """The plan as it was played."""
        return msgspec.json.decode(self.log.attachments["plan.json"], type=PlanRecord)

    @cached_property
    def world(self) -> dict[str, Any]:
        """The simulated bench's parameters; {} on a real rig."""
        world: dict[str, Any] = msgspec.json.decode(self.log.attachments.get("bench.json", b"{}"))
        return world

    @cached_property
    def t_start_s(self) -> float | None:
        """The instant the start order named; None when the run never started."""
        starts = [c.t_start_ns for c in self.log.read("/command", Command) if c.verb is Verb.START]
        return starts[0] * 1e-9 if starts else None

    @property
    def t_move_s(self) -> float:
        """Start of the move."""
        return (self.t_start_s or 0.0) + self.plan.quiet_s

    @property
    def t_settled_s(self) -> float:
        """The instant residual swing is told for: planned end + 0.30 s."""
        return self.t_move_s + self.plan.time_s + SETTLE_S

    @cached_property
    def angles(self) -> list[AngleSample]:
        """Every angle sample, valid or not."""
        return self.log.read("/angle", AngleSample)

    @cached_property
    def swing(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Valid angles: instants [s], angles [rad], sigmas [rad], each (N,)."""
        rows = [
            (a.t_valid_ns * 1e-9, a.angle_rad, a.sigma_rad)
            for a in self.angles
            if a.angle_rad is not None
        ]
        t, angle, sigma = np.array(rows, dtype=np.float64).reshape(-1, 3).T
        keep = np.concatenate([[True], np.diff(t) > 0]) if t.size else np.zeros(0, dtype=bool)
        return t[keep], angle[keep], sigma[keep]

    @cached_property
    def single_frames(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Angles of single frames, offset removed, not averaged: for peaks, which an average flattens. As swing; t is rough."""
        frames = math.sqrt(self.facts.average_frames)
        rows = [
            (a.t_valid_ns * 1e-9, a.raw_rad - (a.offset_rad or 0.0), (a.sigma_rad or 0.0) * frames)
            for a in self.angles
            if a.raw_rad is not None
        ]
        t, angle, sigma = np.array(rows, dtype=np.float64).reshape(-1, 3).T
        return t, angle, sigma

    @property
    def uncounted(self) -> list[str]:
        """Ends of links whose count never came: "link: task"."""
        return [
            line
            for line in self.log.metadata.get("run.stop", {}).get("uncounted", "").splitlines()
            if line
        ]

    @cached_property
    def truth(self) -> FloatArray:
        """(N, 4): instant [s], angle [rad], rate [rad/s], platform x [m]; (0, 4) on a real rig."""
        rows = [
            (t.t_ns * 1e-9, t.angle_rad, t.angular_velocity_rad_s, t.position_m[0])
            for t in self.log.read("/truth", Truth)
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, 4)

    @cached_property
    def robot(self) -> FloatArray:
        """(N, 4): instant of sending [s], commanded x [m], instant of measuring [s], actual x [m]."""
        states = self.log.read("/robot_state", RobotState)
        rows = [
            (s.t_ns * 1e-9, s.commanded_m[0], s.t_actual_ns * 1e-9, s.actual_m[0]) for s in states
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, 4)

    def planned_m(self, t_s: FloatArray) -> FloatArray:
        """Planned x [m] at t_s (N,), at rest before and after."""
        x = np.array([p[0] for p in self.plan.positions_m])
        grid = (self.t_start_s or 0.0) + self.plan.period_ns * 1e-9 * np.arange(x.size)
        return np.asarray(np.interp(t_s, grid, x), dtype=np.float64)

    def receipts(self, channel: str) -> dict[int, int]:
        """Sequence number -> arrival [ns] of what was accepted."""
        rows = [row for r in self.log.read(f"/receipts/{channel}", Receipts) for row in r.rows]
        return {seq: t_rx for seq, t_rx, outcome in rows if not outcome}

    @cached_property
    def frames(self) -> dict[int, FrameStamp]:
        """Frames by sequence number."""
        return {f.seq: f for f in self.log.read("/frame", FrameStamp)}

    def references(self) -> list[Reference]:
        """What the streamer sent."""
        return self.log.read("/reference", Reference)

    def links(self) -> dict[str, LinkRow]:
        """The settled ledger."""
        topics = [topic for topic in self.log.topics if topic.startswith("/link/")]
        rows = [row for topic in topics for row in self.log.read(topic, LinkRow)]
        return {row.channel: row for row in rows}

    def late_ticks(self) -> dict[str, int]:
        """Ticks each task skipped."""
        topics = [topic for topic in self.log.topics if topic.startswith("/timing/")]
        rows = [row for topic in topics for row in self.log.read(topic, TaskTiming)]
        return {row.task: row.late_ticks for row in rows}

    def events(self) -> list[Event]:
        """What was worth noting."""
        return self.log.read("/events", Event)

    def pictures(self) -> list[CompressedImage]:
        """The pictures kept for people."""
        return self.log.read("/camera/image", CompressedImage)

    @property
    def true_omega_rad_s(self) -> float | None:
        """Small-amplitude natural frequency of the simulated load."""
        load = self.world.get("pendulum")
        return math.sqrt(load["gravity_m_s2"] / load["length_m"]) if load else None
