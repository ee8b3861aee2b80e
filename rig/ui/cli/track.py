"""`rig track`: cable angle in every frame of a video, or the benchmark of trackers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.errors import ConfigError
from rig.ui.cli.common_options import AsJson


def track(
    video: Annotated[
        str | None,
        typer.Argument(
            metavar="VIDEO",
            help="Video file, folder or printf pattern of pictures, camera, or log of a run.",
            show_default=False,
        ),
    ] = None,
    pivot: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y|auto",
            help="Upper end of the cable in the image \\[px]; may lie outside. Found by default.",
        ),
    ] = None,
    plane: Annotated[
        str | None, typer.Option(help="red, green, blue or grey; the clearest by default.")
    ] = None,
    polarity: Annotated[
        str | None, typer.Option(help="dark or bright cable; found by default.")
    ] = None,
    width: Annotated[
        float | None, typer.Option(help="Width of the cable \\[px]; measured by default.")
    ] = None,
    roi: Annotated[
        str | None,
        typer.Option(metavar="X,Y,W,H", help="Part of the picture; the whole by default \\[px]."),
    ] = None,
    from_s: Annotated[
        float | None, typer.Option("--from", help="First time stamp measured \\[s].")
    ] = None,
    to_s: Annotated[
        float | None, typer.Option("--to", help="Last time stamp measured \\[s].")
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(help="True frame rate of slow motion or time lapse \\[Hz]."),
    ] = None,
    row_time: Annotated[
        float | None,
        typer.Option(help="Time between two rows of a rolling shutter \\[us].", show_default=False),
    ] = None,
    calibration: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="File of `rig calibrate offsets` or `camera`: angles of the cable, not of its "
            "picture.",
        ),
    ] = None,
    position: Annotated[
        str | None,
        typer.Option(
            metavar="X[,Y,Z]",
            help="Place of the platform with --calibration; home by default \\[m].",
        ),
    ] = None,
    at_rest: Annotated[
        bool,
        typer.Option("--at-rest", help="Measure a cable that never moves; else it is 'static'."),
    ] = False,
    filter_text: Annotated[
        str | None,
        typer.Option(
            "--filter",
            metavar="average:N|notch:HZ[:Q]",
            help="Filter of the angle, added as columns; none before an identification.",
        ),
    ] = None,
    look: Annotated[
        bool, typer.Option("--look", help="Only look: plane, polarity, width, pivot.")
    ] = False,
    plot: Annotated[
        Path | None, typer.Option(help="Figure of the first look: .svg, .png or .pdf.")
    ] = None,
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", help="CSV file, one row a frame; columns: docs/vision.md."),
    ] = None,
    mcap: Annotated[
        Path | None, typer.Option(help="Log of the angles, as in a run: .mcap.")
    ] = None,
    overlay: Annotated[
        Path | None, typer.Option(help="Video with the axis drawn: .avi, .mkv or .mp4.")
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

    Exit code 6: the angles are doubtful (fewer than half of the frames, one side of the swing, or
    untrue times), or the tested tracker fails a pass bar.
    """
    of_video: dict[str, object] = {
        "VIDEO": video,
        "--pivot": pivot,
        "--plane": plane,
        "--polarity": polarity,
        "--width": width,
        "--roi": roi,
        "--from": from_s,
        "--to": to_s,
        "--rate": rate,
        "--row-time": row_time,
        "--calibration": calibration,
        "--position": position,
        "--at-rest": at_rest or None,
        "--filter": filter_text,
        "--look": look or None,
        "--plot": plot,
        "--csv": csv_file,
        "--mcap": mcap,
        "--overlay": overlay,
    }
    if benchmark:
        from rig.ui.cli.track_benchmark import BenchmarkOptions, run_benchmark

        _refuse_options("with --benchmark, which draws its own pictures", of_video, "remove it")
        return run_benchmark(BenchmarkOptions(scenes, tracker, frames, junit, as_json))
    _refuse_options(
        "without --benchmark",
        {"--scenes": scenes, "--tracker": tracker, "--frames": frames, "--junit": junit},
        "add --benchmark",
    )
    if video is None:
        raise ConfigError("VIDEO: missing; must be a video file: name it, or give --benchmark")
    from rig.ui.cli.track_options import TrackOptions
    from rig.ui.cli.track_video import track_video

    return track_video(
        TrackOptions(
            video=video,
            pivot=pivot,
            plane=plane,
            polarity=polarity,
            width_px=width,
            roi=roi,
            from_s=from_s,
            to_s=to_s,
            rate_hz=rate,
            row_us=row_time,
            calibration=calibration,
            position=position,
            at_rest=at_rest,
            filter=filter_text,
            look=look,
            plot=plot,
            csv=csv_file,
            mcap=mcap,
            overlay=overlay,
            as_json=as_json,
        )
    )


def _refuse_options(situation: str, given: dict[str, object], next_step: str) -> None:
    """Raise ConfigError for an option that is given where it has no effect."""
    for name, value in given.items():
        if value is not None:
            shown = name if value is True else f"{name} {value}"
            raise ConfigError(f"{shown} {situation}; must be left out: {next_step}")
