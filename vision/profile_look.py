"""Width and blur of a cable from its mean profile in a picture."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr

from vision.line_fit import FloatArray, Grey
from vision.templates import CableLook

BINS_PER_PX = 2
MIN_BLUR_PX, MAX_BLUR_PX = 0.3, 12.0
MAX_WIDTH_PX = 40.0
# of width, blur, centre [px], level [grey], trend [grey/px] and contrast [grey]
SCALES = (1.0, 1.0, 0.1, 10.0, 0.1, 50.0)
TOLERANCE_REL = 1e-5
MAX_EVALUATIONS = 40  # a blurred narrow line and a sharp wide one differ little: near is enough
MIN_CONTRAST_SIGMAS = 3.0  # of the profile against its own residual


def mean_profile(
    image: Grey, rows: FloatArray, columns: FloatArray, slope: float, reach_px: int
) -> tuple[FloatArray, FloatArray]:
    """Average the picture over the rows, by the distance from the axis.

    rows, columns (N,) of the axis. Returns distances [px] and levels, each (M,); empty if the axis
    is not in the picture.
    """
    centre = np.rint(columns).astype(np.intp)
    inside = (centre >= reach_px) & (centre < image.shape[1] - reach_px)
    if not inside.any():
        return np.empty(0), np.empty(0)
    window = np.arange(-reach_px, reach_px + 1)
    pixels = image[rows[inside].astype(np.intp)[:, None], centre[inside, None] + window]
    cos = 1.0 / math.hypot(1.0, slope)
    distance = (centre[inside, None] + window - columns[inside, None]) * cos
    bins = np.rint((distance + reach_px) * BINS_PER_PX).astype(np.intp).ravel()
    bins = np.maximum(bins, 0)
    count = np.bincount(bins)
    total = np.bincount(bins, weights=pixels.ravel())
    full = count > 0.1 * count.max()
    at = np.flatnonzero(full) / BINS_PER_PX - reach_px
    return at, total[full] / count[full]


def measure_look(
    image: Grey, rows: FloatArray, columns: FloatArray, slope: float, guess: CableLook
) -> CableLook | None:
    """Fit width and blur to the mean profile around an axis; None if there is no dark line.

    The model is that of CableLook, on a background that changes linearly across it.
    """
    reach = math.ceil(0.75 * guess.width_px + 5.0 * guess.blur_px) + 3
    reach = min(reach, image.shape[1] // 4)
    distance, level = mean_profile(image, rows, columns, slope, reach)
    if distance.size < 10:
        return None
    span = float(np.ptp(level)) or 1.0

    def residual(q: FloatArray) -> FloatArray:
        width, blur, centre, base, trend, contrast = q
        left, right = distance - centre + 0.5 * width, distance - centre - 0.5 * width
        profile = ndtr(left / blur) - ndtr(right / blur)
        return np.asarray((base + trend * distance - contrast * profile - level) / span)

    guessed = [guess.width_px, guess.blur_px, 0.0, float(np.median(level)), 0.0, span]
    lower = np.array([0.3, MIN_BLUR_PX, -0.5 * reach, -50.0, -5.0, 0.0])
    upper = np.array([MAX_WIDTH_PX, MAX_BLUR_PX, 0.5 * reach, 350.0, 5.0, 600.0])
    start = np.clip(guessed, lower + 1e-3, upper - 1e-3)
    found = least_squares(
        residual,
        start,
        bounds=(lower, upper),
        x_scale=SCALES,
        ftol=TOLERANCE_REL,
        xtol=TOLERANCE_REL,
        max_nfev=MAX_EVALUATIONS,
    )
    width, blur, centre, _, _, contrast = found.x
    scatter = span * math.sqrt(2.0 * found.cost / distance.size)
    depth = contrast * (2.0 * float(ndtr(0.5 * width / blur)) - 1.0)
    if depth < MIN_CONTRAST_SIGMAS * scatter or abs(centre) > 0.5 * (width + 2.0 * blur):
        return None
    return CableLook(float(width), float(blur))
