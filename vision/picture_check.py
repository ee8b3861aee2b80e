"""Faults of pictures that only their neighbours show: repeated, damaged, cut, looped.

Each picture is sampled in all rows and about 80 columns of the plane with the most contrast; three
of these samples are compared, at equal light. Noise is told from change by the median difference of
the last pictures.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections import deque
from typing import NamedTuple

import cv2
import numpy as np

from vision.stream import Image, PictureFault

SAMPLED_COLUMNS = 80
WINDOW = 64  # pictures whose differences are remembered
MIN_KNOWN = 8  # differences before the least of them counts as noise
STEADY_SHARE = 0.7  # of the change before: the motion does not slow down
EXACT = 0.02  # grey levels; so little is a repetition without another compression
VISIBLE_NOISE = 0.5  # grey levels
MOVED, STILL_SHARE = 20, 0.1  # changed samples of a motion; of that, at rest
SAME_SHARE = 0.25  # a difference of so little of the noise is a repetition
CHANGE = 5.0  # median differences by which a sample has changed
CHANGE_OFFSET, MAX_CHANGE = 6.0, 40.0  # grey levels
MEDIAN_ROWS, MEDIAN_STEP = 40, 4  # rows and step of columns of which the light is taken
LIGHT_STEP = 2  # grey levels
CHANGED_ROW = 0.5  # of its samples
CUT_ROWS = 0.3  # of all rows
CUT_CORRELATION = 0.5  # less: another scene; more: another light
LOOP_PICTURES = 8
SPIKE, SPIKE_ROWS = 4.0, 0.2  # change of one picture: over that of its neighbours; of the rows


class Pair(NamedTuple):
    """Comparison of a picture with the one before."""

    difference: float  # mean over the samples that did not change, grey levels
    changed: int  # number of samples
    changed_rows: int  # rows most of whose samples changed
    is_same: bool


class PictureVerdict(NamedTuple):
    """Decision on a picture."""

    faults: frozenset[PictureFault]
    is_cut: bool


class PictureCheck:
    """Check of a stream of pictures of one size, one picture behind it."""

    def __init__(self, keeps_noise: bool = True) -> None:
        """keeps_noise: two pictures are never equal but where one is repeated.

        A codec that codes differences leaves noise out, and gives equal pictures of a load at rest.
        """
        self._keeps_noise = keeps_noise
        self._noise = _Recent()
        self._sample: Image | None = None  # of the picture that waits for its verdict
        self._good: Image | None = None  # of the last good picture
        # of the picture that waits with the one before, and the two comparisons before that
        self._pairs: deque[Pair | None] = deque([None] * 3, maxlen=3)
        self._was_damaged = False
        self._is_after_gap = False

    @property
    def noise(self) -> float:
        """Smallest usual difference of two pictures, grey levels; 0 while unknown."""
        return self._noise.floor() or 0.0

    def add(self, sample: Image, is_bad: bool, is_after_gap: bool) -> PictureVerdict | None:
        """Take the sample of the next picture; return the verdict on the one before, if any.

        is_bad: of the picture before, as its decoder says; is_after_gap: of this one.
        """
        before = self._sample
        if before is None:
            self._sample = sample
            return None
        pair = self._compare(sample, before)
        verdict = self._judge(before, pair, is_bad)
        self._pairs.append(pair)
        self._sample = sample
        self._is_after_gap = is_after_gap
        return verdict

    def finish(self, is_bad: bool) -> PictureVerdict | None:
        """Return the verdict on the last picture, which nothing confirms; None without pictures."""
        return None if self._sample is None else self._judge(self._sample, None, is_bad)

    def _compare(self, sample: Image, other: Image) -> Pair:
        difference, changed, rows = self._difference(sample, other)
        return Pair(difference, changed, rows, self._is_same(difference, changed))

    def _is_same(self, difference: float, changed: int) -> bool:
        """Tell if a picture repeats the one before."""
        _, earlier, pair = self._pairs
        floor = self._noise.floor()
        is_exact = difference <= EXACT and changed == 0
        if floor is None:
            return self._keeps_noise and is_exact
        follows_same = pair is not None and pair.is_same
        if floor >= VISIBLE_NOISE:
            # less than the noise once only: what stays as low is less noise
            is_less = difference <= SAME_SHARE * floor and changed == 0
            return is_exact or (is_less and not follows_same)
        if pair is None or follows_same:
            return follows_same and is_exact
        # motion stops at once; where it turns, it falls from picture to picture
        falls = earlier is not None and pair.changed < STEADY_SHARE * earlier.changed
        return pair.changed >= MOVED and changed <= STILL_SHARE * pair.changed and not falls

    def _difference(self, sample: Image, other: Image) -> tuple[float, int, int]:
        """Compare two pictures: mean difference, number of changed samples and of changed rows."""
        levels = cv2.absdiff(sample, _at_light_of(sample, other))
        limit = min(CHANGE * self._noise.median() + CHANGE_OFFSET, MAX_CHANGE)
        _, changed = cv2.threshold(levels, limit, 1, cv2.THRESH_BINARY)
        count = cv2.countNonZero(changed)
        _, quiet = cv2.threshold(levels, limit, 0, cv2.THRESH_TOZERO_INV)
        mean = cv2.sumElems(quiet)[0] / levels.size
        row_limit = CHANGED_ROW * sample.shape[1]
        if count <= row_limit:
            return mean, count, 0
        rows = cv2.reduce(changed, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32F)
        return mean, count, int(np.count_nonzero(rows > row_limit))

    def _judge(self, sample: Image, after: Pair | None, is_bad: bool) -> PictureVerdict:
        pair = self._pairs[-1]
        is_same = pair is not None and pair.is_same
        faults = self._repetitions(after)
        is_cut = False
        is_damaged = is_bad
        if is_same:
            is_damaged = is_damaged or self._was_damaged
        elif not is_bad:
            is_damaged, is_cut = self._place(sample, after)
            is_cut = is_cut or (not faults and self._is_spike(after, len(sample)))
        if is_damaged:
            faults.add(PictureFault.DAMAGED)
        elif not is_same:
            self._good = sample
            if pair is not None and not self._was_damaged:
                self._noise.add(pair.difference)
        self._was_damaged = is_damaged
        return PictureVerdict(frozenset(faults), is_cut)

    def _repetitions(self, after: Pair | None) -> set[PictureFault]:
        _, before, pair = self._pairs
        if pair is None or not pair.is_same:
            return set()
        is_run = any(other is not None and other.is_same for other in (before, after))
        return {PictureFault.FROZEN if is_run else PictureFault.DUPLICATE}

    def _place(self, sample: Image, after: Pair | None) -> tuple[bool, bool]:
        """Tell if the picture that waits is damaged, and if it begins another scene."""
        rows = self._rows_off(sample)
        if rows == 0:
            return False, False
        if after is not None and not after.is_same and after.changed_rows == 0:
            # the next one is like it: new content
            if self._good is None or rows < CUT_ROWS * len(sample):
                return False, False
            return False, _correlation(sample, self._good) < CUT_CORRELATION
        # the first picture, alone or repeated: nothing speaks against it
        is_first = self._pairs[-1] is None and (after is None or after.is_same)
        return not is_first, False

    def _rows_off(self, sample: Image) -> int:
        """Count the rows that differ from the last good picture."""
        if self._good is None:
            return len(sample)
        pair = self._pairs[-1]
        if pair is not None and not self._was_damaged:
            return pair.changed_rows  # the one before was good
        return self._difference(sample, self._good)[2]

    def _is_spike(self, after: Pair | None, rows: int) -> bool:
        """Tell if the picture changed far more than those before and after it."""
        _, before, pair = self._pairs
        if before is None or pair is None or after is None or self._is_after_gap:
            return False
        if before.is_same or after.is_same or self._was_damaged:
            return False
        usual = max(before.changed, after.changed)
        return pair.changed > SPIKE * usual + SPIKE_ROWS * rows


class LoopCheck:
    """Search for the first pictures of a stream later in it."""

    def __init__(self) -> None:
        self._first: list[Image] = []
        self._matched = 0  # pictures in a row
        self._has_moved = False
        self._is_found = False

    def add(self, sample: Image, noise: float) -> bool:
        """Take the next picture; tell once, LOOP_PICTURES after it, if the stream begins again."""
        if len(self._first) < LOOP_PICTURES:
            self._first.append(sample)
            return False
        if self._is_found:
            return False
        limit = CHANGE * noise + CHANGE_OFFSET
        expected = self._first[self._matched]
        is_moved = cv2.norm(sample, expected, cv2.NORM_INF) > limit
        self._has_moved = self._has_moved or is_moved
        difference = cv2.norm(sample, expected, cv2.NORM_L1) / sample.size
        is_alike = not is_moved and difference <= SAME_SHARE * noise + EXACT
        self._matched = self._matched + 1 if is_alike else 0
        self._is_found = self._has_moved and self._matched == LOOP_PICTURES
        if self._matched == LOOP_PICTURES:
            self._matched = 0
        return self._is_found


def busiest_plane(image: Image) -> int:
    """Return the number of the plane with the most contrast; 0 for a grey picture."""
    if image.ndim == 2:
        return 0
    _, deviations = cv2.meanStdDev(image)
    return int(np.argmax(deviations))


def sampled(image: Image, plane: int) -> Image:
    """Take all rows and about 80 columns of a plane of a picture."""
    step = max(1, image.shape[1] // SAMPLED_COLUMNS)
    return np.ascontiguousarray(image[:, ::step] if image.ndim == 2 else image[:, ::step, plane])


def _at_light_of(sample: Image, other: Image) -> Image:
    """Scale the other picture to the median level of the first: lamps flicker and steps of light.

    The median stands for the screen, whatever moves before it or is damaged.
    """
    level, other_level = _median_level(sample), _median_level(other)
    if abs(level - other_level) < LIGHT_STEP or other_level == 0:
        return other
    return np.asarray(cv2.convertScaleAbs(other, alpha=level / other_level), np.uint8)


def _median_level(sample: Image) -> int:
    step = max(1, len(sample) // MEDIAN_ROWS)
    levels = sample[::step, ::MEDIAN_STEP].ravel()
    middle = levels.size // 2
    levels.partition(middle)
    return int(levels[middle])


def _correlation(sample: Image, other: Image) -> float:
    pair = np.stack([sample.ravel(), other.ravel()]).astype(np.float32)
    pair -= pair.mean(axis=1, keepdims=True)
    energy = float(np.linalg.norm(pair[0]) * np.linalg.norm(pair[1]))
    return float(pair[0] @ pair[1]) / energy if energy > 0.0 else 1.0


class _Recent:
    """Last differences, sorted."""

    def __init__(self) -> None:
        self._order: deque[float] = deque()
        self._sorted: list[float] = []

    def add(self, value: float) -> None:
        self._order.append(value)
        insort(self._sorted, value)
        if len(self._order) > WINDOW:
            del self._sorted[bisect_left(self._sorted, self._order.popleft())]

    def median(self) -> float:
        """Return the middle; infinite while few are known."""
        if len(self._sorted) < MIN_KNOWN:
            return math.inf
        return self._sorted[len(self._sorted) // 2]

    def floor(self) -> float | None:
        """Return the lowest tenth; None while few are known."""
        if len(self._sorted) < MIN_KNOWN:
            return None
        return self._sorted[len(self._sorted) // 10]
