"""Vision task of one camera: averaged cable angle with time stamp, from frames and positions."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import msgspec
import numpy as np

from comms.channels import vision_task
from comms.messages import (
    AngleSample,
    Command,
    Frame,
    InvalidReason,
    LinkAngle,
    Message,
    Phase,
    Position,
    RobotState,
    SwingPlane,
)
from comms.replies import Replies
from comms.task import NO_STEP, Send, Step
from vision.cable_geometry import CableGeometry, ModelGeometry, TableGeometry
from vision.camera_model import CameraParameters, SeenLine
from vision.errors import VisionError
from vision.filters import Angle, MovingAverage
from vision.fitted_line import readout_rows, seen_line
from vision.geometry import PivotModel, TrueAngle
from vision.line_fit import Grey
from vision.offset_table import LightOffsets, Offset, OffsetTable
from vision.platform_track import PlatformPoint, PlatformTrack
from vision.ridge import grey_levels
from vision.scene_check import SceneCheck
from vision.sources import red_plane
from vision.static_scene import StaticScene
from vision.templates import CableLook, make_templates
from vision.tracker import Fit, Tracker

MAX_GAP_PERIODS = 1.5  # between two time stamps; beyond, a frame is missing


class VisionSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the task. Without offset table (x_m, offset_rad empty) the offset is 0.

    x_m, and the pivot over the platform, are on the axis of the swing plane.
    """

    camera: int = 1  # its number, of the channels and of the task
    swing_plane: SwingPlane = SwingPlane.X
    width: int
    height: int
    period_ns: int  # of the frames
    pivot_home_px: tuple[float, float]
    pixels_per_m: float
    x_m: list[float]
    offset_rad: list[float]
    background: float | None = None  # level of the screen at these offsets
    lights: list[LightOffsets] = []  # offsets at the same positions in other light
    camera_distance_m: float | None = None  # from the camera to the plane of the swing
    # in place of pivot, scale and distance; the offsets are then those that it leaves
    model: CameraParameters | None = None
    static_scene: bytes | None = None  # PNG (height, width) of what never moves, grey
    rows: int = 0  # of the picture that the tracker uses, from the top; 0 = all
    average_frames: int = 3
    processing_ns: int = 2_000_000  # from the arrival of the frame to the sending of the angle
    max_extrapolation_ns: int = 20_000_000  # of the platform position, from its nearest sample

    @property
    def has_angle_scale(self) -> bool:
        """True if the perspective is corrected, by a model or the slope of an offset table."""
        return self.model is not None or len(self.x_m) > 1


class PlacedFit(NamedTuple):
    """Fit of a picture, with the platform at that time."""

    fit: Fit
    pivot_px: tuple[float, float]  # predicted
    position_m: Position
    offset_rad: float  # of the offset table


