"""Answer of `rig track VIDEO`: what a first look found, and the summary, as text and JSON."""

from __future__ import annotations

from collections import Counter
from typing import Any

from rig.errors import EXIT_STATUS
from rig.ui.cli.output import COLOUR
from rig.ui.cli.page import print_paragraph
from rig.ui.cli.track_filter import Filtered
from rig.ui.cli.track_options import TrackOptions
from rig.ui.cli.track_verdict import TrackedVideo, VideoJudgement
from vision.first_look import Look, Subject
from vision.stream import FrameStream

SUBJECTS = {
    Subject.CABLE: "a cable that swings",
    Subject.STILL: "lines that never move",
    Subject.BOB: "a bob without a visible cable",
    Subject.NOTHING: "no cable and no bob",
}


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


def video_document(
    options: TrackOptions,
    tracked: TrackedVideo,
    judgement: VideoJudgement,
    filtered: Filtered | None,
    code: int,
) -> dict[str, Any]:
    """Collect the answer for JSON."""
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


def print_look(options: TrackOptions, look: Look, source: FrameStream) -> None:
    """Print the source, and what the first look found in it."""
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


def print_video_summary(
    tracked: TrackedVideo, judgement: VideoJudgement, filtered: Filtered | None
) -> None:
    """Print counts, angles, filter and verdict of a video."""
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
