"""Light on the screen over time and place."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim_rig.camera_params import LightParams

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]


class Light:
    """Level of the screen relative to its nominal one."""

    def __init__(
        self, light: LightParams, shape: tuple[int, int], exposure_s: float, row_s: float
    ) -> None:
        self._light = light
        self._rows_s = row_s * np.arange(shape[0]) if row_s else np.zeros(1)
        self._exposure_s = exposure_s
        turns = light.flicker_hz * exposure_s
        # the mean of a sine over the exposure is smaller than its amplitude
        self._flicker = light.flicker * float(np.sinc(turns))
        self.gradient: Image | None = None  # (height, width) factor
        if any(light.gradient):
            height, width = shape
            right = np.linspace(-0.5, 0.5, width)
            down = np.linspace(-0.5, 0.5, height)[:, None]
            factor = 1.0 + light.gradient[0] * right + light.gradient[1] * down
            self.gradient = np.maximum(factor, 0.0).astype(np.float32)

    def level(self, start_s: float) -> Image:
        """Compute the factor of a picture whose exposure starts at start_s: (1 or height, 1)."""
        light = self._light
        level = light.level
        for step in light.steps:
            if start_s >= step.at_s:
                level = step.level
        level *= 1.0 + light.drift * math.sin(math.tau * start_s / light.drift_s)
        middles_s = start_s + 0.5 * self._exposure_s + self._rows_s
        wave = np.sin(math.tau * light.flicker_hz * middles_s)
        factor = level * (1.0 + self._flicker * wave)
        return factor[:, None].astype(np.float32)
