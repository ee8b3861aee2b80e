"""Pictures in the log of a run, with their own time stamps. It reads the log file by comms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from comms.errors import LogError
from comms.mcap_log import Log, read_log
from comms.messages import AngleSample, RobotState, SwingPlane
from comms.records import CompressedImage, picture_topic
from vision.errors import VisionError
from vision.stream import About, SourceFrame, SourceOptions, StampKind, StreamFinding
from vision.stream_check import checked, spread_evenly, within

MIN_SPREAD_M2 = 1e-6  # sum of squares, of a platform that moved
LOG_NAME = "run.mcap"
NS = 1_000_000_000


class LogSource:
    """Pictures of a camera in the log of a run.

    The log keeps some of the pictures, as JPEG, with the middle of their exposure on the run clock.
    """

    def __init__(self, where: Path, options: SourceOptions) -> None:
        """where: folder of a run, or its log; raises VisionError."""
        self._options = options
        self.findings: list[StreamFinding] = []
        path = where / LOG_NAME if where.is_dir() else where
        topic = picture_topic(f"frame_{options.camera}")
        try:
            log = read_log(path)
        except LogError as error:
            raise VisionError(str(error)) from error
        self._pivot = _pivot_of(log, options.camera)
        self._pictures: list[CompressedImage] = log.read(topic, CompressedImage)
        if not self._pictures:
            topics = [name for name in log.topics if name.endswith("/image")]
            known = ", ".join(topics) or "none at all"
            raise VisionError(
                f"{path}: no pictures on {topic}; the log has {known}: "
                "choose another camera, or record the run again with its pictures"
            )
        first = _decoded(self._pictures[0])
        if first is None:
            raise VisionError(f"{path}: the first picture on {topic} cannot be decoded: run again")
        self.about = About(
            name=str(path),
            kind="log",
            width=first.shape[1],
            height=first.shape[0],
            rate_hz=None,
            frames=len(self._pictures),
            codec=self._pictures[0].format,
            is_live=False,
        )

    def frames(self) -> Iterator[SourceFrame]:
        """Read all pictures from from_s to to_s."""
        self.findings.clear()
        yield from checked(within(self._read(), self._options), self.findings)

    def spread(self, count: int) -> list[SourceFrame]:
        """Read count pictures, or all if there are fewer, spread over from_s to to_s."""
        return spread_evenly(within(self._read(), self._options), count)

    def _read(self) -> Iterator[SourceFrame]:
        first_ns = _stamp_ns(self._pictures[0])
        for number, picture in enumerate(self._pictures):
            image = _decoded(picture)
            if image is not None:
                t_ns = _stamp_ns(picture)
                pivot_px = None if self._pivot is None else self._pivot.at(t_ns)
                yield SourceFrame(
                    number, (t_ns - first_ns) / NS, StampKind.LOG, image, pivot_px=pivot_px
                )


class _MovingPivot:
    """Pivot over time: a straight line over the position of the platform, as the run used it."""

    def __init__(self, states: Sequence[RobotState], samples: Sequence[AngleSample]) -> None:
        placed = [
            (sample.platform_m, *sample.links[0].joint_px)
            for sample in samples
            if sample.platform_m is not None and sample.links and sample.links[0].joint_px
        ]
        place_m, column_px, row_px = np.array(placed).T
        apart_m = place_m - place_m.mean()
        spread = float(apart_m @ apart_m)
        self._scale = float(apart_m @ column_px) / spread if spread > MIN_SPREAD_M2 else 0.0
        self._home_px = float(column_px.mean()) - self._scale * float(place_m.mean())
        self._row_px = float(np.median(row_px))
        axis = 0 if samples[0].swing_plane is SwingPlane.X else 1
        self._t_ns = [state.t_actual_ns for state in states]
        self._place_m = [state.actual_m[axis] for state in states]

    def at(self, t_ns: int) -> tuple[float, float]:
        """Compute the pivot at a time of the run."""
        place_m = float(np.interp(t_ns, self._t_ns, self._place_m))
        return self._home_px + self._scale * place_m, self._row_px


def _pivot_of(log: Log, camera: int) -> _MovingPivot | None:
    states = log.read("/robot_state", RobotState)
    samples = log.read(f"/angle_{camera}", AngleSample)
    located = [sample for sample in samples if sample.links and sample.platform_m is not None]
    return _MovingPivot(states, located) if states and located else None


def _stamp_ns(picture: CompressedImage) -> int:
    return picture.timestamp.sec * NS + picture.timestamp.nsec


def _decoded(picture: CompressedImage) -> np.ndarray | None:
    data = np.frombuffer(picture.data, np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_ANYCOLOR)
    return None if image is None else np.asarray(image, np.uint8)
