"""`rig track --benchmark`: trackers side by side on scenes with known truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2
from rich.progress import Progress

from rig.errors import BAD_DATA, EXIT_STATUS, OK, ConfigError
from rig.studies.vision import kit
from rig.studies.vision.junit import write_junit
from rig.studies.vision.kit import SceneResult
from rig.studies.vision.scene import read_scene
from rig.ui.cli.output import COLOUR, print_json
from rig.ui.cli.page import (
    Column,
    PageTable,
    err,
    plain_table,
    print_paragraph,
    print_table,
    print_written,
)
from rig.ui.plots.picture_file import check_folder
from vision.protocol import TrackerClass

COLUMNS = (
    "scene\n  tracker",
    "bias\n[mrad]",
    "std\n[mrad]",
    "std/\nbound",
    Column("worst\n[mrad]", drop=2),
    "refused\n[%]",
    "wrong\n[%]",
    Column("error/\nsigma", drop=3),
    Column("frames\n/s", drop=1),
)
LEGEND = (
    "std/bound: standard deviation over the Cramer-Rao bound of the picture. wrong: angle > 5 mrad "
    "off, or of a cable that is not visible. error/sigma: rms of the error over the standard "
    "deviation that the tracker gives. {peers}: one frame in {step}, without pass bars."
)


class BenchmarkOptions(NamedTuple):
    """Options of `rig track --benchmark`; None = the default."""

    scenes: str | None
    tracker: str | None
    frames: int | None
    junit: Path | None
    as_json: bool


def run_benchmark(options: BenchmarkOptions) -> int:
    """Measure every scene with every tracker, print the figures; exit code 6 below a pass bar."""
    if options.junit is not None:
        check_folder("--junit", options.junit)
    scenes = _scenes(options.scenes)
    trackers, tested = _trackers(options.tracker)
    cv2.setNumThreads(1)  # frames/s of one core, for every tracker
    with Progress(console=err, transient=True, disable=options.as_json) as bar:
        line = bar.add_task("measuring", total=_total(scenes, options.frames))
        results = kit.run(
            scenes, trackers, options.frames, lambda done: bar.update(line, completed=done)
        )
    judged = [result for result in results if result.tracker == tested]
    if options.junit is not None:
        write_junit(options.junit, judged)
    code = OK if all(result.passed for result in judged) else BAD_DATA
    if options.as_json:
        print_json(_document(results, judged, options.frames, code))
        return code
    _print_results(results, judged, options.frames)
    print_written(options.junit)
    return code


def _total(scenes: Sequence[str], frames: int | None) -> int:
    return sum(kit.frame_count(read_scene(name), frames) for name in scenes)


def _scenes(text: str | None) -> list[str]:
    """List the scenes of the option, or all that are shipped."""
    if text is None:
        return kit.shipped_scenes()
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise ConfigError(
            f"--scenes '{text}'; must be names separated by commas: for example --scenes "
            f"{kit.shipped_scenes()[0]}"
        )
    return names


def _trackers(text: str | None) -> tuple[dict[str, TrackerClass], str]:
    """Collect the trackers by name, the tested one first, and its name."""
    if text is None:
        return {**kit.OURS, **kit.PEERS}, next(iter(kit.OURS))
    return {text: kit.load_tracker(text), **kit.OURS, **kit.PEERS}, text


def _document(
    results: Sequence[SceneResult], judged: Sequence[SceneResult], frames: int | None, code: int
) -> dict[str, Any]:
    return {
        "exit_status": EXIT_STATUS[code],
        "tracker": judged[0].tracker,
        "frames": frames,
        "peer_step": kit.PEER_STEP,
        "reasons": _reasons(judged),
        "results": results,
    }


def _reasons(judged: Sequence[SceneResult]) -> list[str]:
    reasons = []
    for result in judged:
        reasons += [f"{result.scene}: {failure}" for failure in result.failures]
    return reasons


def _print_results(
    results: Sequence[SceneResult], judged: Sequence[SceneResult], frames: int | None
) -> None:
    print_table(_table(results, frames))
    print_paragraph(LEGEND.format(peers=", ".join(kit.PEERS), step=kit.PEER_STEP), "dim")
    failed = [result for result in judged if not result.passed]
    verdict = "bad" if failed else "good"
    print_paragraph(
        f"{judged[0].tracker}: {len(judged) - len(failed)} of {len(judged)} scenes passed",
        f"{COLOUR[verdict]} bold",
    )
    for reason in _reasons(judged):
        print_paragraph(f"  - {reason}", indent="    ")


def _table(results: Sequence[SceneResult], frames: int | None) -> PageTable:
    """Make the table: a line for each scene, and below it one for each tracker."""
    count = "all" if frames is None else f"{frames}"
    table = plain_table(f"trackers on {count} frames of each scene", COLUMNS)
    table.padding = (0, 1, 0, 0)
    scene = None
    for result in results:
        if result.scene != scene:
            scene = result.scene
            table.add_row(scene, style="bold")
        table.add_row(f"  {_short_name(result.tracker)}", *_cells(result))
    return table


def _short_name(tracker: str) -> str:
    """Class of `package.module:Class`."""
    return tracker.rpartition(":")[2]


def _cells(result: SceneResult) -> list[str]:
    score = result.score
    return [
        _mrad(score.bias_rad),
        _mrad(score.std_rad),
        _digits(score.std_over_bound),
        _mrad(score.worst_rad),
        _percent(score.refused_share),
        _percent(score.wrong_share),
        _digits(score.error_over_sigma),
        _digits(score.frames_per_s),
    ]


def _mrad(angle_rad: float) -> str:
    """Write an angle in mrad, in at most seven characters."""
    angle_mrad = angle_rad * 1e3
    for decimals, limit in ((4, 1.0), (3, 10.0), (2, 100.0)):
        if abs(angle_mrad) < limit:
            return _fixed(angle_mrad, decimals)
    return _fixed(angle_mrad, 1)


def _percent(share: float) -> str:
    return _fixed(share * 100.0, 1)


def _digits(value: float) -> str:
    """Write a ratio or a rate with three digits or more, without an exponent."""
    for decimals, limit in ((2, 10.0), (1, 100.0)):
        if value < limit:
            return _fixed(value, decimals)
    return _fixed(value, 0)


def _fixed(value: float, decimals: int) -> str:
    """Write a number without a negative zero; - for NaN."""
    return "-" if math.isnan(value) else f"{round(value, decimals) + 0.0:.{decimals}f}"
