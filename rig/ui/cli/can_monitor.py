"""`rig can monitor`: the frames of a bus, of a log or of a trace file."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.errors import BAD_DATA, OK
from rig.ui.cli.can_options import Bitrate, Channel, ExperimentFile, Interface, Runs

if TYPE_CHECKING:
    import can

    from rig.ui.cli.can_frames import FramePage


def monitor(
    dbc: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="DBC file that names the frames; `run`: the table of the run, which is the "
            "default for the frames of one.",
        ),
    ] = None,
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="TRACE",
            help="Trace file .asc, .blf, .trc or .log (candump), or a run: folder, .mcap file, "
            "part of its name, or `last`; a bus by default.",
        ),
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0, help="Duration \\[s]; until Ctrl-C by default.")
    ] = None,
    count: Annotated[
        int | None, typer.Option(min=1, help="Number of frames; all by default.")
    ] = None,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    experiment: ExperimentFile = None,
    runs: Runs = Path("runs"),
    as_json: Annotated[
        bool,
        typer.Option("--json", help="One JSON document a line: each frame, then the summary."),
    ] = False,
) -> int:
    """Show the frames of a CAN bus with their signals; Ctrl-C ends it with a summary.

    Without --interface, the bus of the running experiment. The summary has rate and jitter by
    identifier, and the load of the bus.
    """
    from comms.clock import new_run_clock
    from rig.run.field_bus.bus_choice import BusOptions
    from rig.run.field_bus.source import live_source, logged_source, make_decoder, until_s
    from rig.ui.cli.can_frames import FramePage

    options = BusOptions(interface, channel, bitrate, experiment, runs)
    frames: Iterable[can.Message]
    if source is None:
        opened = live_source(options, new_run_clock(), seconds)
        frames = opened.frames
    else:
        opened = logged_source(source, options)
        frames = until_s(opened.frames, seconds)
    decoder = make_decoder(dbc, opened.drive)
    page = FramePage(decoder, opened.zero_s, opened.bitrate, as_json=as_json)
    _show(page, islice(frames, count), opened.name)
    if opened.damage:
        page.note(f"the log is incomplete: {opened.damage}; the frames are what is left")
        return BAD_DATA
    return OK


def _show(page: FramePage, frames: Iterable[can.Message], name: str) -> None:
    """Show the frames, and the summary at their end, at Ctrl-C and at an error."""
    try:
        for frame in frames:
            page.show(frame)
    except KeyboardInterrupt:
        pass
    except Exception:
        if page.frames:
            page.summarise(name)
        raise
    page.summarise(name)
