"""Choice of the field bus: named by options, by `[can]` of a file, or that of the running run."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import can
import msgspec

from comms.can_bus import AUTO, MULTICAST, UNICAST, CanSettings
from rig.errors import ConfigError, Refused
from rig.run import operator_file
from rig.run.config import read_experiment
from rig.run.drive_section import DriveSection
from rig.run.toml_file import nearest

DEFAULT_BITRATE = CanSettings().bitrate
SIMULATED = (MULTICAST, UNICAST)


class BusOptions(NamedTuple):
    """Options of a verb that name the bus; None: not given."""

    interface: str | None = None
    channel: str | None = None
    bitrate: int | None = None
    experiment: str | None = None
    runs: Path = Path("runs")


class BusChoice(NamedTuple):
    """Settings of a bus, and the folder of the run to which it belongs."""

    settings: CanSettings
    run: Path | None = None
    drive: DriveSection | None = None  # of the experiment that names the bus

    @property
    def name(self) -> str:
        """Interface and channel, e.g. `socketcan can0`."""
        return name_of(self.settings)


def name_of(settings: CanSettings) -> str:
    """Name interface and channel, e.g. `socketcan can0`."""
    words = [settings.interface, settings.channel]
    if settings.interface in SIMULATED and settings.port:
        words.append(f"port {settings.port}")
    return " ".join(word for word in words if word)


def choose_bus(options: BusOptions) -> BusChoice:
    """Choose the bus; raises Refused where none is named and no run with one goes on.

    Raises ConfigError for an unknown interface and for a channel without its interface.
    """
    if options.interface is not None:
        return BusChoice(_named(options))
    if options.channel is not None:
        raise ConfigError(
            f"--channel {options.channel} without --interface; must be both: "
            "name the interface, e.g. --interface socketcan"
        )
    if options.experiment is not None:
        return _of_experiment(options, options.experiment)
    running = running_buses(options.runs)
    if not running:
        raise Refused(
            f"no field bus: nothing with a drive is running under {options.runs}; start it with "
            "`rig run`, or name a bus, e.g. --interface socketcan --channel can0"
        )
    return running[-1]


def running_buses(runs: Path) -> list[BusChoice]:
    """List the buses of the runs that go on under a folder, the newest last."""
    found = []
    for path in operator_file.find(runs):
        try:
            operator = operator_file.read(path)
            settings = msgspec.convert(operator.can, CanSettings)
        except (OSError, ValueError):  # the run ended meanwhile, or it is of another version
            continue
        if operator.can and operator_file.is_alive(operator.pid):
            found.append(BusChoice(settings, path.parent))
    return found


def run_on(settings: CanSettings, runs: Path) -> Path | None:
    """Find the folder of the run that goes on on a bus."""
    for running in running_buses(runs):
        if _place(running.settings) == _place(settings):
            return running.run
    return None


def _place(settings: CanSettings) -> tuple[str, str, int]:
    """Interface, channel and port of a bus; the port counts where the interface has one."""
    channel = settings.channel
    port = settings.port if settings.interface in SIMULATED else 0
    if settings.interface == UNICAST and channel:
        _, _, text = channel.rpartition(":")
        return settings.interface, "", int(text) if text.isdecimal() else port
    return settings.interface, channel, port


def _named(options: BusOptions) -> CanSettings:
    interface = options.interface or ""
    known = sorted({*can.VALID_INTERFACES, UNICAST})
    if interface not in known:
        raise Refused(
            f"--interface {interface}: no such interface{nearest(interface, known)}; "
            f"must be one of {', '.join(known)}"
        )
    channel, port = options.channel or "", 0
    if interface == MULTICAST:
        channel, port = _group(channel)
    bitrate = options.bitrate or DEFAULT_BITRATE
    return CanSettings(interface=interface, channel=channel, bitrate=bitrate, port=port)


def _group(channel: str) -> tuple[str, int]:
    """Split GROUP:PORT of a bus by multicast; either may be missing, but not the port."""
    group, _, port = channel.rpartition(":")
    if not port.isdecimal():
        raise ConfigError(
            f"--channel {channel!r} of {MULTICAST}; must be GROUP:PORT or :PORT, e.g. "
            "239.74.163.2:43113: the port of a running experiment is in its operator.json"
        )
    return group, int(port)


def _of_experiment(options: BusOptions, name: str) -> BusChoice:
    experiment = read_experiment(name, [])
    section = experiment.can
    if section.interface != AUTO:
        settings = CanSettings(
            interface=section.interface,
            channel=section.channel,
            bitrate=options.bitrate or section.bitrate,
        )
        return BusChoice(settings, run_on(settings, options.runs), experiment.node)
    running = running_buses(options.runs)
    if not running:
        raise Refused(
            f"experiment '{name}' has [can] interface = 'auto', a bus between the tasks of a run, "
            f"and nothing with a drive is running under {options.runs}: start it with `rig run`"
        )
    return running[-1]
