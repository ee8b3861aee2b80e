"""View of a picture: region, quarter turns, colour plane and polarity; cables become dark."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from vision.line_fit import Grey

PLANES = ("red", "green", "blue", "grey")
CHANNELS = {"blue": 0, "green": 1, "red": 2}  # OpenCV orders blue, green, red
Point = tuple[float, float]


class PictureRegion(NamedTuple):
    """Rectangle of a picture [px]."""

    x: int
    y: int
    width: int
    height: int


class PictureView(NamedTuple):
    """Choice of what is measured in a picture."""

    plane: str = "grey"  # one of PLANES
    is_bright: bool = False  # the cable is brighter than the ground
    turns: int = 0  # quarter turns, counterclockwise, that bring the pivot to the top
    region: PictureRegion | None = None

    def picture(self, image: Grey) -> Grey:
        """Extract the view of image (height, width) or (height, width, 3), contiguous."""
        if self.region is not None:
            x, y, width, height = self.region
            image = image[y : y + height, x : x + width]
        plane = plane_of(image, self.plane)
        if self.is_bright:
            plane = np.asarray(cv2.bitwise_not(plane), np.uint8)
        return np.ascontiguousarray(np.rot90(plane, self.turns))

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Compute width and height of the view of a picture."""
        if self.region is not None:
            _, _, width, height = self.region
        return (height, width) if self.turns % 2 else (width, height)

    def to_view(self, point: Point, size: tuple[int, int]) -> Point:
        """Convert a place in a picture of size (width, height) to one in the view [px]."""
        x, y = point
        width, height = size
        if self.region is not None:
            x, y = x - self.region.x, y - self.region.y
            width, height = self.region.width, self.region.height
        for _ in range(self.turns % 4):
            x, y = y, width - 1 - x
            width, height = height, width
        return x, y

    def to_picture(self, point: Point, size: tuple[int, int]) -> Point:
        """Convert a place in the view to one in a picture of size (width, height) [px]."""
        x, y = point
        width, height = self.size(*size)
        for _ in range(-self.turns % 4):
            x, y = y, width - 1 - x
            width, height = height, width
        if self.region is not None:
            x, y = x + self.region.x, y + self.region.y
        return x, y


def plane_of(image: Grey, plane: str) -> Grey:
    """Extract a colour plane (height, width); a picture with one plane is returned unchanged."""
    if image.ndim == 2:
        return image
    if plane == "grey":
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
    return np.asarray(cv2.extractChannel(image, CHANNELS[plane]), np.uint8)


def is_grey(image: Grey) -> bool:
    """Tell if a picture has one plane, or three equal ones."""
    if image.ndim == 2:
        return True
    sample = image[::7, ::5]
    return bool((sample[:, :, 0] == sample[:, :, 1]).all()) and bool(
        (sample[:, :, 1] == sample[:, :, 2]).all()
    )
