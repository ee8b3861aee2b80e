"""`rig track`: cable angle in every frame of a video file, or the benchmark of trackers."""

from __future__ import annotations

import csv
import math
from collections import Counter
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from rig.errors import BAD_DATA, ConfigError
from rig.ui.cli.common_options import AsJson
from rig.ui.cli.output import print_json
from rig.ui.cli.page import print_paragraph, print_written
from vision.errors import VisionError

FIELDS = ("frame", "t_s", "angle_rad", "sigma_rad", "valid", "reason")


class TrackedFrame(NamedTuple):
    """Row of one video frame; angle and sigma are None when no cable was found."""

    frame: int
    t_s: float
    angle_rad: float | None
    sigma_rad: float | None
    valid: bool
    reason: str


def track(
    video: Annotated[
        Path | None,
        typer.Argument(metavar="VIDEO", help="Video file.", show_default=False),
    ] = None,
    pivot: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y", help="Upper end of the cable in the image \\[px]; may lie outside."
        ),
    ] = None,
    csv_file: Annotated[
        Path | None, typer.Option("--csv", help=f"CSV file, one row a frame: {', '.join(FIELDS)}.")
    ] = None,
    benchmark: Annotated[
        bool,
        typer.Option(
            "--benchmark", help="Measure trackers on scenes with known truth instead of a video."
        ),
    ] = False,
    scenes: Annotated[
        str | None,
        typer.Option(help="Scenes of the benchmark, separated by commas; all by default."),
    ] = None,
    tracker: Annotated[
        str | None,
        typer.Option(
            metavar="MODULE:CLASS", help="Tracker to test in the benchmark; ours by default."
        ),
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=100_000,
            help="Most frames of each scene of the benchmark; its own number by default.",
        ),
    ] = None,
    junit: Annotated[
        Path | None,
        typer.Option(help="JUnit XML file of the tracker tested in the benchmark, for a CI."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Measure the cable angle in every frame of a video, or compare trackers.

    Exit code 6: no frame shows a cable through the pivot, or the tested tracker fails a pass bar.
    """
    if benchmark:
        from rig.ui.cli.track_benchmark import BenchmarkOptions, run_benchmark

        _refuse_options(
            "with --benchmark, which draws its own pictures",
            {"VIDEO": video, "--pivot": pivot, "--csv": csv_file},
            "remove it",
        )
        return run_benchmark(BenchmarkOptions(scenes, tracker, frames, junit, as_json))
    _refuse_options(
        "without --benchmark",
        {"--scenes": scenes, "--tracker": tracker, "--frames": frames, "--junit": junit},
        "add --benchmark",
    )
    if video is None:
        raise ConfigError("VIDEO: missing; must be a video file: name it, or give --benchmark")
    if pivot is None:
        raise ConfigError(
            "--pivot: missing; must be X,Y in pixels: for example --pivot 320,-40, or give "
            "--benchmark"
        )
    return _track_video(video, pivot, csv_file, as_json)


def _refuse_options(situation: str, given: dict[str, object], next_step: str) -> None:
    """Raise ConfigError for an option that is given where it has no effect."""
    for name, value in given.items():
        if value is not None:
            raise ConfigError(f"{name} {value} {situation}; must be left out: {next_step}")


def _track_video(video: Path, pivot: str, csv_file: Path | None, as_json: bool) -> int:
    pivot_px = _pivot(pivot)
    if not video.is_file():
        found = "a folder" if video.is_dir() else "no such file"
        raise ConfigError(f"{video}: {found}; must be a video file: check the path")
    rows = _tracked_frames(video, pivot_px)
    if not rows:
        raise VisionError(
            f"{video}: 0 frames decoded; must be 1 or more: "
            "the file is empty or cut short, record it again"
        )
    if csv_file is not None:
        _write_csv(rows, csv_file)
    valid = [row for row in rows if row.valid]
    refused = dict(Counter(row.reason for row in rows if not row.valid))
    code = 0 if valid else BAD_DATA
    reasons = []
    if not valid:
        reasons.append(
            f"no frame of {video} shows a cable through {pivot} ({refused}): "
            "check --pivot and the light"
        )
    if as_json:
        status = "ok" if valid else "bad_data"
        document = {
            "exit_status": status,
            "video": str(video),
            "frames": len(rows),
            "valid": len(valid),
            "refused": refused,
        }
        print_json(document | {"reasons": reasons, "rows": [row._asdict() for row in rows]})
        return code
    rejected = f"; rejected: {refused}" if refused else ""
    print_paragraph(f"{video}: {len(valid)} of {len(rows)} frames with an angle{rejected}")
    if valid:
        angles = [row.angle_rad or 0.0 for row in valid]
        print_paragraph(f"angle: {min(angles) * 1e3:.2f} to {max(angles) * 1e3:.2f} mrad")
    for reason in reasons:
        print_paragraph(reason, "red", "  ")
    print_written(csv_file)
    return code


def _write_csv(rows: list[TrackedFrame], path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(FIELDS)
        for row in rows:
            writer.writerow([_cell(value) for value in row])


def _cell(value: object) -> object:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else value


def _pivot(text: str) -> tuple[float, float]:
    """Parse X,Y [px]; raises ConfigError."""
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(
            f"--pivot '{text}'; must be X,Y in pixels: for example --pivot 320,-40"
        ) from None
    if not math.isfinite(x + y):
        raise ConfigError(
            f"--pivot '{text}'; must be two finite numbers: for example --pivot 320,-40"
        )
    return x, y


def _tracked_frames(video: Path, pivot_px: tuple[float, float]) -> list[TrackedFrame]:
    import cv2

    from vision.sources import video_frames
    from vision.tracker import Tracker

    cv2.setNumThreads(1)
    rows: list[TrackedFrame] = []
    tracker: Tracker | None = None
    for frame in video_frames(video):
        if tracker is None:
            height, width = frame.red.shape
            tracker = Tracker(width, height)
        fit = tracker.measure(frame.red, pivot_px)
        angle, sigma = (fit.angle_rad, fit.sigma_rad) if fit.valid else (None, None)
        rows.append(
            TrackedFrame(frame.number, frame.t_s, angle, sigma, fit.valid, fit.reason.value)
        )
    return rows
