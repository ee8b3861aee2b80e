"""`rig sim`: synthetic video of a scene or of a swinging load, with what is true in it."""

from __future__ import annotations

import math
import shlex
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.progress import Progress

from rig.errors import ConfigError
from rig.run import config
from rig.studies.vision.scene import Scene, read_scene, scene_frames, shipped_scenes
from rig.studies.vision.stamps import Stamps
from rig.studies.vision.synthetic_video import (
    CODECS,
    COLUMNS,
    VideoFiles,
    scene_of,
    write_video,
)
from rig.ui.cli import completion
from rig.ui.cli.common_options import AsJson, ImageSeed, Overrides
from rig.ui.cli.output import print_json
from rig.ui.cli.page import Column, err, plain_table, print_table, print_whole

SCENE_COLUMNS = ("scene", "expected", Column("what is special", folds=True))


def sim(
    name: Annotated[
        str,
        typer.Argument(
            metavar="[EXPERIMENT]",
            help="Experiment that gives load and camera, without --scene.",
            autocompletion=completion.experiments,
        ),
    ] = "free_decay",
    scene: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE",
            help="Scene: a shipped one or a TOML file, in place of an experiment.",
            autocompletion=completion.scenes,
        ),
    ] = None,
    list_scenes: Annotated[
        bool, typer.Option("--list-scenes", help="List the shipped scenes and exit.")
    ] = False,
    video: Annotated[
        Path | None, typer.Option(help=f"Video file: {', '.join(CODECS)} (FFV1 is lossless).")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option(help=f"CSV file of what is true: {', '.join(COLUMNS)}.")
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=0.1, max=3600, help="Duration \\[s], 0.1 to 3600; experiments.")
    ] = 10.0,
    frames: Annotated[
        int | None,
        typer.Option(
            min=1, max=180_000, help="Number of frames rendered; by default that of the scene."
        ),
    ] = None,
    stamps: Annotated[
        Stamps | None,
        typer.Option(
            help="Time stamps: constant rate, variable rate, holes, or two recordings joined; all "
            "but cfr write JPEG pictures to .mkv; by default those of the scene."
        ),
    ] = None,
    seed: ImageSeed = None,
    overrides: Overrides = None,
    as_json: AsJson = False,
) -> int:
    """Render a synthetic video and write what is true in each picture.

    The load swings freely at home, or a scene says what happens.
    """
    if list_scenes:
        _print_scenes(as_json)
        return 0
    if video is None or truth is None:
        missing = " and ".join(
            option for option, path in (("--video", video), ("--truth", truth)) if path is None
        )
        raise ConfigError(
            f"rig sim without {missing}; must have both: give two files to write, for example "
            "--video v.avi --truth t.csv"
        )
    chosen = _chosen_scene(name, scene, seed, list(overrides or []))
    if frames is None:
        frames = chosen.section.frames if scene else max(1, math.ceil(seconds * chosen.rate_hz))
    files = VideoFiles(video, truth, stamps or chosen.section.stamps)
    with Progress(console=err, transient=True, disable=as_json) as bar:
        line = bar.add_task("rendering", total=frames)
        written = write_video(chosen, frames, files, lambda done: bar.update(line, completed=done))
    _print_written(chosen, files, written, as_json)
    return 0


def _chosen_scene(name: str, scene: str | None, seed: int | None, changes: list[str]) -> Scene:
    """Read the scene, or the experiment as one."""
    if scene is None:
        if seed is not None:
            changes.append(f"experiment.seed={seed}")
        return scene_of(config.read_experiment(name, changes))
    if seed is not None:
        changes.append(f"scene.seed={seed}")
    return read_scene(scene, changes)


def _print_scenes(as_json: bool) -> None:
    scenes = [read_scene(name) for name in shipped_scenes()]
    if as_json:
        rows = [{"name": scene.name, **msgspec.to_builtins(scene.section)} for scene in scenes]
        print_json({"scenes": rows})
        return
    table = plain_table("shipped scenes, rendered by `rig sim --scene NAME`", SCENE_COLUMNS, left=3)
    for scene in scenes:
        table.add_row(scene.name, scene.expect, scene.about)
    print_table(table)


def _print_written(scene: Scene, files: VideoFiles, frames: int, as_json: bool) -> None:
    first = next(scene_frames(scene, 1))
    x, y = first.pivot_px
    if as_json:
        print_json(
            {
                "video": str(files.video),
                "truth": str(files.truth),
                "frames": frames,
                "rate_hz": scene.rate_hz,
                "pivot_px": [x, y],
            }
        )
        return
    megabytes = files.video.stat().st_size / 1e6
    print_whole(f"{frames} frames in {files.video} ({megabytes:.0f} MB), truth in {files.truth}")
    print_whole(f"next: rig track {shlex.quote(str(files.video))}")
