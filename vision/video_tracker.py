"""Tracker of a video that finds view, static scene, cable and pivot by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vision.bob import BobTracker
from vision.bob_look import about_pivot
from vision.first_look import Look, LookChoices, Subject, look
from vision.fit import Fit, TrackFailure
from vision.line_fit import Grey
from vision.tracker import Tracker
from vision.view import Point, plane_of

GATE_REASONS = (TrackFailure.NO_CABLE, TrackFailure.PIVOT_MISSED, TrackFailure.FEW_ROWS)


class VideoTracker:
    """Cable tracker for `rig track`; see vision.protocol.

    Without prepare() it measures like the tracker of the rig, in the red plane. A told pivot is
    corrected by the first look unless keeps_pivot.
    """

    colour = True

    def __init__(
        self,
        width: int,
        height: int,
        choices: LookChoices | None = None,
        *,
        keeps_pivot: bool = False,
    ) -> None:
        self._size = (width, height)
        self._choices = choices or LookChoices()
        self._keeps_pivot = keeps_pivot
        self.look: Look | None = None
        self._tracker: Tracker | BobTracker = Tracker(width, height)
        self._shift_px = (0.0, 0.0)  # from a told pivot to the true one
        self._last: Grey | None = None
        self._repeated = 0  # times that the last picture came again

    def prepare(self, pictures: Sequence[Grey], pivots_px: Sequence[Point] | None = None) -> None:
        """Look at pictures spread over the video before any is measured."""
        found = look(pictures, pivots_px, self._choices)
        self.look = found
        width, height = found.view.size(*self._size)
        is_corrected = found.is_pivot_known and not self._keeps_pivot
        if found.bob is not None:
            is_told = bool(pivots_px) and not is_corrected
            bob = found.bob
            if pivots_px and is_told:
                bob = about_pivot(bob, found.view.to_view(pivots_px[0], self._size))
            self._tracker = BobTracker(bob, is_pivot_told=is_told)
        else:
            self._tracker = Tracker(width, height, found.cable, found.scene)
        if pivots_px and is_corrected and found.pivot is not None:
            told = found.view.to_view(pivots_px[0], self._size)
            true = found.pivot.at_px
            self._shift_px = (true[0] - told[0], true[1] - told[1])

    def measure(self, image: Grey, pivot_px: Point | None) -> Fit:
        """Measure the angle in a picture (height, width, 3) or (height, width).

        pivot_px: None: that of the first look. Lines and rows of the result are those of the view.
        """
        fit = self._measured(image, pivot_px)
        if self._choices.at_rest:
            return fit  # pictures of a cable that hangs still may be equal
        repetition = self._repetition(image)
        if fit.valid and repetition is not None:
            return replace(fit, angle_rad=None, sigma_rad=None, reason=repetition, lower=None)
        return fit

    @property
    def height(self) -> int:
        """Height of the view [px]."""
        width, height = self._size
        return height if self.look is None else self.look.view.size(width, height)[1]

    def gate_px(self, pivot_px: Point | None) -> Point | None:
        """Compute the place in the view that the cable must pass; None if it is not known."""
        if self.look is None:
            return pivot_px
        if pivot_px is None:
            return self.look.gate_px()
        x, y = self.look.view.to_view(pivot_px, self._size)
        return x + self._shift_px[0], y + self._shift_px[1]

    def _measured(self, image: Grey, pivot_px: Point | None) -> Fit:
        gate_px = self.gate_px(pivot_px)
        if gate_px is None:
            return Fit(reason=TrackFailure.NO_CABLE)
        if self.look is None:
            return self._tracker.measure(np.ascontiguousarray(plane_of(image, "red")), gate_px)
        fit = self._tracker.measure(self.look.view.picture(image), gate_px)
        if self.look.subject is Subject.STILL and fit.reason in GATE_REASONS:
            return replace(fit, reason=TrackFailure.STATIC)
        return fit

    def _repetition(self, image: Grey) -> TrackFailure | None:
        """Tell if a picture equals the last one in every pixel."""
        is_same = self._last is not None and np.array_equal(self._last, image)
        self._last = image.copy()
        self._repeated = self._repeated + 1 if is_same else 0
        if self._repeated == 0:
            return None
        return TrackFailure.DUPLICATE if self._repeated == 1 else TrackFailure.FROZEN
