"""Choice of the colour plane, the polarity and the turn in which a cable is seen best."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vision.free_lines import find_lines
from vision.line_fit import Grey
from vision.ridge import grey_levels
from vision.static_scene import StaticScene, median_picture
from vision.view import PLANES, Region, View, is_grey

MEDIAN_PICTURES = 15
TRIED_PICTURES = 6
STATIC_WEIGHT = 0.25  # of a line that does not move, against one that does


class _Candidate(NamedTuple):
    view: View
    merit: float  # rows times strength over noise


def choose_view(
    pictures: Sequence[Grey],
    plane: str | None,
    is_bright: bool | None,
    turns: int | None,
    region: Region | None,
) -> View:
    """Choose the view with the clearest line among those that the user leaves open.

    pictures: (height, width) or (height, width, 3). A line that moves counts more than one that
    does not. turns 0 and 1 are tried: the line tells vertical from horizontal, not up from down.
    """
    planes: Sequence[str] = PLANES if plane is None else (plane,)
    if plane is None and is_grey(pictures[0]):
        planes = ("grey",)
    best: _Candidate | None = None
    for name in planes:
        for bright in (False, True) if is_bright is None else (is_bright,):
            for turn in (0, 1) if turns is None else (turns,):
                view = View(name, bright, turn, region)
                merit = _merit(pictures, view)
                if best is None or merit > best.merit:
                    best = _Candidate(view, merit)
    assert best is not None
    return best.view


def _merit(pictures: Sequence[Grey], view: View) -> float:
    chosen = np.unique(np.linspace(0, len(pictures) - 1, MEDIAN_PICTURES).round().astype(int))
    seen = [view.picture(pictures[index]) for index in chosen]
    median = median_picture(seen)
    scene = StaticScene(median, 1)
    moved = []
    for index in np.unique(np.linspace(0, len(seen) - 1, TRIED_PICTURES).round().astype(int)):
        picture = seen[index]
        noise = grey_levels(picture).noise
        found = find_lines(scene.without(picture), noise, 1, picture)
        moved.append(found[0].support * found[0].strength / noise if found else 0.0)
    still = find_lines(median, grey_levels(median).noise)
    merit = STATIC_WEIGHT * still[0].support * still[0].strength if still else 0.0
    return float(np.mean(moved)) + merit / grey_levels(seen[0]).noise
