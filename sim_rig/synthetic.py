"""Synthetic video of a freely swinging load below a platform at rest, with the true angles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from sim_rig.bench import Bench
from sim_rig.params import BenchParams
from sim_rig.shutter import Shutter

# grey level of a red screen in the blue and green planes; the cable is not visible there
DIM_LEVEL = 40.0
BACKGROUNDS = 8  # noisy dim planes, drawn once and used in turn


class RenderedFrame(NamedTuple):
    """Image with its time and its true cable angle."""

    number: int  # from 0
    t_s: float  # middle of the exposure, from the release of the load
    angle_rad: float  # true cable angle at t_s
    image: NDArray[np.uint8]  # (height, width, 3) blue, green, red


def swinging_video(
    params: BenchParams, seconds: float, seed: int | None = None
) -> Iterator[RenderedFrame]:
    """Render frames at view.rate_hz, of a load released at rest from initial_swing_rad.

    The exposures start in [0, seconds). seed replaces params.seed. Raises ValueError if the view
    has no frame rate.
    """
    if seed is not None:
        params = msgspec.structs.replace(params, seed=seed)
    bench = Bench(params)
    shutter = Shutter(params)
    dim = _dim_planes(params)
    index = 0
    while shutter.next_ns < seconds * 1e9:
        exposure = None
        while exposure is None:
            bench.advance(shutter.next_ns)
            exposure = shutter.sample(bench)
        blue = dim[index % BACKGROUNDS]
        green = dim[(index + BACKGROUNDS // 2) % BACKGROUNDS]
        image = np.stack([blue, green, exposure.pixels], axis=-1)
        middle_s = (exposure.start_ns + 0.5 * shutter.exposure_ns) * 1e-9
        yield RenderedFrame(index, middle_s, exposure.middle_rad, image)
        index += 1


def _dim_planes(params: BenchParams) -> NDArray[np.uint8]:
    """Draw the noisy dim planes, (BACKGROUNDS, height, width)."""
    shape = (BACKGROUNDS, params.view.height, params.view.width)
    # another sequence than that of the red plane
    random = np.random.default_rng([params.seed, 1])
    noise = random.standard_normal(shape, dtype=np.float32)
    levels = np.clip(DIM_LEVEL + params.cameras[0].noise * noise + 0.5, 0.0, 255.0)
    planes: NDArray[np.uint8] = levels.astype(np.uint8)
    return planes
