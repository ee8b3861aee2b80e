"""Check of a picture against a static scene: a camera that was moved since shows it elsewhere."""

from __future__ import annotations

import math

import numpy as np

from vision.fit import Fit
from vision.line_fit import Grey
from vision.ridge import grey_levels
from vision.templates import CableLook

MIN_STEP_LEVELS = 8.0  # between the neighbours of a point, left and right: structure
MAX_POINTS = 1000
MIN_POINTS = 100  # fewer tell nothing
CLEAR_BLURS = 3.0  # beside the cable, which hides what is behind it
CLEAR_PX = 2.0
MIN_GAIN_SHARE = 0.5  # of the steps; a line of 2.5 px has 0.7 of them at 1 px, 0.3 at 1.5 px
DOUBT_SIGMAS = 3.0  # of the gain, by the noise
MIN_LEVEL = 1.0


class SceneCheck:
    """Places of steep steps in a scene, and the steps expected there."""

    def __init__(self, scene: Grey) -> None:
        """scene: (height, width)."""
        levels = scene.astype(np.float32)
        step = np.zeros(scene.shape, np.float32)
        step[:, 1:-1] = levels[:, 2:] - levels[:, :-2]
        v, u = np.nonzero(np.abs(step) > MIN_STEP_LEVELS)
        used = v % (1 + len(v) // MAX_POINTS) == 0  # whole rows: both sides of a line
        self._v, self._u = v[used], u[used]
        self._step = step[self._v, self._u].astype(np.float64)
        self._background = max(grey_levels(scene).background, MIN_LEVEL)

    def fits(self, image: Grey, fit: Fit, look: CableLook) -> bool:
        """Tell if image (height, width) shows the scene where it was, apart from the fitted cable.

        True where too little of the scene is seen to tell.
        """
        v, u, step = self._v, self._u, self._step
        if fit.line_px is not None:
            intercept_px, slope = fit.line_px
            hidden_px = 0.5 * look.width_px + CLEAR_BLURS * look.blur_px + CLEAR_PX
            clear = np.abs(u - intercept_px - slope * v) > hidden_px
            v, u, step = v[clear], u[clear], step[clear]
        if step.size < MIN_POINTS:
            return True
        seen = image[v, u + 1].astype(np.float64) - image[v, u - 1]
        size = float(step @ step)
        # light changes the steps as it changes the level of the screen
        light = max(fit.background, MIN_LEVEL) / self._background
        gain = float(step @ seen) / size / light
        noise = float(np.std(seen - gain * light * step))
        sigma = noise / math.sqrt(size) / light
        return gain > MIN_GAIN_SHARE - DOUBT_SIGMAS * sigma
