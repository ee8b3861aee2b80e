"""`rig track VIDEO`: first look, angle in every frame, summary with verdict."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
from rich.progress import Progress

from rig.errors import BAD_DATA, EXIT_STATUS, OK, ConfigError, RigError
from rig.run import runs
from rig.ui.cli.output import print_json
from rig.ui.cli.page import err, print_paragraph, print_written
from rig.ui.cli.track_calibration import read_calibration
from rig.ui.cli.track_files import OverlayVideo, check_log, check_overlay, write_log, write_table
from rig.ui.cli.track_filter import AngleFilter, Filtered, filter_of
from rig.ui.cli.track_options import TrackOptions
from rig.ui.cli.track_text import look_document, print_look, print_video_summary, video_document
from rig.ui.cli.track_verdict import TrackedVideo, judge, worded
from rig.ui.plots import picture_file
from vision.errors import VisionError
from vision.first_look import Look, Subject
from vision.sources import open_source
from vision.stream import FrameStream, SourceFrame
from vision.tracked import MeasureOptions, TrackedFrame, tracked_frames, without_readout_bend
from vision.video_tracker import VideoTracker
from vision.view import Point

LOOK_PICTURES = 30
STAMPS_NAME = "stamps.csv"  # of a folder of pictures


def track_video(options: TrackOptions) -> int:
    """Track a video, write the files wanted and print the summary; returns the exit code."""
    pivot_px, choices, row_s = options.pivot_px(), options.choices(), options.row_s()
    position_m = options.position_m()
    wanted = None if options.filter is None else filter_of(options.filter)
    _check_files(options)
    cv2.setNumThreads(1)
    source = _opened(options)
    spread = source.spread(LOOK_PICTURES)
    if not spread:
        raise _no_frames(options, source)
    height, width = spread[0].image.shape[:2]
    if choices.region is not None:
        x, y, w, h = choices.region
        if x + w > width or y + h > height:
            raise ConfigError(
                f"--roi '{options.roi}'; must lie in the picture of {width} x {height} px: "
                "correct it"
            )
    calibration = None
    if options.calibration is not None:
        calibration = read_calibration(options.calibration, position_m, (width, height))
    expected_px = pivot_px
    if calibration is not None and pivot_px is None:
        expected_px = calibration.placement.pivot_px()
    tracker = VideoTracker(width, height, choices, keeps_pivot=pivot_px is not None)
    _prepare(tracker, spread, expected_px)
    assert tracker.look is not None
    if options.plot is not None:
        _draw_look(options, tracker.look)
    if options.look:
        return _show_look(options, tracker.look, source)
    if not options.as_json:
        print_look(options, tracker.look, source)
    placement = None if calibration is None else calibration.placement
    chosen = MeasureOptions(expected_px, placement, row_s, choices.at_rest)
    rows = _measure(options, source, tracker, chosen)
    if row_s:
        rows = without_readout_bend(rows, row_s)
    gate_px = tracker.gate_px(expected_px)
    findings = list(source.findings)
    tracked = TrackedVideo(rows, tracker.look, source, findings, pivot_px, gate_px, calibration)
    return _finish(options, tracked, wanted)


def _opened(options: TrackOptions) -> FrameStream:
    where: str | Path = options.video
    if not Path(options.video).exists():
        with suppress(RigError):
            where = runs.find_log(options.video, runs.RUNS)
    try:
        return open_source(where, options.source())
    except VisionError as error:
        raise ConfigError(str(error)) from None


def _prepare(tracker: VideoTracker, spread: list[SourceFrame], expected_px: Point | None) -> None:
    """Show spread frames of one size to the tracker, with the pivot where it is known."""
    shape = spread[0].image.shape
    used = [frame for frame in spread if frame.image.shape == shape]
    pivots = [frame.pivot_px or expected_px for frame in used]
    known = [pivot for pivot in pivots if pivot is not None]
    pictures = [frame.image for frame in used]
    tracker.prepare(pictures, known if len(known) == len(used) else None)


def _no_frames(options: TrackOptions, source: FrameStream) -> Exception:
    """Explain why no frame was read."""
    if options.from_s is None and options.to_s is None:
        return VisionError(
            f"{options.video}: 0 frames decoded; must be 1 or more: the file is empty or cut "
            "short, record it again"
        )
    about = source.about
    stated = "its length"
    if about.frames is not None and about.rate_hz is not None:
        stated = f"about {about.frames / about.rate_hz:.4g} s"
    part = [f"--from {options.from_s:g}"] if options.from_s is not None else []
    part += [f"--to {options.to_s:g}"] if options.to_s is not None else []
    return ConfigError(
        f"{' '.join(part)} leaves no frame of {options.video}; must be within 0 and {stated}: "
        "choose another part"
    )


def _check_files(options: TrackOptions) -> None:
    """Raise ConfigError for a file that cannot be written, before the work."""
    _check_outputs(options)
    if options.plot is not None:
        picture_file.check(options.plot)
    if options.overlay is not None:
        check_overlay(options.overlay)
    if options.csv is not None:
        picture_file.check_folder("--csv", options.csv)
    if options.mcap is not None:
        check_log(options.mcap)


def _check_outputs(options: TrackOptions) -> None:
    """Raise ConfigError for a file to write that is read: it would be lost."""
    source = Path(options.video)
    read = [source, *(source / name for name in (STAMPS_NAME, runs.LOG))]
    for option, path in (
        ("--plot", options.plot),
        ("--csv", options.csv),
        ("--mcap", options.mcap),
        ("--overlay", options.overlay),
    ):
        if path is None or not path.exists():
            continue
        if any(one.exists() and path.samefile(one) for one in read):
            raise ConfigError(
                f"{option} '{path}' is what is read; must be another file, or it would be lost: "
                "choose another name"
            )


def _measure(
    options: TrackOptions, source: FrameStream, tracker: VideoTracker, chosen: MeasureOptions
) -> list[TrackedFrame]:
    overlay: OverlayVideo | None = None
    if options.overlay is not None and tracker.look is not None:
        overlay = OverlayVideo(options.overlay, tracker.look, source.about.rate_hz)
    rows: list[TrackedFrame] = []
    with Progress(console=err, transient=True, disable=options.as_json) as bar:
        line = bar.add_task("measuring", total=source.about.frames)
        for tracked in tracked_frames(source.frames(), tracker, chosen):
            rows.append(tracked.row)
            if overlay is not None:
                overlay.add(tracked)
            bar.update(line, completed=len(rows))
    if overlay is not None:
        overlay.close()
    return rows


def _finish(options: TrackOptions, tracked: TrackedVideo, wanted: AngleFilter | None) -> int:
    """Write the files and print the summary."""
    filtered: Filtered | None = None
    more: dict[str, list[Any]] = {}
    judgement = judge(tracked, has_row_time=options.row_us is not None)
    if wanted is not None and judgement.verdict != "bad":
        filtered = wanted.apply(tracked.rows)
        more = {"filtered_t_s": filtered.t_s, "filtered_rad": filtered.angle_rad}
    if options.csv is not None:
        write_table(options.csv, tracked.rows, more)
    if options.mcap is not None:
        about = {"source": options.video, "view": str(tracked.look.view)}
        joints = [(row, tracked.gate_px) for row in tracked.rows]
        write_log(options.mcap, joints, about)
    code = OK if judgement.verdict == "good" else BAD_DATA
    if options.as_json:
        print_json(video_document(options, tracked, judgement, filtered, code))
        return code
    print_video_summary(tracked, judgement, filtered)
    print_written(options.csv, options.mcap, options.overlay, options.plot)
    return code


def _show_look(options: TrackOptions, look: Look, source: FrameStream) -> int:
    code = OK if look.subject in (Subject.CABLE, Subject.BOB) else BAD_DATA
    if options.as_json:
        texts = [worded(finding) for finding in look.findings]
        print_json(
            {"exit_status": EXIT_STATUS[code], "look": look_document(look), "reasons": texts}
        )
        return code
    print_look(options, look, source)
    for finding in look.findings:
        print_paragraph(f"  - {worded(finding)}", indent="    ")
    print_written(options.plot)
    return code


def _draw_look(options: TrackOptions, look: Look) -> None:
    from rig.ui.plots.first_look import look_figure

    assert options.plot is not None
    picture_file.save(look_figure(look), options.plot)
