"""`rig sim`: synthetic video of a swinging load, with its true angles."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from rig.run import config
from rig.studies.vision import bench
from rig.studies.vision.synthetic_video import CODECS, write_video
from rig.ui.cli import completion
from rig.ui.cli.common_options import AsJson, ImageSeed, Overrides
from rig.ui.cli.output import print_json
from rig.ui.cli.page import err, print_whole


def sim(
    video: Annotated[
        Path, typer.Option(help=f"Video file: {', '.join(CODECS)} (FFV1 is lossless).")
    ],
    truth: Annotated[
        Path,
        typer.Option(help="CSV file of the true angles: frame, t_s, angle_rad (at mid-exposure)."),
    ],
    name: Annotated[
        str,
        typer.Argument(
            metavar="[EXPERIMENT]",
            help="Experiment that gives load and camera.",
            autocompletion=completion.experiments,
        ),
    ] = "free_decay",
    seconds: Annotated[
        float, typer.Option(min=0.1, max=3600, help="Duration \\[s], 0.1 to 3600.")
    ] = 10.0,
    seed: ImageSeed = None,
    overrides: Overrides = None,
    as_json: AsJson = False,
) -> int:
    """Render a video of a load that swings freely at home, and write its true angles."""
    changes = list(overrides or [])
    if seed is not None:
        changes.append(f"experiment.seed={seed}")
    chosen = config.read_experiment(name, changes)
    with Progress(console=err, transient=True, disable=as_json) as bar:
        line = bar.add_task("rendering", total=round(seconds * chosen.camera.rate_hz))
        frames = write_video(
            chosen, seconds, video, truth, lambda done: bar.update(line, completed=done)
        )
    x, y = bench.pivot_px(chosen)
    if as_json:
        rate_hz = chosen.camera.rate_hz
        print_json(
            {
                "video": str(video),
                "truth": str(truth),
                "frames": frames,
                "rate_hz": rate_hz,
                "pivot_px": [x, y],
            }
        )
    else:
        megabytes = video.stat().st_size / 1e6
        print_whole(f"{frames} frames in {video} ({megabytes:.0f} MB), true angles in {truth}")
        print_whole(f"next: rig track {shlex.quote(str(video))} --pivot {x:.1f},{y:.1f}")
    return 0
