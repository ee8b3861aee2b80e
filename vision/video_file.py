"""Video files: frames with the time stamps of the container, and what their decoder says."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import closing
from itertools import count as count_from
from pathlib import Path

import cv2
import numpy as np

from vision.container import unreadable
from vision.decoder_messages import DecoderMessages
from vision.errors import VisionError
from vision.jpeg_sizes import JpegSizes
from vision.stream import (
    About,
    FindingKind,
    PictureFault,
    SourceFrame,
    SourceOptions,
    StampKind,
    StreamFinding,
)
from vision.stream_check import checked, no_stamps, spread_evenly, within

MIN_RATE_HZ, MAX_RATE_HZ = 0.001, 10_000.0  # containers without a rate report 0, NaN or 90,000
PROBED_FRAMES = 16
SEEK_FRAMES = 1000  # a longer file is not read twice, if seeking in it works
REORDERED_FRAMES = 4  # a key frame is shown so much later than it is decoded
INDEPENDENT = ("MJPG", "MPNG")  # codecs without reference to other pictures
LOSSLESS = ("FFV1", "HFYU", "FFVH")
IN_ORDER = ("FFV1",)  # codecs that show frames as they decode them
EARLY_INTERVALS, EARLY_SHARE = 2.0, 0.005  # the stated duration may be off by so much
COPY_AGAIN = "copy it again from the camera"
DAMAGED = frozenset({PictureFault.DAMAGED})


class VideoFile:
    """Video file; can be read any number of times."""

    def __init__(self, path: Path, options: SourceOptions) -> None:
        """Open path; raises VisionError if it is no video that can be read."""
        self._path = path
        self._options = options
        self.findings: list[StreamFinding] = []
        with DecoderMessages() as messages:
            capture = _open(path, messages)
            self.about = _about(path, capture)
            stamps_ms = _probed_stamps_ms(capture, messages)
            capture.release()
        if not stamps_ms:
            raise VisionError(
                f"{path}: a video of codec {self.about.codec}, but no frame of it can be decoded; "
                "need 1 or more: record it again, or convert it to FFV1 or MJPG"
            )
        self._stamp = self._choose_stamp(stamps_ms)

    def frames(self) -> Iterator[SourceFrame]:
        """Read all frames from from_s to to_s."""
        self.findings.clear()
        if self._stamp is StampKind.INDEX:
            self.findings.append(no_stamps(self._stamp, self._rate_hz))
        with closing(_Reading(self._path, self.about, self._sizes(), self.findings)) as reading:
            stamped = reading.frames(self._stamp, self._rate_hz)
            keeps_noise = self.about.codec.upper() in INDEPENDENT + LOSSLESS
            yield from checked(within(stamped, self._options), self.findings, keeps_noise)

    def spread(self, count: int) -> list[SourceFrame]:
        """Read count frames, or all if there are fewer, spread over from_s to to_s.

        A long file is read by seeking if the stamps then rise, else from start to end.
        """
        is_whole = self._options.from_s is None and self._options.to_s is None
        with closing(_Reading(self._path, self.about, None, [])) as reading:
            if is_whole and (self.about.frames or 0) > SEEK_FRAMES:
                found = reading.sought(count, self._stamp, self._rate_hz)
                if found:
                    return found
        with closing(_Reading(self._path, self.about, None, [], cv2.getNumberOfCPUs())) as reading:
            stamped = reading.frames(self._stamp, self._rate_hz)
            return spread_evenly(within(stamped, self._options), count)

    @property
    def _rate_hz(self) -> float:
        return self._options.rate_hz or self.about.rate_hz or 1.0

    def _sizes(self) -> JpegSizes | None:
        is_jpeg = self.about.codec.upper() == "MJPG"
        return JpegSizes(self._path) if is_jpeg else None

    def _choose_stamp(self, stamps_ms: list[float]) -> StampKind:
        if self._options.rate_hz is not None:
            return StampKind.RATE
        if len(set(stamps_ms)) > 1 or len(stamps_ms) == 1:
            return StampKind.CONTAINER
        if self.about.rate_hz is None:
            raise VisionError(
                f"{self._path}: the time stamps are all {stamps_ms[0]:g} ms, and no frame rate is "
                "stated; need one of them: give the rate with --rate"
            )
        return StampKind.INDEX


class _Reading:
    """One pass over a file.

    threads: of the decoder. With more than one its complaints belong to no certain frame.
    """

    def __init__(
        self,
        path: Path,
        about: About,
        sizes: JpegSizes | None,
        findings: list[StreamFinding],
        threads: int = 1,
    ) -> None:
        self._about = about
        self._sizes = sizes
        self._findings = findings
        self._messages = DecoderMessages()
        try:
            self._capture = _open(path, self._messages, threads)
        except VisionError:
            self._messages.close()
            raise
        self._bad_left = 0.0  # frames, of which the next key frame frees

    def close(self) -> None:
        self._capture.release()
        self._messages.close()
        if self._sizes is not None:
            self._sizes.close()

    def frames(self, stamp: StampKind, rate_hz: float) -> Iterator[SourceFrame]:
        """Decode all frames; those of which the decoder complains are DAMAGED."""
        first_ms = last_ms = 0.0
        for number in count_from():
            if not self._messages.call(self._capture.grab):
                self._note_end(number, 1e-3 * (last_ms - first_ms))
                return
            last_ms = self._capture.get(cv2.CAP_PROP_POS_MSEC)
            if number == 0:
                first_ms = last_ms
            t_s = number / rate_hz
            if stamp is StampKind.CONTAINER:
                t_s = 1e-3 * (last_ms - first_ms)
            faults = DAMAGED if self._is_bad() else frozenset()
            if self._sizes is not None:
                self._note_size(number, self._sizes)
            ok, image = self._capture.retrieve()
            if ok:
                yield SourceFrame(number, t_s, stamp, np.asarray(image, np.uint8), faults)

    def sought(self, count: int, stamp: StampKind, rate_hz: float) -> list[SourceFrame]:
        """Seek count frames; [] if the file does not give them in order."""
        found: list[SourceFrame] = []
        places = np.linspace(0, (self._about.frames or 1) - 1, count + 1).astype(int)[:-1]
        for place in places:
            self._messages.call(self._capture.set, cv2.CAP_PROP_POS_FRAMES, int(place))
            if not self._messages.call(self._capture.grab) or self._messages.last:
                return []
            ok, image = self._capture.retrieve()
            t_s = place / rate_hz
            if stamp is StampKind.CONTAINER:
                t_s = 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC)
            if not ok or (found and t_s <= found[-1].t_s):
                return []
            found.append(SourceFrame(int(place), t_s, stamp, np.asarray(image, np.uint8)))
        return found

    def _is_bad(self) -> bool:
        """Tell if the decoder complained of this frame, or of one that it refers to."""
        is_key = self._capture.get(cv2.CAP_PROP_LRF_HAS_KEY_FRAME) > 0
        codec = self._about.codec.upper()
        if self._messages.last:
            self._bad_left = 1.0 if codec in INDEPENDENT else math.inf
        elif is_key and math.isinf(self._bad_left):
            self._bad_left = 0.0 if codec in IN_ORDER else REORDERED_FRAMES
        is_bad = self._bad_left > 0.0
        self._bad_left = max(0.0, self._bad_left - 1.0)
        return is_bad

    def _note_size(self, number: int, sizes: JpegSizes) -> None:
        before, now = sizes.step()
        if before is None or now is None or before == now:
            return
        text = (
            f"the pictures change from {before[0]}x{before[1]} to {now[0]}x{now[1]} pixels and are "
            "scaled to the first size: pivot and scale may change; analyse the parts by themselves"
        )
        ratio = now[0] / before[0]
        self._findings.append(StreamFinding(FindingKind.SIZE_CHANGE, number, number, ratio, text))

    def _note_end(self, read: int, last_s: float) -> None:
        """Report an end before the one that the file states, and what the decoder says of it."""
        if self._messages.last:
            text = f"the decoder ends with '{self._messages.last[0]}': {COPY_AGAIN}"
            self._findings.append(StreamFinding(FindingKind.DAMAGED, read, read, 1.0, text))
        stated, rate_hz = self._about.frames, self._about.rate_hz
        if stated is None or rate_hz is None or read >= stated:
            return
        stated_s = stated / rate_hz
        end_s = last_s + 1.0 / rate_hz
        if stated_s - end_s <= EARLY_INTERVALS / rate_hz + EARLY_SHARE * stated_s:
            return
        text = (
            f"{read} frames can be read, to {end_s:.3f} s, but the file states {stated}, to "
            f"{stated_s:.3f} s: it was cut short; {COPY_AGAIN}"
        )
        last = max(0, read - 1)
        self._findings.append(StreamFinding(FindingKind.ENDS_EARLY, last, last, float(read), text))


def _open(path: Path, messages: DecoderMessages, threads: int = 1) -> cv2.VideoCapture:
    """Open a video file; with one thread each message of the decoder belongs to its frame."""
    settings = [cv2.CAP_PROP_N_THREADS, threads]
    capture = messages.call(cv2.VideoCapture, str(path), cv2.CAP_FFMPEG, settings)
    if not capture.isOpened():
        raise VisionError(unreadable(path))
    return capture


def _about(path: Path, capture: cv2.VideoCapture) -> About:
    rate_hz = capture.get(cv2.CAP_PROP_FPS)
    frames = capture.get(cv2.CAP_PROP_FRAME_COUNT)
    code = int(capture.get(cv2.CAP_PROP_FOURCC))
    return About(
        name=str(path),
        kind="video",
        width=int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
        height=int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        rate_hz=rate_hz if MIN_RATE_HZ <= rate_hz <= MAX_RATE_HZ else None,
        frames=int(frames) if frames > 0 else None,
        codec=code.to_bytes(4, "little", signed=code < 0).decode("latin1").strip("\0 "),
        is_live=False,
    )


def _probed_stamps_ms(capture: cv2.VideoCapture, messages: DecoderMessages) -> list[float]:
    """Read stamps until two differ."""
    stamps_ms: list[float] = []
    while len(stamps_ms) < PROBED_FRAMES and len(set(stamps_ms)) < 2:
        if not messages.call(capture.grab):
            break
        stamps_ms.append(capture.get(cv2.CAP_PROP_POS_MSEC))
    return stamps_ms
