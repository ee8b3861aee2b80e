"""The log of a run as arrays: plan, commanded and actual position, angle, and simulated truth.

Times are seconds on the run clock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from comms.channels import MAX_CAMERAS
from comms.errors import LogError
from comms.mcap_log import Log, read_log
from comms.messages import AngleSample, Command, Reference, RobotState, SwingPlane, Truth, Verb
from comms.plan_record import PlanRecord
from comms.records import CompressedImage, Event, FrameStamp, LinkRow, Receipts, TaskTiming
from rig.analysis.angle_scale import CORRECTED, AngleScale, angle_scale
from rig.analysis.both_planes import camera_centre_m, in_one_plane
from rig.analysis.facts import ControllerFacts, RunFacts, read_facts
from rig.analysis.seen_swing import FloatArray, SeenSwing, averaged, of_single_frames

SETTLE_S = 0.30  # after the planned end; the platform lags the plan by about 60 ms


@dataclass(frozen=True)
class RunLog:
    """Log of one run; raises LogError for a file that is not the log of a run."""

    log: Log

    @classmethod
    def open(cls, path: Path) -> RunLog:
        """Read run.mcap, complete or truncated."""
        run = cls(read_log(path))
        for name in ("experiment.json", "plan.json"):
            if name not in run.log.attachments:
                raise LogError(
                    f"{path}: has no '{name}'; the analysis needs it: "
                    "the log was truncated before it, run again"
                )
        try:
            _ = run.facts, run.plan, run.plant_params, run.controller
        except msgspec.MsgspecError as error:
            raise LogError(
                f"{path}: an attachment cannot be read ({error}): damaged, or of another version"
            ) from error
        return run

    @property
    def folder(self) -> Path:
        """Folder of the log."""
        return self.log.path.parent

    @cached_property
    def facts(self) -> RunFacts:
        """Keys of the experiment that the analysis needs; raises LogError naming a missing one."""
        return read_facts(self.log.attachments["experiment.json"], self.log.path)

    @cached_property
    def plan(self) -> PlanRecord:
        """Plan on the grid of the references."""
        return msgspec.json.decode(self.log.attachments["plan.json"], type=PlanRecord)

    @cached_property
    def plant_params(self) -> dict[str, Any]:
        """Parameters of the simulated plant; {} on a real rig."""
        data = self.log.attachments.get("bench.json", b"{}")
        params: dict[str, Any] = msgspec.json.decode(data)
        return params

    @cached_property
    def controller(self) -> ControllerFacts:
        """Settings of the controller that the analysis needs."""
        data = self.log.attachments.get("controller.json", b"{}")
        return msgspec.json.decode(data, type=ControllerFacts)

    @cached_property
    def t_start_s(self) -> float | None:
        """Start of the run as ordered [s]; None when the run never started."""
        starts = [c.t_start_ns for c in self.log.read("/command", Command) if c.verb is Verb.START]
        return starts[0] * 1e-9 if starts else None

    @property
    def t_move_s(self) -> float:
        """Start of the move [s]."""
        return (self.t_start_s or 0.0) + self.plan.quiet_s

    @property
    def t_settled_s(self) -> float:
        """Instant of the residual swing [s]: planned end + 0.30 s + delay of the controller."""
        return self.t_move_s + self.plan.time_s + SETTLE_S + self.controller.delay_s

    @property
    def swing_window_s(self) -> tuple[float, float]:
        """Interval of the peak swing [s]: the move until settled, or all of a free decay."""
        if self.plan.time_s > 0:
            return self.t_move_s, self.t_settled_s
        return self.t_move_s, self.t_move_s + self.plan.watch_s

    @cached_property
    def angles(self) -> list[AngleSample]:
        """All angle samples of the camera that sees the swing along the move, valid or not."""
        return self.angles_of(self.main_camera)

    def angles_of(self, camera: int) -> list[AngleSample]:
        """Read all angle samples of a camera, counted from 1, valid or not."""
        return self.log.read(f"/angle_{camera}", AngleSample)

    @cached_property
    def _camera_of_y(self) -> int | None:
        """Number of the first camera that sees the swing in the plane y; None without one."""
        for camera in range(2, MAX_CAMERAS + 1):
            planes = {sample.swing_plane for sample in self.angles_of(camera)}
            if SwingPlane.Y in planes:
                return camera
        return None

    @property
    def main_plane(self) -> int:
        """Plane of the swing that is analysed: 0 for x, 1 for y where the plan moves there.

        It is x where cameras see that plane alone.
        """
        is_seen = self._camera_of_y is not None or not self.facts.rate_hz
        return int(self.main_axis == 1 and is_seen)

    @property
    def main_camera(self) -> int:
        """Number of the camera that sees the main plane; the first one without any."""
        return (self._camera_of_y or 1) if self.main_plane == 1 else 1

    @property
    def across_camera(self) -> int | None:
        """Number of the camera that sees the swing across the main plane; None without one."""
        if self._camera_of_y is None:
            return None
        return 1 if self.main_plane == 1 else self._camera_of_y

    @cached_property
    def swing(self) -> SeenSwing:
        """Valid averaged angles in the main plane."""
        return self.swing_of(self.main_camera)

    @cached_property
    def single_frames(self) -> SeenSwing:
        """Angles of single frames in the main plane."""
        return self.single_frames_of(self.main_camera)

    def swing_of(self, camera: int) -> SeenSwing:
        """Compute the valid averaged angles in the plane of a camera."""
        return self._in_one_plane(self._scaled(averaged(self.angles_of(camera)), camera), camera)

    def single_frames_of(self, camera: int) -> SeenSwing:
        """Compute the angles of single frames in the plane of a camera."""
        seen = of_single_frames(self.angles_of(camera), self.facts.average_frames)
        return self._in_one_plane(self._scaled(seen, camera), camera)

    def angle_scale_of(self, camera: int) -> AngleScale:
        """Find the scale of the angles of a camera, by what its task knew."""
        words = self.log.metadata.get("run.start", {}).get("angle_scale", "").split(", ")
        word = words[camera - 1] if camera <= len(words) else words[0]
        data = self.log.attachments.get(_settings_name(camera))
        return angle_scale(data, word == CORRECTED) if data else AngleScale()

    def _scaled(self, seen: SeenSwing, camera: int) -> SeenSwing:
        """Remove the perspective that the task of the camera has left."""
        factor = self.angle_scale_of(camera).factor
        if factor == 1.0:
            return seen
        angle_rad = np.arctan(factor * np.tan(seen.angle_rad))
        return SeenSwing(seen.t_s, angle_rad, factor * seen.sigma_rad)

    def _in_one_plane(self, seen: SeenSwing, camera: int) -> SeenSwing:
        """Take out the swing across, which a second camera with a camera file sees."""
        main, across = self.main_camera, self.across_camera
        if across is None or camera not in (main, across):
            return seen
        other = across if camera == main else main
        own_m, other_m = self._centre_m(camera), self._centre_m(other)
        if own_m is None or other_m is None or not seen.t_s.size:
            return seen
        axis = self.main_plane if camera == main else 1 - self.main_plane
        others = averaged(self.angles_of(other))
        return in_one_plane(seen, others, self._positions_m(seen.t_s), (own_m, other_m), axis)

    def _centre_m(self, camera: int) -> FloatArray | None:
        """Find the centre (3,) of a camera; None without a camera file."""
        data = self.log.attachments.get(_settings_name(camera))
        return camera_centre_m(data) if data else None

    def _positions_m(self, t_s: FloatArray) -> FloatArray:
        """Interpolate the actual position of the platform (N, 3) at t_s (N,)."""
        states = self.log.read("/robot_state", RobotState)
        at_s = [state.t_actual_ns * 1e-9 for state in states]
        places = np.array([state.actual_m for state in states]).reshape(-1, 3)
        columns = [np.interp(t_s, at_s, places[:, axis]) for axis in range(3)]
        return np.stack(columns, axis=1)

    @property
    def uncounted(self) -> list[str]:
        """Ends of links without a count, as "link: task"."""
        text = self.log.metadata.get("run.stop", {}).get("uncounted", "")
        return [line for line in text.splitlines() if line]

    @cached_property
    def truth(self) -> FloatArray:
        """Truth of the platform and of the link on it (N, 4); (0, 4) on a real rig.

        In the main plane. Columns: instant [s], angle [rad], rate
        [rad/s], position of the platform [m].
        """
        is_y = self.main_plane == 1
        rows = []
        for t in self.log.read("/truth", Truth):
            if t.links:
                link = t.links[0]
                swing = (link.angle_x_rad, link.rate_x_rad_s)
                if is_y:
                    swing = (link.angle_y_rad, link.rate_y_rad_s)
                rows.append((t.t_ns * 1e-9, *swing, t.position_m[int(is_y)]))
        return np.array(rows, dtype=np.float64).reshape(-1, 4)

    @cached_property
    def main_axis(self) -> int:
        """Axis along which the plan moves most: 0, 1, 2 for x, y, z."""
        positions = np.array(self.plan.positions_m).reshape(-1, 3)
        return int(np.argmax(np.ptp(positions, axis=0)))

    @cached_property
    def robot(self) -> FloatArray:
        """Robot states along the main axis (N, 4).

        Columns: instant of sending [s], commanded [m], instant of measuring [s], actual [m].
        """
        states = self.log.read("/robot_state", RobotState)
        axis = self.main_axis
        rows = [
            (s.t_ns * 1e-9, s.commanded_m[axis], s.t_actual_ns * 1e-9, s.actual_m[axis])
            for s in states
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, 4)

    def planned_m(self, t_s: FloatArray) -> FloatArray:
        """Interpolate the plan along the main axis [m] at t_s (N,); at rest before and after."""
        x = np.array([p[self.main_axis] for p in self.plan.positions_m])
        grid = (self.t_start_s or 0.0) + self.plan.period_ns * 1e-9 * np.arange(x.size)
        return np.asarray(np.interp(t_s, grid, x), dtype=np.float64)

    def receipts(self, channel: str) -> dict[int, int]:
        """Read the arrivals [ns] of the accepted messages, by sequence number."""
        rows = [row for r in self.log.read(f"/receipts/{channel}", Receipts) for row in r.rows]
        return {seq: t_rx for seq, t_rx, outcome in rows if not outcome}

    @cached_property
    def frames(self) -> dict[int, FrameStamp]:
        """Stamps of the frames of the main camera by sequence number."""
        return {f.seq: f for f in self.log.read(f"/frame_{self.main_camera}", FrameStamp)}

    def references(self) -> list[Reference]:
        """Read the references that the streamer sent."""
        return self.log.read("/reference", Reference)

    def links(self) -> dict[str, LinkRow]:
        """Read the settled ledger, by channel."""
        topics = [topic for topic in self.log.topics if topic.startswith("/link/")]
        rows = [row for topic in topics for row in self.log.read(topic, LinkRow)]
        return {row.channel: row for row in rows}

    def late_ticks(self) -> dict[str, int]:
        """Read the number of late ticks of each task."""
        topics = [topic for topic in self.log.topics if topic.startswith("/timing/")]
        rows = [row for topic in topics for row in self.log.read(topic, TaskTiming)]
        return {row.task: row.late_ticks for row in rows}

    def events(self) -> list[Event]:
        """Read the events of the run."""
        return self.log.read("/events", Event)

    def pictures(self) -> list[CompressedImage]:
        """Read the pictures in the log."""
        return self.log.read("/camera/image", CompressedImage)

    @property
    def true_omega_rad_s(self) -> float | None:
        """Small-amplitude natural frequency of the simulated load [rad/s]; None on a real rig."""
        if self.plan.angle_rad is not None:
            return None  # an elastic joint
        load = self.plant_params.get("pendulum")
        return math.sqrt(load["gravity_m_s2"] / load["length_m"]) if load else None


def _settings_name(camera: int) -> str:
    return "vision.json" if camera == 1 else f"vision_{camera}.json"
