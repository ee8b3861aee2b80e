"""Source of frames to show: a trace file, the log of a run, or a bus."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import can

from comms.can_bus import CanSettings, open_bus
from comms.clock import Clock
from comms.errors import LogError
from comms.mcap_log import read_log
from rig.analysis.readers.can_trace import DamagedTrace, is_trace, read_trace
from rig.errors import ConfigError
from rig.run.drive_section import DriveSection
from rig.run.field_bus.bus_choice import DEFAULT_BITRATE, BusChoice, BusOptions, choose_bus
from rig.run.field_bus.decoding import Decoder
from rig.run.field_bus.exchange import RECEIVE_S, BusFailed
from rig.run.field_bus.traffic import read_traffic, run_bus
from rig.run.runs import LOG

OF_RUN = "run"  # value of --dbc


class FrameSource(NamedTuple):
    """Frames, one after the other, and how to read them."""

    name: str
    bitrate: int
    drive: DriveSection | None  # of the run, whose names its frames have
    frames: Iterable[can.Message]
    zero_s: float | None  # stamp that is shown as 0; None: that of the first frame
    damage: str = ""  # of the log


def trace_source(path: Path, bitrate: int | None) -> FrameSource:
    """Open a trace file; raises ConfigError and DamagedTrace, before its first frame too."""
    frames = read_trace(path)
    first = next(frames, None)
    if first is None:
        raise DamagedTrace(
            f"{path}: no frame in this file: empty, or of another kind than its name"
        )
    whole = chain([first], frames)
    return FrameSource(str(path), bitrate or DEFAULT_BITRATE, None, whole, None)


def logged_source(name: str, options: BusOptions) -> FrameSource:
    """Open a trace file, or the log of a run; raises RigError and LogError."""
    if is_trace(name):
        return trace_source(Path(name), options.bitrate)
    traffic = read_traffic(name, options.runs)
    bitrate = options.bitrate or traffic.bus.can.bitrate
    drive = traffic.bus.node
    place = str(traffic.log.path)
    return FrameSource(place, bitrate, drive, traffic.frames, 0.0, traffic.log.damage)


def live_source(options: BusOptions, clock: Clock, seconds: float | None) -> FrameSource:
    """Choose a bus, to be opened at the first frame; raises RigError.

    seconds: time until the end of the frames; None: no end.
    """
    choice = choose_bus(options)
    bitrate = options.bitrate or choice.settings.bitrate
    frames = _live(choice.settings, clock, seconds)
    return FrameSource(choice.name, bitrate, _drive(choice), frames, None)


def make_decoder(dbc: str | None, drive: DriveSection | None) -> Decoder:
    """Make the decoder that --dbc names; drive: of the run. Raises ConfigError."""
    if dbc == OF_RUN and drive is None:
        raise ConfigError(
            "--dbc run: the frames are not those of a run; name a DBC file, or an experiment with "
            "--experiment"
        )
    if dbc is not None and dbc != OF_RUN:
        return Decoder.of_file(Path(dbc))
    return Decoder() if drive is None else Decoder.of_drive(drive)


def until_s(frames: Iterable[can.Message], seconds: float | None) -> Iterator[can.Message]:
    """Yield recorded frames up to a time after the first one."""
    first_s: float | None = None
    for frame in frames:
        if first_s is None:
            first_s = frame.timestamp
        if seconds is not None and frame.timestamp - first_s > seconds:
            return
        yield frame


def _drive(choice: BusChoice) -> DriveSection | None:
    """Read `[drive]` of the experiment, or of the run on the bus."""
    if choice.drive is not None or choice.run is None:
        return choice.drive
    try:
        return run_bus(read_log(choice.run / LOG)).node
    except LogError:  # not written yet
        return None


def _live(settings: CanSettings, clock: Clock, seconds: float | None) -> Iterator[can.Message]:
    with open_bus(settings) as bus:
        start_ns = clock.now_ns()
        wait_s = RECEIVE_S
        while True:
            if seconds is not None:
                left_s = seconds - (clock.now_ns() - start_ns) * 1e-9
                if left_s <= 0:
                    return
                wait_s = min(RECEIVE_S, left_s)
            try:
                message = bus.recv(wait_s)
            except (can.CanError, OSError) as error:
                raise BusFailed(
                    f"the bus cannot be read any more ({error}): look for the device"
                ) from error
            if message is not None:
                yield message
