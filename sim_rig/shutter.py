"""Shutter of a camera: exposures on a time grid, each with one image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig.bench import SimulatedPlant
from sim_rig.camera import Pinhole
from sim_rig.params import BenchParams
from sim_rig.renderer import Cable, Renderer


class Exposure(NamedTuple):
    """Image with the start of its exposure and the true cable angle at mid-exposure."""

    start_ns: int
    exposure_ns: int
    row_ns: int  # from row to row
    readout_ns: int  # from the first row to the last
    camera: str
    middle_rad: float
    pixels: NDArray[np.uint8]  # (height, width) or (height, width, 3)


class Shutter:
    """Shutter with exposures that start on multiples of the frame period, from t_ns on.

    Advance the bench to `next_ns`, then call `sample`, and repeat. Raises ValueError if the view
    has no frame rate.
    """

    def __init__(self, params: BenchParams, number: int = 0, t_ns: int = 0) -> None:
        """number: of the camera, from 0."""
        camera = params.cameras[number]
        rate_hz = params.rate_hz(camera)
        if rate_hz <= 0.0:
            raise ValueError(
                f"rate_hz = {rate_hz:g} in [camera]; must be > 0 for pictures: "
                "set a frame rate, 50 as in the source rig"
            )
        self.exposure_ns = round(camera.exposure_ms * 1e6)
        self._camera = camera
        self._period_ns = round(1e9 / rate_hz)
        self._pinhole = Pinhole(camera, params.view, params.home_m)
        self._renderer = Renderer(camera, params.view, params.seed)
        self._taken = 0
        # (line, angle) at the start, the middle and the end of the exposure
        self._samples: list[tuple[Cable | None, float]] = []
        self.begin(t_ns)

    def begin(self, t_ns: int) -> None:
        """Set the start of the first exposure: the first multiple of the frame period from t_ns."""
        self._start_ns = self.next_ns = t_ns + -t_ns % self._period_ns

    @property
    def closes_ns(self) -> int:
        """End of the current exposure, or of the next one."""
        return self._start_ns + self.exposure_ns

    def sample(self, bench: SimulatedPlant) -> Exposure | None:
        """Sample the cable at `next_ns`: start, middle or end of an exposure.

        The end gives the exposure with its image.
        """
        points_m = bench.cable_points_m
        cable: Cable | None
        if points_m:
            cable = self._pinhole.curve(bench.position_m, points_m)
        else:
            first = bench.links[0]
            cable = self._pinhole.line(bench.position_m, first.angle_x_rad, first.angle_y_rad)
        self._samples.append((cable, bench.angle_rad))
        if len(self._samples) == 1:
            self.next_ns = self._start_ns + self.exposure_ns // 2
            return None
        if len(self._samples) == 2:
            self.next_ns = self.closes_ns
            return None
        (start, _), (middle, angle_rad), (end, _) = self._samples
        picture = self._renderer.picture(self._taken, start, middle, end)
        camera = self._camera
        exposure = Exposure(self._start_ns, self.exposure_ns, 0, 0, camera.name, angle_rad, picture)
        self._samples.clear()
        self._taken += 1
        self._start_ns = self.next_ns = self._start_ns + self._period_ns
        return exposure
