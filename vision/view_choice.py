"""Choice of the colour plane, the polarity and the turn in which a cable is seen best."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vision.free_lines import find_lines
from vision.line_fit import Grey
from vision.ridge import grey_levels
from vision.static_scene import StaticScene, median_picture
from vision.view import PLANES, PictureRegion, PictureView, is_grey

MEDIAN_PICTURES = 15
TRIED_PICTURES = 6
STATIC_WEIGHT = 0.25  # of a line that does not move, against one that does


class _Candidate(NamedTuple):
    view: PictureView
    merit: float  # rows times strength over noise


def choose_view(
    pictures: Sequence[Grey],
    plane: str | None,
    is_bright: bool | None,
    turns: int | None,
    region: PictureRegion | None,
) -> PictureView:
    """Choose the view with the clearest line among those that the user leaves open.

    pictures: (height, width) or (height, width, 3). A line that moves counts more than one that
    does not. turns 0 and 1 are tried: the line tells vertical from horizontal, not up from down.
    """
    planes: Sequence[str] = PLANES if plane is None else (plane,)
    if plane is None and is_grey(pictures[0]):
        planes = ("grey",)
    chosen = [pictures[index] for index in _spread(len(pictures), MEDIAN_PICTURES)]
    best: _Candidate | None = None
    for name in planes:
        seen = [PictureView(name, region=region).picture(picture) for picture in chosen]
        median = median_picture(seen)
        tried = [seen[index] for index in _spread(len(seen), TRIED_PICTURES)]
        for bright in (False, True) if is_bright is None else (is_bright,):
            for turn in (0, 1) if turns is None else (turns,):
                turned = PictureView("grey", bright, turn)
                merit = _merit([turned.picture(p) for p in tried], turned.picture(median))
                if best is None or merit > best.merit:
                    best = _Candidate(PictureView(name, bright, turn, region), merit)
    assert best is not None
    return best.view


def _spread(count: int, most: int) -> list[int]:
    """Choose at most `most` of count indices at equal distances."""
    return sorted(set(np.linspace(0, count - 1, most).round().astype(int).tolist()))


def _merit(pictures: Sequence[Grey], median: Grey) -> float:
    """Rate the clearest line of a view, cable dark: support times strength over noise."""
    scene = StaticScene(median, 1)
    moved = []
    for picture in pictures:
        noise = grey_levels(picture).noise
        found = find_lines(scene.without(picture), noise, 1, picture)
        moved.append(found[0].support * found[0].strength / noise if found else 0.0)
    still = find_lines(median, grey_levels(median).noise)
    merit = STATIC_WEIGHT * still[0].support * still[0].strength if still else 0.0
    return float(np.mean(moved)) + merit / grey_levels(pictures[0]).noise
