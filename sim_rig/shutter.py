"""The camera's shutter: opens on its own grid, watches the cable while it is open, gives a picture when it closes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_rig.bench import Bench
from sim_rig.camera import CableLine, Pinhole
from sim_rig.params import BenchParams
from sim_rig.renderer import Renderer


class Exposure(NamedTuple):
    """A picture, when its exposure began, and the true cable angle half-way through."""

    start_ns: int
    middle_rad: float
    pixels: NDArray[np.uint8]  # (height, width)


class Shutter:
    """Exposures that start on the multiples of the frame period, from t_ns on.

    Bring the bench to `next_ns`, then call `look`; again and again. Raises ValueError when the view has no frame rate.
    """

    def __init__(self, params: BenchParams, t_ns: int = 0) -> None:
        if params.view.rate_hz <= 0.0:
            raise ValueError(
                f"rate_hz = {params.view.rate_hz:g} in [camera]; must be > 0 for pictures: the source rig has 50"
            )
        self.exposure_ns = round(params.camera.exposure_ms * 1e6)
        self._period_ns = round(1e9 / params.view.rate_hz)
        self._pinhole = Pinhole(params.camera, params.view, params.home_m)
        self._renderer = Renderer(params.camera, params.view, params.seed)
        self._taken = 0
        self._seen: list[
            tuple[CableLine | None, float]
        ] = []  # line and angle at start, middle, end
        self.begin(t_ns)

    def begin(self, t_ns: int) -> None:
        """The first exposure starts on the first multiple of the frame period from t_ns on."""
        self._start_ns = self.next_ns = t_ns + -t_ns % self._period_ns

    @property
    def closes_ns(self) -> int:
        """When the exposure under way, or else the next one, ends."""
        return self._start_ns + self.exposure_ns

    def look(self, bench: Bench) -> Exposure | None:
        """Note where the cable is at `next_ns`: start, middle or end of an exposure. The end gives the picture."""
        self._seen.append((self._pinhole.line(bench.position_m, bench.angle_rad), bench.angle_rad))
        if len(self._seen) < 3:
            self.next_ns = (
                self._start_ns + self.exposure_ns // 2 if len(self._seen) == 1 else self.closes_ns
            )
            return None
        (start, _), (middle, angle_rad), (end, _) = self._seen
        exposure = Exposure(
            self._start_ns, angle_rad, self._renderer.picture(self._taken, start, middle, end)
        )
        self._seen.clear()
        self._taken += 1
        self._start_ns = self.next_ns = self._start_ns + self._period_ns
        return exposure
