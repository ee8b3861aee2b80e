"""`rig track VIDEO`: first look, angle in every frame, summary with verdict."""

from __future__ import annotations

from collections import Counter
from typing import Any

import cv2
from rich.progress import Progress

from rig.errors import BAD_DATA, EXIT_STATUS, OK, ConfigError
from rig.ui.cli.output import COLOUR, print_json
from rig.ui.cli.page import err, print_paragraph, print_written
from rig.ui.cli.track_calibration import read_calibration
from rig.ui.cli.track_files import OverlayVideo, check_log, write_log, write_table
from rig.ui.cli.track_filter import AngleFilter, Filtered, filter_of
from rig.ui.cli.track_options import TrackOptions
from rig.ui.cli.track_verdict import TrackedVideo, VideoJudgement, judge, worded
from rig.ui.plots import picture_file
from vision.errors import VisionError
from vision.first_look import Look, Subject
from vision.sources import open_source
from vision.stream import FrameStream, SourceFrame
from vision.tracked import MeasureOptions, TrackedFrame, tracked_frames, without_readout_bend
from vision.video_tracker import VideoTracker
from vision.view import Point

LOOK_PICTURES = 30
SUBJECTS = {
    Subject.CABLE: "a cable that swings",
    Subject.STILL: "lines that never move",
    Subject.BOB: "a bob without a visible cable",
    Subject.NOTHING: "no cable and no bob",
}


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
        _print_look(options, tracker.look, source)
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
    try:
        return open_source(options.video, options.source())
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
    if options.plot is not None:
        picture_file.check(options.plot)
    if options.csv is not None:
        picture_file.check_folder("--csv", options.csv)
    if options.mcap is not None:
        check_log(options.mcap)


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
        print_json(_document(options, tracked, judgement, filtered, code))
        return code
    _print_summary(tracked, judgement, filtered)
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
    _print_look(options, look, source)
    for finding in look.findings:
        print_paragraph(f"  - {worded(finding)}", indent="    ")
    print_written(options.plot)
    return code


def _draw_look(options: TrackOptions, look: Look) -> None:
    from rig.ui.plots.first_look import look_figure

    assert options.plot is not None
    picture_file.save(look_figure(look), options.plot)


def look_document(look: Look) -> dict[str, Any]:
    """Collect what a first look found, for JSON."""
    pivot = look.pivot
    document: dict[str, Any] = {
        "subject": look.subject.value,
        "plane": look.view.plane,
        "polarity": "bright" if look.view.is_bright else "dark",
        "turned_deg": 90 * look.view.turns,
        "width_px": None if look.cable is None else look.cable.width_px,
        "blur_px": None if look.cable is None else look.cable.blur_px,
        "pivot_px": look.pivot_in_picture(),
        "pivot_sigma_px": None if pivot is None else pivot.sigma_px,
        "pivot_scatter_px": None if pivot is None else pivot.scatter_px,
        "swing_rad": look.swing_rad,
        "static_lines": len(look.static_lines),
    }
    return document


def _document(
    options: TrackOptions,
    tracked: TrackedVideo,
    judgement: VideoJudgement,
    filtered: Filtered | None,
    code: int,
) -> dict[str, Any]:
    rows = tracked.rows
    return {
        "exit_status": EXIT_STATUS[code],
        "verdict": judgement.verdict,
        "video": options.video,
        "frames": len(rows),
        "valid": sum(row.valid for row in rows),
        "refused": dict(Counter(row.reason for row in rows if not row.valid)),
        "calibration": None if tracked.calibration is None else tracked.calibration.name,
        "look": look_document(tracked.look),
        "findings": [
            {"kind": f.kind.value, "first": f.first, "last": f.last, "text": f.text}
            for f in tracked.findings
        ],
        "filter": None if filtered is None else filtered.facts(),
        "reasons": judgement.reasons,
        "remarks": judgement.remarks,
        "rows": [row._asdict() for row in rows],
    }


def _print_look(options: TrackOptions, look: Look, source: FrameStream) -> None:
    about = source.about
    rate = "rate not stated" if about.rate_hz is None else f"{about.rate_hz:.4g} frames/s"
    stated = "" if about.frames is None else f", {about.frames} frames"
    print_paragraph(
        f"{options.video}: {about.kind} {about.codec}, {about.width} x {about.height} px, "
        f"{rate}{stated}"
    )
    view = look.view
    parts = [f"found: {SUBJECTS[look.subject]}"]
    if look.subject in (Subject.CABLE, Subject.BOB):
        parts.append(f"{'bright' if view.is_bright else 'dark'} in the {view.plane} plane")
    if look.cable is not None:
        parts.append(f"{look.cable.width_px:.1f} px wide")
    if view.turns:
        parts.append(f"picture turned by {90 * view.turns} degrees")
    print_paragraph(", ".join(parts))
    place = look.pivot_in_picture()
    if place is not None and look.pivot is not None:
        across, along = look.pivot.sigma_px
        if view.turns % 2:
            across, along = along, across
        print_paragraph(
            f"pivot: {place[0]:.2f},{place[1]:.2f} +- {across:.2g},{along:.2g} px, from "
            f"{look.pivot.lines} pictures"
        )


def _print_summary(
    tracked: TrackedVideo, judgement: VideoJudgement, filtered: Filtered | None
) -> None:
    rows = tracked.rows
    valid = [row for row in rows if row.valid]
    refused = Counter(row.reason for row in rows if not row.valid)
    rejected = ", ".join(f"{reason} {count}" for reason, count in refused.most_common())
    stamps = Counter(row.stamp for row in rows).most_common(1)[0][0] if rows else "none"
    text = f"{len(valid)} of {len(rows)} frames with an angle, time stamps: {stamps}"
    print_paragraph(f"{text}; rejected: {rejected}" if rejected else text)
    if valid:
        angles = [row.angle_rad or 0.0 for row in valid]
        sigmas = sorted(row.sigma_rad or 0.0 for row in valid)
        where = "in the picture"
        if tracked.calibration is not None:
            where = f"of the cable, by {tracked.calibration.name}"
        print_paragraph(
            f"angle {where}: {min(angles) * 1e3:.2f} to {max(angles) * 1e3:.2f} mrad, standard "
            f"deviation {sigmas[len(sigmas) // 2] * 1e3:.3f} mrad (median)"
        )
    if filtered is not None:
        print_paragraph(filtered.text)
    print_paragraph(f"verdict: {judgement.verdict}", f"{COLOUR[judgement.verdict]} bold")
    for text in (*judgement.reasons, *judgement.remarks):
        print_paragraph(f"  - {text}", indent="    ")
