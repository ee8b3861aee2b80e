"""`rig sim`: a seeded synthetic video of a swinging load, with its truth."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import track as progress

from rig import config
from rig.cli.output import err, out, print_json
from rig.errors import ConfigError
from rig.runtime import bench

CODECS = {".avi": "FFV1", ".mkv": "FFV1", ".mp4": "mp4v"}  # FFV1 loses nothing


def sim(
    video: Annotated[Path, typer.Option(help=f"Video to write: {', '.join(CODECS)} (FFV1 is lossless).")],
    truth: Annotated[Path, typer.Option(help="CSV to write: frame,t_s,angle_rad.")],
    name: Annotated[str, typer.Argument(metavar="[EXPERIMENT]", help="Whose load and camera to show.")] = "free_decay",
    seconds: Annotated[float, typer.Option(min=0.1, max=3600, help="Length [s].")] = 10.0,
    seed: Annotated[int | None, typer.Option(help="Seed of the picture noise.")] = None,
    overrides: Annotated[list[str] | None, typer.Option("--set", help="section.key=value, again and again.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")] = False,
) -> int:
    """Render a load swinging freely at home, as the rig's camera sees it, and write down where it really was."""
    import cv2

    changes = [*(overrides or []), *([f"experiment.seed={seed}"] if seed is not None else [])]
    chosen = config.load(name, changes)
    if video.suffix not in CODECS:
        raise ConfigError(f"--video {video}: ending '{video.suffix}' is not known; use one of {', '.join(CODECS)}")
    size, rate = (chosen.camera.width, chosen.camera.height), chosen.camera.rate_hz
    if rate == 0:
        raise ConfigError("[camera] rate_hz = 0: no pictures to write; set it to 50")
    video.parent.mkdir(parents=True, exist_ok=True)
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*CODECS[video.suffix]), rate, size)
    if not writer.isOpened():
        raise ConfigError(f"--video {video}: OpenCV cannot write it; is the folder there and writable?")
    pictures = bench.synthetic_video(chosen, seconds)
    with truth.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "t_s", "angle_rad"])
        for frame, t_s, angle_rad, picture in progress(
            pictures, "rendering", round(seconds * rate), console=err, transient=True, disable=as_json
        ):
            writer.write(picture)
            rows.writerow([frame, f"{t_s:.9f}", f"{angle_rad:.12g}"])
    writer.release()
    x, y = bench.pivot_px(chosen)
    if as_json:
        print_json({"video": str(video), "truth": str(truth), "frames": frame + 1, "rate_hz": rate, "pivot_px": [x, y]})
    else:
        out.print(
            f"{frame + 1} frames in {video}, truth in {truth}; track it: rig track {video} --pivot {x:.1f},{y:.1f}",
            soft_wrap=True,
        )
    return 0
