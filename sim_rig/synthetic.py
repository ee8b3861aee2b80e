"""Synthetic video of a load that swings below the platform, with what is true in each picture."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from comms.messages import Position
from sim_rig.bench import Bench
from sim_rig.params import BenchParams
from sim_rig.shutter import Exposure, Shutter

SETPOINT_NS = 5_000_000  # period of the setpoints of a platform that moves
BACKGROUNDS = 8  # noisy dim planes, drawn once and used in turn
Motion = Callable[[float], Position]  # setpoint of the platform at a time [s]


class RenderedFrame(NamedTuple):
    """Picture with its time stamp and the true angles of the first link."""

    number: int  # of the exposure, from 0; a dropped one is missing
    t_s: float  # middle of the exposure of the first row by the stamp, from the release of the load
    angle_rad: float  # in the plane x at that instant
    angle_y_rad: float
    exposure: Exposure


def swinging_video(
    params: BenchParams, seconds: float, number: int = 0, motion: Motion | None = None
) -> Iterator[RenderedFrame]:
    """Render the frames of a camera, of a load released at rest from its initial angles.

    The exposures start in [0, seconds). number: of the camera, from 0. motion: of the platform, at
    rest without it. Raises ValueError if the view has no frame rate.
    """
    bench = Bench(params)
    bench.start_run(0)
    shutter = Shutter(params, number)
    while shutter.oldest_ns < seconds * 1e9:
        advance(bench, shutter.next_ns, motion)
        exposure = shutter.sample(bench)
        if exposure is None:
            continue
        x_rad, y_rad = _true_angles(exposure)
        middle_s = (exposure.start_ns + 0.5 * exposure.exposure_ns) * 1e-9
        yield RenderedFrame(exposure.number, middle_s, x_rad, y_rad, exposure)


def advance(bench: Bench, t_ns: int, motion: Motion | None) -> None:
    """Advance the bench to t_ns, with the setpoints of a motion on their grid."""
    while motion is not None:
        due_ns = bench.t_ns + SETPOINT_NS - bench.t_ns % SETPOINT_NS
        if due_ns > t_ns:
            break
        bench.advance(due_ns)
        bench.set_setpoint(motion(due_ns * 1e-9))
    bench.advance(t_ns)


def _true_angles(exposure: Exposure) -> tuple[float, float]:
    """Compute the angles of the first link in the middle of the exposure of the first row."""
    states = exposure.states
    links = [state.links[0] for state in states]
    if exposure.row_ns == 0:
        middle = links[len(links) // 2]
        return middle.angle_x_rad, middle.angle_y_rad
    whole_ns = exposure.exposure_ns + exposure.readout_ns
    at = np.linspace(0.0, 1.0, len(links))
    angles = np.array([(link.angle_x_rad, link.angle_y_rad) for link in links])
    curves = np.polynomial.polynomial.polyfit(at, angles, len(links) - 1)
    share = 0.5 * exposure.exposure_ns / whole_ns
    found: NDArray[np.float64] = np.vander([share], len(links), increasing=True)[0] @ curves
    return float(found[0]), float(found[1])


class ColourPlanes:
    """Blue and green planes of a picture before a red screen, in which the cable is not seen."""

    def __init__(self, params: BenchParams, number: int = 0) -> None:
        camera = params.cameras[number]
        shape = (BACKGROUNDS, params.view.height, params.view.width)
        # another sequence than that of the red plane
        seed = [params.seed, 1] if number == 0 else [params.seed, 1, number]
        noise = np.random.default_rng(seed).standard_normal(shape, dtype=np.float32)
        level = camera.background * camera.screen_colour[0]
        levels = np.clip(level + camera.noise * noise + 0.5, 0.0, 255.0)
        self._planes: NDArray[np.uint8] = levels.astype(np.uint8)
        self._is_red = camera.sensor.kind == "red_plane"

    def colour(self, pixels: NDArray[np.uint8], number: int) -> NDArray[np.uint8]:
        """Make a colour picture (height, width, 3) of frame number as the camera gives it."""
        if pixels.ndim == 3:
            return pixels
        if not self._is_red:
            return np.stack([pixels] * 3, axis=-1)
        blue = self._planes[number % BACKGROUNDS]
        green = self._planes[(number + BACKGROUNDS // 2) % BACKGROUNDS]
        return np.stack([blue, green, pixels], axis=-1)
