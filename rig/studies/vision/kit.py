"""Benchmark of cable trackers on scenes with known truth; for `rig track` and for other programs.

from rig.studies.vision import kit

results = kit.run(["clean"], {"mine": MyTracker}, frames=50)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from msgspec import Struct

from comms.clock import stopwatch_s
from rig.errors import ConfigError
from rig.studies.vision import tracker_class
from rig.studies.vision.peers import PEERS
from rig.studies.vision.scene import (
    Scene,
    SceneFrame,
    picture_size,
    read_scene,
    scene_frames,
    shipped_scenes,
)
from rig.studies.vision.score import Angles, Bars, Expect, Score, failures, score
from rig.studies.vision.tracker_class import Place, load_tracker
from vision.line_fit import Grey
from vision.protocol import CableAngle, TrackerClass
from vision.sources import red_plane
from vision.video_tracker import VideoTracker

__all__ = ["OURS", "PEERS", "PEER_STEP", "SceneResult", "load_tracker", "run", "shipped_scenes"]

PEER_STEP = 10  # the peers measure one frame in ten: they are some 15 times slower
PREPARED_PICTURES = 30  # given to a tracker with a method prepare, before the first frame
OURS: dict[str, TrackerClass] = {"ours": VideoTracker}


class SceneResult(Struct, frozen=True, kw_only=True):
    """Figures of a tracker on a scene."""

    scene: str
    about: str
    expect: Expect
    tracker: str
    score: Score
    failures: list[str]  # figures beyond the bars of the scene, each with value and bound
    seconds: float  # spent in the tracker

    @property
    def passed(self) -> bool:
        """True if every figure is within the bars of the scene."""
        return not self.failures


def run(
    scenes: Sequence[str],
    trackers: Mapping[str, TrackerClass],
    frames: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[SceneResult]:
    """Measure the frames of every scene with every tracker; results scene by scene.

    scenes: names of shipped scenes, or paths of scene files. trackers: class by name; a new
    instance for each scene. frames: of each scene, at most its own number, which is the default. A
    tracker in PEERS measures one frame in PEER_STEP. A tracker with a method prepare is first given
    PREPARED_PICTURES of the frames, spread over them. progress is given the number of frames done.
    Raises ConfigError for an unknown scene, and for a tracker that fails or gives no angle.
    """
    if frames is not None and frames < 1:
        raise ConfigError(f"frames = {frames}; must be 1 or more: give the frames of each scene")
    results: list[SceneResult] = []
    done = 0
    for scene in [read_scene(name) for name in scenes]:
        parts = [_TrackerRun(scene, name, kind) for name, kind in trackers.items()]
        count = frame_count(scene, frames)
        _prepare(parts, scene, count)
        for frame in scene_frames(scene, count):
            for part in parts:
                part.measure(frame)
            done += 1
            if progress is not None:
                progress(done)
        results += [part.result() for part in parts]
    return results


def frame_count(scene: Scene, frames: int | None) -> int:
    """Choose the number of frames of a scene: its own, or fewer."""
    own = scene.section.frames
    return own if frames is None else min(frames, own)


def _prepare(parts: Sequence[_TrackerRun], scene: Scene, frames: int) -> None:
    """Show spread frames to the trackers that want them; the scene is rendered once more for it."""
    wanting = [part for part in parts if part.is_preparing]
    if not wanting:
        return
    chosen = set(np.linspace(0, frames - 1, PREPARED_PICTURES).round().astype(int).tolist())
    spread = [frame for frame in scene_frames(scene, frames) if frame.number in chosen]
    for part in wanting:
        part.prepare(spread)


class _TrackerRun:
    """One tracker on one scene."""

    def __init__(self, scene: Scene, name: str, kind: TrackerClass) -> None:
        self._scene = scene
        self._name = name
        self._is_colour = bool(getattr(kind, "colour", False))
        self._step = PEER_STEP if kind in PEERS.values() else 1
        start = Place(name, scene.name, 0)
        self._tracker = tracker_class.construct(start, kind, picture_size(scene))
        self._rows: list[tuple[float, float, float, float]] = []
        self._seconds = 0.0

    @property
    def is_preparing(self) -> bool:
        """True if the tracker has a method prepare."""
        return callable(getattr(self._tracker, "prepare", None))

    def prepare(self, frames: Sequence[SceneFrame]) -> None:
        """Give copies of the pictures to the tracker; not timed."""
        pictures = [_own_picture(frame, self._is_colour) for frame in frames]
        place = Place(self._name, self._scene.name, 0)
        tracker_class.prepare(place, self._tracker, pictures, [f.pivot_px for f in frames])

    def measure(self, frame: SceneFrame) -> None:
        """Measure a frame; only the call of the tracker is timed."""
        if frame.number % self._step:
            return
        place = Place(self._name, self._scene.name, frame.number)
        picture = _own_picture(frame, self._is_colour)
        start_s = stopwatch_s()
        result = tracker_class.measured(place, self._tracker, picture, frame.pivot_px)
        self._seconds += stopwatch_s() - start_s
        self._rows.append(_row(frame, tracker_class.check_result(place, result)))

    def result(self) -> SceneResult:
        """Compute the figures of the frames measured."""
        scene = self._scene
        angles = Angles(*np.array(self._rows).T)
        found = score(angles, self._seconds, scene.expect)
        return SceneResult(
            scene=scene.name,
            about=scene.about,
            expect=scene.expect,
            tracker=self._name,
            score=found,
            failures=failures(found, scene.bars or Bars()),
            seconds=self._seconds,
        )


def _own_picture(frame: SceneFrame, is_colour: bool) -> Grey:
    """Copy the picture that a tracker is given, which it may change."""
    if is_colour and frame.picture.ndim == 2:
        return np.repeat(frame.picture[:, :, None], 3, axis=2)
    picture = frame.picture if is_colour else red_plane(frame.picture)
    return np.array(picture, order="C")


def _row(frame: SceneFrame, measured: CableAngle) -> tuple[float, float, float, float]:
    """Collect the values of Angles; NaN where a value is absent."""
    return (
        _or_nan(frame.angle_rad),
        _or_nan(measured.angle_rad),
        _or_nan(measured.sigma_rad),
        _or_nan(frame.bound_rad),
    )


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value
