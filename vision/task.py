"""The vision task: a frame and the platform's position in, a stamped and averaged cable angle out."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import cv2
import msgspec

from comms.messages import AngleSample, Command, Frame, InvalidReason, Message, Phase, RobotState
from comms.replies import Replies
from comms.task import NO_STEP, Send, Step
from vision.filters import MovingAverage
from vision.geometry import PivotModel
from vision.offset_table import Offset, OffsetTable
from vision.ridge import grey_levels
from vision.sources import red_plane
from vision.tracker import Fit, Tracker

HISTORY = 32  # platform samples kept: 320 ms at 100 Hz, ten frames' worth
NS_PER_S = 1e9
GAP_PERIODS = 1.5  # two stamps farther apart have lost a frame between them


class VisionSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the task is told before the run. x_m and offset_rad both empty: no table yet, offset 0 (while calibrating)."""

    width: int
    height: int
    period_ns: int  # of the frames
    pivot_home_px: tuple[float, float]
    pixels_per_m: float
    x_m: list[float]
    offset_rad: list[float]
    average_frames: int = 3
    processing_ns: int = 2_000_000  # the angle leaves this long after its frame came
    max_extrapolation_ns: int = 20_000_000  # of the platform's position beyond its newest stamp


class PlatformPoint(NamedTuple):
    """Where the platform was along X, and how fast."""

    t_ns: int
    x_m: float
    v_m_s: float


class VisionTask:
    """Implements comms.task.Task; sends one AngleSample for each frame, valid or not."""

    name = "vision"

    def __init__(self, settings: VisionSettings) -> None:
        self._settings = settings
        self._tracker = Tracker(settings.width, settings.height)
        self._pivot = PivotModel(home_px=settings.pivot_home_px, pixels_per_m=settings.pixels_per_m)
        self._offsets = (
            OffsetTable(settings.x_m, settings.offset_rad)
            if settings.x_m or settings.offset_rad
            else None
        )
        self._average = MovingAverage(
            settings.average_frames, int(GAP_PERIODS * settings.period_ns)
        )
        self._platform: deque[PlatformPoint] = deque(maxlen=HISTORY)
        self._angles_sent = 0
        self._replies = Replies(self.name)
        self.late_ticks = 0  # has no ticks

    def start(self, t_ns: int) -> Step:
        """Nothing to send; one thread is quicker than many on pictures this small, and repeatable."""
        cv2.setNumThreads(1)
        return NO_STEP

    def on_message(self, channel: str, message: Message, t_ns: int) -> Step:
        """Serves `platform`, `frame` and `command`; ignores the rest."""
        match message:
            case RobotState():
                self._remember(message)
            case Frame():
                at_ns = t_ns + self._settings.processing_ns
                return Step((Send("angle", self._sample(message, at_ns), at_ns),))
            case Command():
                return Step(
                    (self._replies.answer(message, Phase.RUNNING, t_ns),)
                )  # looks as long as it lives
        return NO_STEP

    def on_tick(self, t_ns: int) -> Step:
        """Asks for no wake, has no timer."""
        return NO_STEP

    def stop(self, t_ns: int) -> Step:
        """Nothing to end."""
        return NO_STEP

    def _remember(self, state: RobotState) -> None:
        if self._platform and state.t_actual_ns <= self._platform[-1].t_ns:
            return  # an old measurement says nothing new
        self._platform.append(
            PlatformPoint(state.t_actual_ns, state.actual_m[0], state.actual_velocity_m_s[0])
        )

    def _sample(self, frame: Frame, at_ns: int) -> AngleSample:
        middle_ns = frame.t_exposure_start_ns + frame.exposure_ns // 2
        x_m = self._platform_at(middle_ns)
        fit, reason = self._measured(frame, x_m)
        offset = self._offset_at(x_m or 0.0)
        if reason is InvalidReason.NONE and not offset.within:
            reason = InvalidReason.OUT_OF_RANGE
        mean = None
        if reason is InvalidReason.NONE and fit.angle_rad is not None and fit.sigma_rad is not None:
            t_ns = middle_ns + self._readout_ns(frame)
            mean = self._average.add(t_ns, fit.angle_rad - offset.offset_rad, fit.sigma_rad)
        else:
            self._average.restart()
        self._angles_sent += 1
        return AngleSample(
            seq=self._angles_sent - 1,
            t_ns=at_ns,
            t_valid_ns=mean.t_ns if mean else middle_ns,
            angle_rad=mean.angle_rad if mean else None,
            sigma_rad=mean.sigma_rad if mean else None,
            valid=mean is not None,
            reason=reason,
            raw_rad=fit.angle_rad if mean else None,
            offset_rad=offset.offset_rad if mean else None,
            platform_m=x_m,
            rows=fit.rows,
            residual_px=fit.residual_px,
            pivot_miss_px=fit.pivot_miss_px,
            background=fit.background,
            saturation=fit.saturation,
        )

    def _measured(self, frame: Frame, x_m: float | None) -> tuple[Fit, InvalidReason]:
        """What the tracker says of the frame; the tracker forgets where the cable was when it gets no picture."""
        size = self._settings.height, self._settings.width
        if frame.pixels.shape != (*size, 3)[: 3 if frame.encoding == "bgr8" else 2]:
            self._tracker.forget()
            return Fit(), InvalidReason.BAD_IMAGE
        red = red_plane(frame.pixels)
        if x_m is None:
            self._tracker.forget()
            levels = grey_levels(red)
            return Fit(
                background=levels.background, saturation=levels.saturation
            ), InvalidReason.NO_PLATFORM
        fit = self._tracker.measure(red, self._pivot.pivot_px(x_m))
        return fit, InvalidReason(fit.reason.value)

    def _platform_at(self, t_ns: int) -> float | None:
        """X of the platform at t_ns [m]: cubic Hermite between samples, constant velocity beyond; None too far from any."""
        if (
            not self._platform
            or min(abs(t_ns - p.t_ns) for p in self._platform) > self._settings.max_extrapolation_ns
        ):
            return None
        before = [p for p in self._platform if p.t_ns <= t_ns]
        after = [p for p in self._platform if p.t_ns > t_ns]
        if before and after:
            return _hermite(before[-1], after[0], t_ns)
        nearest = before[-1] if before else after[0]
        return nearest.x_m + nearest.v_m_s * (t_ns - nearest.t_ns) / NS_PER_S

    def _offset_at(self, x_m: float) -> Offset:
        return self._offsets.at(x_m) if self._offsets else Offset(0.0, within=True)

    def _readout_ns(self, frame: Frame) -> int:
        """How long after row 0 the slope of a picture read row by row is true: row_ns (height - pivot row), first order."""
        return round(frame.row_ns * (frame.height - self._settings.pivot_home_px[1]))


def _hermite(a: PlatformPoint, b: PlatformPoint, t_ns: int) -> float:
    """Cubic through both positions with both velocities, at a.t_ns <= t_ns <= b.t_ns [m]."""
    h = (b.t_ns - a.t_ns) / NS_PER_S
    s = (t_ns - a.t_ns) / NS_PER_S / h
    rise = b.x_m - a.x_m
    bend = (1.0 - s) * (h * a.v_m_s - rise) - s * (h * b.v_m_s - rise)
    return a.x_m + s * rise + s * (1.0 - s) * bend


def build(settings: bytes) -> VisionTask:
    """The task from its settings in JSON."""
    return VisionTask(msgspec.json.decode(settings, type=VisionSettings))
