"""Synthetic video: a load that swings freely below a platform at rest, with the truth beside every picture."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from sim_rig.bench import Bench
from sim_rig.params import BenchParams
from sim_rig.shutter import Shutter

DIM = 40.0  # grey level of a red screen in the blue and green planes; the cable does not show there
BACKGROUNDS = 8  # noisy dim planes, drawn once and taken in turn


class RenderedFrame(NamedTuple):
    """One picture and what it shows."""

    number: int  # from 0
    t_s: float  # middle of the exposure, from the release of the load
    angle_rad: float  # true cable angle at t_s
    image: NDArray[np.uint8]  # (height, width, 3) blue, green, red


def swinging_video(
    params: BenchParams, seconds: float, seed: int | None = None
) -> Iterator[RenderedFrame]:
    """Pictures at view.rate_hz whose exposures start in [0, seconds), of a load released from initial_swing_rad at rest.

    seed replaces params.seed. Raises ValueError when the view has no frame rate.
    """
    if seed is not None:
        params = msgspec.structs.replace(params, seed=seed)
    bench, shutter = Bench(params), Shutter(params)
    dim = _dim_planes(params)
    index = 0
    while shutter.next_ns < seconds * 1e9:
        exposure = None
        while exposure is None:
            bench.advance(shutter.next_ns)
            exposure = shutter.look(bench)
        blue, green = dim[index % BACKGROUNDS], dim[(index + BACKGROUNDS // 2) % BACKGROUNDS]
        image = np.stack([blue, green, exposure.pixels], axis=-1)
        yield RenderedFrame(
            index,
            (exposure.start_ns + 0.5 * shutter.exposure_ns) * 1e-9,
            exposure.middle_rad,
            image,
        )
        index += 1


def _dim_planes(params: BenchParams) -> NDArray[np.uint8]:
    """(BACKGROUNDS, height, width)."""
    shape = (BACKGROUNDS, params.view.height, params.view.width)
    noise = np.random.default_rng([params.seed, 1]).standard_normal(
        shape, dtype=np.float32
    )  # other numbers than the red plane's
    planes: NDArray[np.uint8] = np.clip(DIM + params.camera.noise * noise + 0.5, 0.0, 255.0).astype(
        np.uint8
    )
    return planes
