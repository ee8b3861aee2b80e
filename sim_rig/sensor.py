"""Sensor: digital picture from the level of light on each pixel."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_rig.camera_params import CameraParams

Image = NDArray[np.float32]
Picture = NDArray[np.uint8]
FULL_SCALE = 255.0
FINE_STEPS = 16  # of a grey level in the converter, before gamma: 12 bits
# random numbers drawn once; each picture takes a part of them from a random place
BANK_SIZE = 1 << 22


class Sensor:
    """Sensor of a camera; equal seeds and numbers of the picture give equal noise."""

    def __init__(self, camera: CameraParams, shape: tuple[int, int], seed: tuple[int, ...]) -> None:
        self._sensor = camera.sensor
        self._noise = camera.noise
        self._shape = shape
        self._seed = seed
        self._bank: Image | None = None  # drawn for the first picture
        self._gamma: Picture | None = None
        if camera.sensor.gamma != 1.0:
            levels = np.arange(FULL_SCALE * FINE_STEPS + 1) / (FULL_SCALE * FINE_STEPS)
            curve = FULL_SCALE * levels ** (1.0 / camera.sensor.gamma)
            self._gamma = np.rint(curve).astype(np.uint8)

    @property
    def is_noisy(self) -> bool:
        """True if there is any noise."""
        return bool(self._noise or self._sensor.shot or self._sensor.row_noise)

    def variance(self, level: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the variance of the white noise at levels of light, rounding included.

        In squares of the levels of light; infinite where the sensor is saturated.
        """
        gain = self._sensor.gain
        variance = self._noise**2 + self._sensor.shot * np.maximum(level, 0.0)
        rounding = 1.0 / 12.0 / gain**2
        return np.where(level * gain < FULL_SCALE, variance + rounding, np.inf)

    def sites(
        self, plane: int, rows: NDArray[np.intp], columns: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Mark the pixels that measure a plane (0 blue, 1 green, 2 red): all but in a mosaic."""
        if self._sensor.kind != "bayer":
            return np.ones(columns.shape, np.bool_)
        is_red = (rows % 2 == 0) & (columns % 2 == 0)
        is_blue = (rows % 2 == 1) & (columns % 2 == 1)
        sites: tuple[NDArray[np.bool_], ...] = (is_blue, ~(is_red | is_blue), is_red)
        return sites[plane]

    def picture(self, planes: list[Image], index: int) -> Picture:
        """Convert the level of light (height, width) of one plane, or of blue, green and red.

        The levels are changed in place. Returns (height, width) or (height, width, 3).
        """
        random = np.random.default_rng((*self._seed, index))
        kind = self._sensor.kind
        if kind == "bayer":
            mosaic = self._digital(_mosaic(planes), random)
            picture = np.asarray(cv2.cvtColor(mosaic, cv2.COLOR_BayerRGGB2BGR), np.uint8)
        elif kind == "colour":
            digital = [self._digital(plane, random) for plane in planes]
            picture = np.asarray(cv2.merge(digital), np.uint8)
        else:
            picture = self._digital(planes[0], random)
        return self._processed(picture)

    def _digital(self, level: Image, random: np.random.Generator) -> Picture:
        """Add the noise, amplify and round."""
        sensor = self._sensor
        if self.is_noisy:
            noise = self._normal(random)
            if sensor.shot:
                variance = np.maximum(level, 0.0) * np.float32(sensor.shot)
                variance += np.float32(self._noise**2)
                level += np.sqrt(variance) * noise
            else:
                level += np.float32(self._noise) * noise
        if sensor.row_noise:
            rows = sensor.row_noise * random.standard_normal((level.shape[0], 1))
            level += rows.astype(np.float32)
        if self._gamma is None:
            return np.asarray(cv2.convertScaleAbs(np.maximum(level, 0.0), alpha=sensor.gain))
        scale = np.float32(sensor.gain * FINE_STEPS)
        fine = np.rint(np.clip(level * scale, 0.0, FULL_SCALE * FINE_STEPS))
        digital: Picture = self._gamma.take(fine.astype(np.int32))
        return digital

    def _normal(self, random: np.random.Generator) -> Image:
        """Take normal random numbers (height, width) from a random place in the bank."""
        pixels = self._shape[0] * self._shape[1]
        if self._bank is None:
            size = max(BANK_SIZE, 2 * pixels)
            self._bank = np.random.default_rng(self._seed).standard_normal(size, dtype=np.float32)
        first = int(random.integers(self._bank.size - pixels))
        return self._bank[first : first + pixels].reshape(self._shape)

    def _processed(self, picture: Picture) -> Picture:
        """Filter and compress the picture as the camera does."""
        if self._sensor.denoise_px:
            picture = np.asarray(
                cv2.GaussianBlur(picture, (0, 0), self._sensor.denoise_px), np.uint8
            )
        if self._sensor.jpeg:
            quality = [cv2.IMWRITE_JPEG_QUALITY, self._sensor.jpeg]
            _, data = cv2.imencode(".jpg", picture, quality)
            flag = cv2.IMREAD_GRAYSCALE if picture.ndim == 2 else cv2.IMREAD_COLOR
            picture = np.asarray(cv2.imdecode(data, flag), np.uint8)
        return picture


def _mosaic(planes: list[Image]) -> Image:
    """Take red, green and blue pixels from their planes: RGGB, red at (0, 0)."""
    blue, green, red = planes
    mosaic = green.copy()
    mosaic[0::2, 0::2] = red[0::2, 0::2]
    mosaic[1::2, 1::2] = blue[1::2, 1::2]
    return mosaic
