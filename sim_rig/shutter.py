"""Shutter of a camera: exposures on a time grid, each with one image."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_rig.bench import SimulatedPlant
from sim_rig.cable_state import CableState
from sim_rig.camera_params import CameraFaults
from sim_rig.frame_faults import FrameFaults
from sim_rig.params import BenchParams
from sim_rig.plain_imager import PlainImager, is_plain

MAX_JITTER_SHARE = 0.25  # of the frame period


class Exposure(NamedTuple):
    """Image with the time stamps that the camera gives, and what was before the camera."""

    number: int  # of the exposure, from 0
    start_ns: int  # of the first row
    exposure_ns: int
    row_ns: int  # from row to row
    readout_ns: int  # from the first row to the last
    camera: str
    pixels: NDArray[np.uint8]  # (height, width) or (height, width, 3)
    states: list[CableState]  # of the plant, at the instants of the samples
    true_start_ns: int


class OpenExposure(NamedTuple):
    """Exposure whose samples are being taken."""

    number: int
    start_ns: int  # by the stamp
    true_start_ns: int  # after the delay of the trigger, which the camera does not know
    states: list[CableState]


class CameraImager(Protocol):
    """Maker of the pictures of a camera."""

    instants_ns: list[int]  # at which the cable is sampled, from the start of the exposure

    def picture(self, states: list[CableState], start_s: float, index: int) -> NDArray[np.uint8]:
        """Take the picture number index of the states at these instants."""


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
        self.row_ns = round(camera.row_us * 1e3)
        self._readout_ns = self.row_ns * (params.view.height - 1)
        self._camera = camera
        self._period_ns = round(1e9 / rate_hz)
        self._imager = _imager(params, number)
        self._instants_ns = self._imager.instants_ns
        # the next exposure may begin before the end of this one
        self._overlaps = bool(self.row_ns or camera.jitter_us)
        self._faults: FrameFaults | None = None
        if camera.faults != CameraFaults():
            self._faults = FrameFaults(camera.faults, (params.seed, number, 3))
        self._jitter = np.random.default_rng((params.seed, number, 4))
        self.begin(t_ns)

    def begin(self, t_ns: int) -> None:
        """Set the start of the first exposure: the first multiple of the frame period from t_ns."""
        self._origin_ns = t_ns
        first = self._opened(0, t_ns + -t_ns % self._period_ns)
        self._open = [first]  # by age; a rolling shutter may have two
        self.next_ns = first.true_start_ns

    @property
    def closes_ns(self) -> int:
        """End of the oldest open exposure."""
        return self._open[0].true_start_ns + self.exposure_ns + self._readout_ns

    @property
    def oldest_ns(self) -> int:
        """Start of the oldest open exposure, by its stamp."""
        return self._open[0].start_ns

    def sample(self, bench: SimulatedPlant) -> Exposure | None:
        """Sample the cable at `next_ns` for one exposure.

        Its last sample gives the exposure with its image, unless the camera drops it.
        """
        item = self._open[0]
        if len(self._open) > 1 and self._due_ns(item) != self.next_ns:
            item = self._open[1]
        item.states.append(CableState.of(bench))
        exposure = None
        if self._overlaps and len(item.states) == 1:
            self._open.append(self._opened(item.number + 1, item.start_ns + self._period_ns))
        if len(item.states) == len(self._instants_ns):
            if not self._overlaps:
                self._open.append(self._opened(item.number + 1, item.start_ns + self._period_ns))
            self._open.remove(item)
            exposure = self._expose(item)
        self.next_ns = self._due_ns(self._open[0])
        if len(self._open) > 1:
            self.next_ns = min(self.next_ns, self._due_ns(self._open[1]))
        return exposure

    def _opened(self, number: int, start_ns: int) -> OpenExposure:
        delay_ns = 0
        if self._camera.jitter_us:
            delay_ns = round(abs(self._jitter.normal(0.0, self._camera.jitter_us * 1e3)))
            delay_ns = min(delay_ns, round(MAX_JITTER_SHARE * self._period_ns))
        return OpenExposure(number, start_ns, start_ns + delay_ns, [])

    def _due_ns(self, item: OpenExposure) -> int:
        """Return the instant of the next sample of an exposure."""
        return item.true_start_ns + self._instants_ns[len(item.states)]

    def _expose(self, item: OpenExposure) -> Exposure | None:
        start_s = (item.true_start_ns - self._origin_ns) * 1e-9
        if self._faults is None:
            picture = self._imager.picture(item.states, start_s, item.number)
        else:
            fault = self._faults.at(item.number, start_s)
            if fault.is_dropped:
                return None
            repeated = self._faults.repeated(fault)
            if repeated is None:
                repeated = self._imager.picture(item.states, start_s, item.number)
            picture = self._faults.damaged(fault, repeated)
        return Exposure(
            item.number,
            item.start_ns,
            self.exposure_ns,
            self.row_ns,
            self._readout_ns,
            self._camera.name,
            picture,
            item.states,
            item.true_start_ns,
        )


def _imager(params: BenchParams, number: int) -> CameraImager:
    if is_plain(params.cameras[number]):
        return PlainImager(params, number)
    # scipy and the drawing of objects are loaded where a camera needs them
    from sim_rig.imager import Imager

    return Imager(params, number)
