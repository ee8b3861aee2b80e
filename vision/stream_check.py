"""Check of a stream while its frames pass: flags on the frames, and findings on the stream."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

import numpy as np

from vision.picture_check import LOOP_PICTURES, LoopCheck, PictureCheck, busiest_plane, sampled
from vision.stamp_check import StampCheck
from vision.stream import (
    FindingKind,
    Image,
    PictureFault,
    SourceFrame,
    SourceOptions,
    StampKind,
    StreamFinding,
)

MIN_PULLDOWN = 4  # repetitions at equal distances
RUN_TEXTS = {
    FindingKind.DAMAGED: "damaged: rows do not fit the pictures before and after, or the decoder "
    "says so; no angle is taken there. Copy the file again, or fix a camera that shakes",
    FindingKind.FROZEN: "the picture stands still: no angle is taken there; check camera and cable "
    "of the camera",
    FindingKind.DUPLICATE: "shows the picture before: no angle is taken there; record at the rate "
    "of the camera",
}
FAULT_KINDS = {
    PictureFault.DAMAGED: FindingKind.DAMAGED,
    PictureFault.FROZEN: FindingKind.FROZEN,
    PictureFault.DUPLICATE: FindingKind.DUPLICATE,
}


def checked(
    frames: Iterator[SourceFrame], findings: list[StreamFinding], keeps_noise: bool = True
) -> Iterator[SourceFrame]:
    """Pass frames on, each when the next one is known, with their faults.

    Appends to findings what is irregular; those on time and on runs of frames when the stream ends.
    Pictures of one size are expected; keeps_noise: as in PictureCheck.
    """
    check = _StreamCheck(findings, keeps_noise)
    try:
        waiting: SourceFrame | None = None
        for frame in frames:
            faults = check.add(frame, waiting)
            if waiting is not None:
                yield waiting._replace(faults=faults)
            waiting = frame
        if waiting is not None:
            yield waiting._replace(faults=check.add(None, waiting))
    finally:
        check.finish()


def within(frames: Iterator[SourceFrame], options: SourceOptions) -> Iterator[SourceFrame]:
    """Pass on the frames from from_s to to_s; ends at the first later one."""
    for frame in frames:
        if options.to_s is not None and frame.t_s > options.to_s:
            return
        if options.from_s is None or frame.t_s >= options.from_s:
            yield frame


def spread_evenly(frames: Iterator[SourceFrame], count: int) -> list[SourceFrame]:
    """Take count frames at equal distances, or all if there are fewer, from a stream of any length.

    Keeps one of each step; the step doubles when twice as many are kept.
    """
    kept: list[SourceFrame] = []
    step = 1
    for index, frame in enumerate(frames):
        if index % step:
            continue
        kept.append(frame)
        if len(kept) == 2 * count:
            kept = kept[::2]
            step *= 2
    chosen = np.linspace(0, len(kept) - 1, min(count, len(kept))).round().astype(int)
    return [kept[index] for index in chosen]


def summary(findings: list[StreamFinding]) -> list[str]:
    """Write one line for each kind of finding: which frames, and the text of the first."""
    lines = []
    by_kind = sorted(findings, key=lambda finding: (finding.kind.value, finding.first))
    for _, group in groupby(by_kind, key=lambda finding: finding.kind):
        members = list(group)
        places = [_place(finding) for finding in members[:5]]
        if len(members) > len(places):
            places.append(f"{len(members) - len(places)} more")
        noun = "frame" if len(members) == 1 and members[0].first == members[0].last else "frames"
        lines.append(f"{noun} {', '.join(places)}: {members[0].text}")
    return lines


def _place(finding: StreamFinding) -> str:
    if finding.first == finding.last:
        return str(finding.first)
    return f"{finding.first} to {finding.last}"


class _StreamCheck:
    def __init__(self, findings: list[StreamFinding], keeps_noise: bool) -> None:
        self._findings = findings
        self._stamps = StampCheck(findings)
        self._pictures = PictureCheck(keeps_noise)
        self._loop = LoopCheck()
        self._plane = 0
        self._sample: Image | None = None  # of the frame that waits
        self._faulty: dict[PictureFault, list[int]] = {fault: [] for fault in PictureFault}
        self._is_finished = False

    def add(
        self, frame: SourceFrame | None, waiting: SourceFrame | None
    ) -> frozenset[PictureFault]:
        """Take the next frame, None at the end; return the faults of the one that waits."""
        sample: Image | None = None
        is_bad = waiting is not None and PictureFault.DAMAGED in waiting.faults
        if frame is None:
            verdict = self._pictures.finish(is_bad)
        else:
            is_after_gap = self._stamps.add(frame.number, frame.t_s)
            if waiting is None:
                self._plane = busiest_plane(frame.image)
            sample = sampled(frame.image, self._plane)
            verdict = self._pictures.add(sample, is_bad, is_after_gap)
        waiting_sample = self._sample
        self._sample = sample
        if verdict is None or waiting is None or waiting_sample is None:
            return frozenset()
        for fault in verdict.faults:
            self._faulty[fault].append(waiting.number)
        if verdict.is_cut:
            self._note_cut(waiting)
        if not verdict.faults:
            self._look_for_loop(waiting, waiting_sample)
        return verdict.faults

    def finish(self) -> None:
        """Report what the whole stream shows."""
        if self._is_finished:
            return
        self._is_finished = True
        self._stamps.finish()
        for fault, numbers in self._faulty.items():
            self._note_runs(FAULT_KINDS[fault], numbers)
        self._note_pulldown()
        self._findings.sort(key=lambda finding: finding.first)

    def _note_cut(self, frame: SourceFrame) -> None:
        text = (
            f"the picture jumps at {frame.t_s:.3f} s: the recording was cut there, or is damaged; "
            "analyse the parts by themselves, with --from and --to"
        )
        self._findings.append(
            StreamFinding(FindingKind.CUT, frame.number, frame.number, frame.t_s, text)
        )

    def _look_for_loop(self, frame: SourceFrame, sample: Image) -> None:
        if not self._loop.add(sample, self._pictures.noise):
            return
        text = (
            f"the first pictures come again before {frame.t_s:.3f} s: the recording is a loop; "
            "analyse one round, with --to"
        )
        number = frame.number - LOOP_PICTURES + 1
        self._findings.append(StreamFinding(FindingKind.LOOP, number, number, frame.t_s, text))

    def _note_runs(self, kind: FindingKind, numbers: list[int]) -> None:
        breaks = np.flatnonzero(np.diff(numbers) > 1) + 1
        for run in np.split(np.array(numbers, int), breaks):
            if len(run):
                finding = StreamFinding(
                    kind, int(run[0]), int(run[-1]), float(len(run)), RUN_TEXTS[kind]
                )
                self._findings.append(finding)

    def _note_pulldown(self) -> None:
        numbers = self._faulty[PictureFault.DUPLICATE]
        steps = np.diff(numbers)
        if len(numbers) < MIN_PULLDOWN or np.ptp(steps) > 0:
            return
        step = int(steps[0])
        text = (
            f"every {step}th frame repeats the one before: the video was converted from a lower "
            f"rate, {step - 1} of {step} frames are true; analyse the original"
        )
        finding = StreamFinding(FindingKind.PULLDOWN, numbers[0], numbers[-1], float(step), text)
        self._findings.append(finding)


def no_stamps(kind: StampKind, rate_hz: float) -> StreamFinding:
    """Make the finding on a source without time stamps."""
    text = (
        f"the source has no time stamps: time is the number of the frame over {rate_hz:g} Hz "
        f"({kind.value}); give the true rate with --rate if it is another"
    )
    return StreamFinding(FindingKind.NO_STAMPS, 0, 0, rate_hz, text)
