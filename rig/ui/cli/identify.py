"""`rig identify`: frequency and damping of a free decay in a file of any laboratory."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.errors import ConfigError
from rig.ui.cli.common_options import AsJson

UNITS = "rad, deg, m, mm, m/s2, g, V, rad/s or none"


def identify(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Text table, .lvm, .mat, .xls(x), phyphox, MCAP, CAN trace, run folder or log.",
        ),
    ],
    time: Annotated[
        str, typer.Option(metavar="COLUMN", help="Time column: name, or number from 1.")
    ] = "",
    signal: Annotated[
        str, typer.Option(metavar="COLUMN", help="Signal column: name, or number from 1.")
    ] = "",
    unit: Annotated[str, typer.Option(help=f"Unit of the signal: {UNITS}.")] = "",
    kind: Annotated[
        str,
        typer.Option(help="pendulum, linear, or auto: pendulum for an angle, linear otherwise."),
    ] = "auto",
    modes: Annotated[
        str, typer.Option(metavar="auto|1..4", help="Number of modes; auto finds it.")
    ] = "auto",
    rate: Annotated[
        float | None, typer.Option(help="Sampling rate of a record without times \\[Hz].")
    ] = None,
    from_s: Annotated[
        float | None, typer.Option("--from", help="First time stamp used \\[s].")
    ] = None,
    to_s: Annotated[float | None, typer.Option("--to", help="Last time stamp used \\[s].")] = None,
    topic: Annotated[
        str, typer.Option(help="Topic of an MCAP file, sheet of a workbook, file in an archive.")
    ] = "",
    field: Annotated[str, typer.Option(help="Field of a message, or signal of a CAN trace.")] = "",
    dbc: Annotated[Path | None, typer.Option(help="DBC file with the signals of a trace.")] = None,
    gravity: Annotated[
        float, typer.Option(help="Gravity at the site, for the length of a cable \\[m/s²].")
    ] = 9.81,
    gravity_sigma: Annotated[float, typer.Option(help="Its standard deviation \\[m/s²].")] = 0.01,
    scale_rel: Annotated[
        float, typer.Option(help="Standard deviation of the scale of the signal, relative.")
    ] = 3e-4,
    clock_ppm: Annotated[
        float, typer.Option(help="Standard deviation of the clock, parts per million.")
    ] = 20.0,
    drift_rel: Annotated[
        float, typer.Option(help="Standard deviation of the drift of the scale in the record.")
    ] = 1e-3,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Figure of signal, fit, residual, spectrum, damping and poles: .svg, .png, .pdf."
        ),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Identify frequency and damping of a free decay, with their whole uncertainty.

    Says what was read and what was cut off, checks that the model fits, and gives a second opinion.
    Exit code 6: the result is doubtful, or the record is refused, with the reason.
    """
    from rig.analysis.identify.identify_options import IdentifyOptions
    from rig.analysis.readers.signal_record import ReadOptions
    from rig.ui.cli.identify_record import IdentifyRequest, identify_file

    reading = ReadOptions(
        time=time,
        signal=signal,
        unit=unit,
        rate_hz=rate,
        topic=topic,
        field=field,
        dbc=dbc,
    )
    model = IdentifyOptions(
        kind=_one_of("--kind", kind, ("auto", "pendulum", "linear")),
        modes=_modes(modes),
        from_s=from_s,
        to_s=to_s,
        angle_scale_rel=_not_negative("--scale-rel", scale_rel),
        clock_ppm=_not_negative("--clock-ppm", clock_ppm),
        gain_drift_rel=_not_negative("--drift-rel", drift_rel),
        gravity_m_s2=_positive("--gravity", gravity),
        gravity_sigma_m_s2=_not_negative("--gravity-sigma", gravity_sigma),
    )
    if from_s is not None and to_s is not None and to_s <= from_s:
        raise ConfigError(f"--to {to_s:g} with --from {from_s:g}; must be later: exchange them")
    return identify_file(IdentifyRequest(file, reading, model, plot, as_json))


def _modes(text: str) -> int | None:
    if text == "auto":
        return None
    if text not in ("1", "2", "3", "4"):
        raise ConfigError(f"--modes {text}; must be auto or 1 to 4: leave it out to find the modes")
    return int(text)


def _one_of(option: str, value: str, known: tuple[str, ...]) -> str:
    if value not in known:
        raise ConfigError(f"{option} {value}; must be one of {', '.join(known)}: choose one")
    return value


def _not_negative(option: str, value: float) -> float:
    if not 0.0 <= value < 1e6:
        raise ConfigError(f"{option} {value:g}; must be >= 0 and below 1e6: correct it")
    return value


def _positive(option: str, value: float) -> float:
    if not 0.0 < value < 1e3:
        raise ConfigError(f"{option} {value:g}; must be > 0 and below 1000 m/s²: correct it")
    return value
