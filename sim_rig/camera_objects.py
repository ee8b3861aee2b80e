"""Parameters of the objects in a picture (`[[bench.camera.objects]]`), by the key `kind`.

Places are pixels (column, row) from the pivot at the home position, unless they are metres.
Times count from the start of the simulation.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta

Place = Annotated[float, Meta(ge=-20_000.0, le=20_000.0)]
Point = tuple[Place, Place]
Metre = Annotated[float, Meta(ge=-50.0, le=50.0)]
Size = Annotated[float, Meta(gt=0.0, le=5000.0)]
Degrees = Annotated[float, Meta(ge=-180.0, le=180.0)]
Dark = Annotated[float, Meta(ge=-5.0, le=1.0)]  # share of the screen that is taken away
FOREVER_S = 1e6


class Shown(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Interval in which an object is in the picture."""

    from_s: Annotated[float, Meta(ge=0.0, le=FOREVER_S)] = 0.0
    to_s: Annotated[float, Meta(gt=0.0, le=FOREVER_S)] = FOREVER_S

    def is_shown(self, t_s: float) -> bool:
        """Tell if the object is in a picture taken at t_s."""
        return self.from_s <= t_s < self.to_s


class StaticLine(Shown, frozen=True, kw_only=True, tag_field="kind", tag="line"):
    """Straight line that does not move: plumb line, edge of a tripod, wide bar."""

    at_px: Point = (0.0, 0.0)
    angle_deg: Annotated[float, Meta(ge=-80.0, le=80.0)] = 0.0  # as the cable: + to the right
    width_px: Size = 2.5
    dark: Dark = 0.825
    length_px: Size = 5000.0  # to each side of at_px


class Shadow(Shown, frozen=True, kw_only=True, tag_field="kind", tag="shadow"):
    """Shadow of the cable on the screen."""

    shift_px: Place = 7.0  # to the right
    width_px: Size = 6.0
    dark: Dark = 0.4


class LoadInPicture(Shown, frozen=True, kw_only=True, tag_field="kind", tag="load"):
    """Sphere at the end of the last link."""

    radius_m: Annotated[float, Meta(gt=0.0, le=5.0)] = 0.03
    dark: Dark = 0.9


class Knots(Shown, frozen=True, kw_only=True, tag_field="kind", tag="knots"):
    """Knots on the cable, at equal distances from the pivot down."""

    spacing_m: Annotated[float, Meta(ge=0.005, le=20.0)] = 0.1
    radius_px: Size = 4.0
    dark: Dark = 0.825


class Dust(Shown, frozen=True, kw_only=True, tag_field="kind", tag="dust"):
    """Specks at random places that do not move."""

    count: Annotated[int, Meta(ge=1, le=5000)] = 60
    radius_px: Size = 1.5
    dark: Dark = 0.6


class Hand(Shown, frozen=True, kw_only=True, tag_field="kind", tag="hand"):
    """Forearm with a rounded end, from the right edge of the picture to a point."""

    tip_px: Point = (0.0, 300.0)
    angle_deg: Degrees = 20.0  # of the arm against the horizontal, rising to the right
    width_px: Size = 80.0
    dark: Dark = 0.5


class Patch(Shown, frozen=True, kw_only=True, tag_field="kind", tag="patch"):
    """Rectangle before the cable; dark = 0 hides the cable by the screen itself."""

    corner_px: Point  # upper left
    size_px: tuple[Size, Size]
    dark: Dark = 0.0


class Glare(Shown, frozen=True, kw_only=True, tag_field="kind", tag="glare"):
    """Reflection: a bright spot over everything."""

    at_px: Point
    radius_px: Size = 60.0  # standard deviation
    level: Annotated[float, Meta(ge=0.0, le=1000.0)] = 80.0  # grey levels in the centre
    velocity_px_s: Point = (0.0, 0.0)


class Chessboard(Shown, frozen=True, kw_only=True, tag_field="kind", tag="chessboard"):
    """Chessboard for the calibration of a camera, before everything else.

    place_m: its centre, right, ahead and up from the home position. Its turn: about the vertical,
    then about the horizontal, then in its own plane. With several boards each has its interval.
    """

    columns: Annotated[int, Meta(ge=3, le=40)] = 9  # inner corners
    rows: Annotated[int, Meta(ge=3, le=40)] = 6
    square_m: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.03
    place_m: tuple[Metre, Metre, Metre] = (0.0, 0.0, -0.3)
    turn_deg: tuple[Degrees, Degrees, Degrees] = (0.0, 0.0, 0.0)


class Mark(Shown, frozen=True, kw_only=True, tag_field="kind", tag="mark"):
    """Round mark at a known place, right, ahead and up from the home position."""

    place_m: tuple[Metre, Metre, Metre]
    radius_px: Size = 6.0
    dark: Dark = 0.825


PictureObject: TypeAlias = (
    StaticLine | Shadow | LoadInPicture | Knots | Dust | Hand | Patch | Glare | Chessboard | Mark
)