class VisionTask:
    """Task (comms.task.Task) that sends one AngleSample for each frame, valid or not."""

    def __init__(self, settings: VisionSettings) -> None:
        self.name = vision_task(settings.camera)
        self._settings = settings
        self._channel = f"angle_{settings.camera}"
        self._axis = 0 if settings.swing_plane is SwingPlane.X else 1  # of a position
        self._rows = min(settings.rows or settings.height, settings.height)
        static: StaticScene | None = None
        self._scene_check: SceneCheck | None = None
        if settings.static_scene is not None:
            scene = _scene(settings.static_scene, settings)[: self._rows]
            static = StaticScene(scene, make_templates(CableLook()).half_px)
            self._scene_check = SceneCheck(scene)
        self._tracker = Tracker(settings.width, self._rows, static=static)
        self._geometry = _geometry(settings, self._axis)
        self._offsets: OffsetTable | None = None
        if settings.x_m or settings.offset_rad:
            self._offsets = OffsetTable(
                settings.x_m, settings.offset_rad, settings.background, settings.lights
            )
        max_gap_ns = int(MAX_GAP_PERIODS * settings.period_ns)
        self._average = MovingAverage(settings.average_frames, max_gap_ns)
        self._lower_average = MovingAverage(settings.average_frames, max_gap_ns)
        self._platform = PlatformTrack(settings.max_extrapolation_ns)
        self._angles_sent = 0
        self._replies = Replies(self.name)
        self.late_ticks = 0  # the task has no ticks

    def start(self, t_ns: int) -> Step:
        """Set OpenCV to one thread: faster on images of this size, and repeatable."""
        cv2.setNumThreads(1)
        return NO_STEP

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Process a platform position, a frame or a command; ignore all others."""
        match message:
            case RobotState():
                position_m, v_m_s = message.actual_m, message.actual_velocity_m_s
                self._platform.store(PlatformPoint(message.t_actual_ns, position_m, v_m_s))
            case Frame():
                at_ns = t_ns + self._settings.processing_ns
                return Step((Send(self._channel, self._sample(message, at_ns), at_ns),))
            case Command():
                # always in phase RUNNING: the task measures from start to exit
                return Step((self._replies.answer(message, Phase.RUNNING, t_ns),))
        return NO_STEP

    def on_tick(self, t_ns: int) -> Step:
        """Do nothing; the task has no timer."""
        return NO_STEP

    def stop(self, t_ns: int) -> Step:
        """Do nothing; no shutdown action."""
        return NO_STEP

    def _sample(self, frame: Frame, at_ns: int) -> AngleSample:
        middle_ns = frame.t_exposure_start_ns + frame.exposure_ns // 2
        position_m = self._platform.at(middle_ns)
        pivot_px = (math.nan, math.nan)
        if position_m is not None:
            pivot_px = self._geometry.pivot_px(position_m)
        fit, reason = self._measure(frame, pivot_px)
        if position_m is None and reason is not InvalidReason.BAD_IMAGE:
            reason = InvalidReason.NO_PLATFORM
        place_m = None if position_m is None else position_m[self._axis]
        offset = self._offset_at(place_m or 0.0, fit.background)
        if reason is InvalidReason.NONE and not offset.within:
            reason = InvalidReason.OUT_OF_RANGE
        t_valid_ns = middle_ns
        links: tuple[LinkAngle, ...] = ()
        if reason is InvalidReason.NONE and position_m is not None:
            placed = PlacedFit(fit, pivot_px, position_m, offset.offset_rad)
            t_valid_ns, links = self._links(frame, placed, middle_ns)
        else:
            self._average.restart()
            self._lower_average.restart()
        self._angles_sent += 1
        return AngleSample(
            seq=self._angles_sent - 1,
            t_ns=at_ns,
            t_valid_ns=t_valid_ns,
            swing_plane=self._settings.swing_plane,
            valid=bool(links),
            reason=reason,
            platform_m=place_m,
            rows=fit.rows,
            residual_px=fit.residual_px,
            pivot_miss_px=fit.pivot_miss_px,
            background=fit.background,
            saturation=fit.saturation,
            links=links,
        )

    def _links(
        self, frame: Frame, placed: PlacedFit, middle_ns: int
    ) -> tuple[int, tuple[LinkAngle, ...]]:
        """Compose the averaged angles of the links, and the time at which they hold [ns]."""
        fit = placed.fit
        if fit.angle_rad is None or fit.sigma_rad is None:
            return middle_ns, ()
        line = seen_line(fit, fit.angle_rad, placed.pivot_px, self._rows)
        t_ns = middle_ns + round(frame.row_ns * readout_rows(line))
        true = self._geometry.true_angle(line, placed.offset_rad, placed.position_m)
        mean = self._average.add(t_ns, true.angle_rad, true.gain * fit.sigma_rad)
        cable = _link_angle(mean, line, true)
        if fit.lower is None:
            self._lower_average.restart()
            return mean.t_ns, (cable,)
        joint_px = fit.lower.joint_px
        rows = (joint_px[1], self._rows - 1.0)
        lower = SeenLine(*joint_px, fit.lower.angle_rad, *rows)
        true = self._geometry.lower_angle(lower, placed.offset_rad, placed.position_m)
        lower_mean = self._lower_average.add(t_ns, true.angle_rad, true.gain * fit.lower.sigma_rad)
        return mean.t_ns, (cable, _link_angle(lower_mean, lower, true))

    def _measure(self, frame: Frame, pivot_px: tuple[float, float]) -> tuple[Fit, InvalidReason]:
        """Measure the angle of a frame; the tracker restarts after a frame it cannot use.

        A pivot of NaN, of a platform that is unknown or behind the camera, gives the levels alone.
        """
        shape: tuple[int, ...] = self._settings.height, self._settings.width
        if frame.encoding == "bgr8":
            shape = (*shape, 3)
        if frame.pixels.shape != shape:
            self._tracker.forget()
            return Fit(), InvalidReason.BAD_IMAGE
        red = red_plane(frame.pixels)[: self._rows]
        if not all(map(math.isfinite, pivot_px)):
            self._tracker.forget()
            levels = grey_levels(red)
            fit = Fit(background=levels.background, saturation=levels.saturation)
            return fit, InvalidReason.OUT_OF_RANGE
        fit = self._tracker.measure(red, pivot_px)
        check = self._scene_check
        if fit.valid and check is not None and not check.fits(red, fit, self._tracker.look):
            return fit, InvalidReason.SCENE_MOVED
        return fit, InvalidReason(fit.reason.value)

    def _offset_at(self, place_m: float, background: float) -> Offset:
        return self._offsets.at(place_m, background) if self._offsets else Offset(0.0, within=True)


def _scene(png: bytes, settings: VisionSettings) -> Grey:
    """Decode the picture of the static scene; raises VisionError."""
    scene = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE)
    size = None if scene is None else scene.shape[::-1]
    expected = (settings.width, settings.height)
    if scene is None or size != expected:
        raise VisionError(
            f"static scene of {len(png)} bytes is a picture of {size}; must be a PNG of {expected} "
            "as [camera]: calibrate again"
        )
    return np.asarray(scene, np.uint8)


def _geometry(settings: VisionSettings, axis: int) -> CableGeometry:
    if settings.model is not None:
        return ModelGeometry(settings.model, settings.rows or settings.height, axis)
    return TableGeometry(
        PivotModel(home_px=settings.pivot_home_px, pixels_per_m=settings.pixels_per_m),
        (settings.x_m, settings.offset_rad),
        (settings.width, settings.height),
        axis,
        settings.camera_distance_m,
    )


def _link_angle(mean: Angle, line: SeenLine, true: TrueAngle) -> LinkAngle:
    """Compose the message of a link from its average and its line in the newest picture."""
    return LinkAngle(
        angle_rad=mean.angle_rad,
        sigma_rad=mean.sigma_rad,
        raw_rad=line.slope_rad,
        offset_rad=line.slope_rad - true.angle_rad,
        joint_px=(line.column_px, line.row_px),
    )


def build(settings: bytes) -> VisionTask:
    """Create the task from its settings in JSON."""
    return VisionTask(msgspec.json.decode(settings, type=VisionSettings))
