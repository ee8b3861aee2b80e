"""Camera image of the report, with the cable that the tracker found in it."""

from __future__ import annotations

import base64
import math
from typing import Any, NamedTuple

import cv2
import msgspec
import numpy as np
import numpy.typing as npt

from comms.messages import AngleSample
from comms.records import CompressedImage
from rig.analysis.run_log import RunLog
from rig.ui.plots.style import IMAGE_CYAN, IMAGE_YELLOW
from rig.ui.report_page import Html, element

TOP_MARGIN_PX = 12.0  # shown above the pivot, which may lie above the image
CROSS_PX = 8.0  # half width of the cross at the pivot
JPEG_QUALITY = 85


class TrackerSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Keys of `vision.json` that place the cable in an image."""

    average_frames: int
    period_ns: int
    pivot_home_px: tuple[float, float]
    pixels_per_m: float


class Cable(NamedTuple):
    """Line of the detected cable in an image, from the row of the pivot to the last row [px]."""

    pivot: tuple[float, float]
    top_u: float
    bottom_u: float
    bottom_v: float


def camera_figure(run: RunLog) -> Html | None:
    """Show the logged image nearest the largest measured swing, with the detected cable.

    None when the log has no image, no angle, or no settings of the tracker.
    """
    images = run.pictures()
    seen = [a for a in run.angles if a.cable is not None]
    settings = _settings(run)
    if not images or not seen or settings is None:
        return None
    image, stamp_s = _nearest_image(images, seen)
    pixels = _decoded(image.data)
    if pixels is None:
        return None
    sample = _nearest_sample(seen, stamp_s, settings)
    height, width = pixels.shape
    cable = _cable(sample, settings, height)
    top = min(0.0, cable.pivot[1] - TOP_MARGIN_PX)
    drawing = element(
        "svg",
        element("image", href=_data_url(pixels), width=width, height=height),
        *_lines(cable),
        viewBox=f"0 {top:.1f} {width} {height - top:.1f}",
        role="img",
        aria_label="camera image with detected cable",
    )
    angle_mrad = _raw_rad(sample) * 1e3
    caption = (
        f"{stamp_s - run.t_move_s:+.2f} s from the start of the move: {angle_mrad:.2f} mrad in "
        f"the image. Dashed: detected cable, {sample.rows} rows; cross: predicted pivot."
    )
    return element("figure", drawing, element("figcaption", caption))


def _decoded(data: bytes) -> npt.NDArray[Any] | None:
    """Decode an image to grey values; None for bytes that are no image."""
    if not data:
        return None
    return cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_GRAYSCALE)


def _settings(run: RunLog) -> TrackerSettings | None:
    data = run.log.attachments.get("vision.json", b"null")
    try:
        return msgspec.json.decode(data, type=TrackerSettings)
    except msgspec.MsgspecError:
        return None


def _nearest_image(
    images: list[CompressedImage], seen: list[AngleSample]
) -> tuple[CompressedImage, float]:
    """Find the image nearest the largest swing, and its stamp [s]."""
    largest = max(seen, key=lambda a: abs(a.cable.angle_rad if a.cable else 0.0))
    stamps_s = np.array([p.timestamp.sec + p.timestamp.nsec * 1e-9 for p in images])
    k = int(np.argmin(np.abs(stamps_s - largest.t_valid_ns * 1e-9)))
    return images[k], float(stamps_s[k])


def _nearest_sample(
    seen: list[AngleSample], stamp_s: float, settings: TrackerSettings
) -> AngleSample:
    """Find the sample of an image; the stamp of an average lies before its last frame."""
    average_s = (settings.average_frames - 1) / 2 * settings.period_ns * 1e-9
    return min(seen, key=lambda a: abs(a.t_valid_ns * 1e-9 + average_s - stamp_s))


def _raw_rad(sample: AngleSample) -> float:
    return sample.cable.raw_rad if sample.cable else 0.0


def _cable(sample: AngleSample, settings: TrackerSettings, height: int) -> Cable:
    u0, v0 = settings.pivot_home_px
    u0 += settings.pixels_per_m * (sample.platform_m or 0.0)
    top_u = u0 + (sample.pivot_miss_px or 0.0)
    bottom_v = height - 1.0
    slope = math.tan(_raw_rad(sample))
    return Cable((u0, v0), top_u, top_u + slope * (bottom_v - v0), bottom_v)


def _lines(cable: Cable) -> list[Html]:
    u, v = cable.pivot
    line = element(
        "line",
        x1=f"{cable.top_u:.2f}",
        y1=f"{v:.2f}",
        x2=f"{cable.bottom_u:.2f}",
        y2=f"{cable.bottom_v:.2f}",
        stroke=IMAGE_CYAN,
        stroke_width=2,
        stroke_dasharray="8 6",
    )
    cross = (
        f"M{u - CROSS_PX:.2f} {v - CROSS_PX:.2f}l{2 * CROSS_PX} {2 * CROSS_PX}"
        f"m0 {-2 * CROSS_PX}l{-2 * CROSS_PX} {2 * CROSS_PX}"
    )
    return [line, element("path", d=cross, stroke=IMAGE_YELLOW, stroke_width=3, fill="none")]


def _data_url(pixels: npt.NDArray[Any]) -> str:
    """Encode an image anew: what the log calls an image never reaches the page."""
    _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return f"data:image/jpeg;base64,{base64.b64encode(data.tobytes()).decode()}"
