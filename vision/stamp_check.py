"""Irregular time stamps: steps back, repetitions, gaps, an uneven rate."""

from __future__ import annotations

from collections import deque

import numpy as np

from vision.stream import FindingKind, StreamFinding

GAP = 1.5  # of the median interval
UNEVEN = 0.1  # an interval is off by so much of the median
UNEVEN_SHARE = 0.1  # more of the intervals: the rate itself is uneven
RECENT = 15  # intervals
MS = 1e3


class StampCheck:
    """Check of the time stamps of a stream."""

    def __init__(self, findings: list[StreamFinding]) -> None:
        """findings: where to append what is found."""
        self._findings = findings
        self._numbers: list[int] = []
        self._stamps_s: list[float] = []
        self._recent_s: deque[float] = deque(maxlen=RECENT)

    def add(self, number: int, t_s: float) -> bool:
        """Take the next stamp [s]; tell if it comes after a gap or a step back."""
        interval_s = t_s - self._stamps_s[-1] if self._stamps_s else 0.0
        self._numbers.append(number)
        self._stamps_s.append(t_s)
        if len(self._stamps_s) == 1:
            return False
        if interval_s < 0.0:
            self._note(
                FindingKind.STEP_BACK,
                number,
                -interval_s,
                f"the time stamps step back by {-interval_s:.3f} s: two recordings were joined, "
                "analyse each part by itself, with --from and --to on a copy that is cut there",
            )
            return True
        if interval_s == 0.0:
            self._note(
                FindingKind.REPEATED_STAMP,
                number,
                t_s,
                f"the time stamp {t_s:.4f} s is that of the frame before: its angle has no time "
                "of its own; give the true rate with --rate",
            )
            return False
        recent = sorted(self._recent_s)
        self._recent_s.append(interval_s)
        return bool(recent) and interval_s > GAP * recent[len(recent) // 2]

    def finish(self) -> None:
        """Report gaps and an uneven rate."""
        intervals_s = np.diff(self._stamps_s)
        forward_s = intervals_s[intervals_s > 0.0]
        if len(forward_s) < 2:
            return
        median_s = float(np.median(forward_s))
        share = np.mean(np.abs(forward_s - median_s) > UNEVEN * median_s)
        if share > UNEVEN_SHARE:
            low_s, high_s = np.quantile(forward_s, [0.05, 0.95])
            first, last = self._numbers[0], self._numbers[-1]
            text = (
                f"the intervals of {100.0 * share:.0f} % of the frames are not the median: "
                f"{low_s * MS:.2f} to {high_s * MS:.2f} ms (5 to 95 %); the time stamps are used, "
                "there is nothing to do"
            )
            ratio = float(high_s / low_s)
            self._findings.append(StreamFinding(FindingKind.UNEVEN_RATE, first, last, ratio, text))
            median_s = float(high_s)
        for index in np.flatnonzero(intervals_s > GAP * median_s):
            missing_s = float(intervals_s[index]) - median_s
            self._note(
                FindingKind.GAP,
                self._numbers[index + 1],
                missing_s,
                f"{missing_s:.3f} s are missing before it: the time stamps allow for it; for a "
                "full record, record again at a lower rate or to a faster disk",
            )

    @property
    def median_s(self) -> float:
        """Median of the rising intervals [s]; 0 for fewer than two frames."""
        intervals_s = np.diff(self._stamps_s)
        forward_s = intervals_s[intervals_s > 0.0]
        return float(np.median(forward_s)) if len(forward_s) else 0.0

    def _note(self, kind: FindingKind, number: int, value: float, text: str) -> None:
        self._findings.append(StreamFinding(kind, number, number, value, text))
