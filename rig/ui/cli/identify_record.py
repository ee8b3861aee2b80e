"""Identification of one file: reading, fit, figure, and the answer as text or JSON."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

from comms.errors import LogError
from planners.errors import PlanError
from rig.analysis.identify.identification import Identification
from rig.analysis.identify.identify import identify_record
from rig.analysis.identify.identify_options import IdentifyOptions
from rig.analysis.readers.errors import UnreadableData
from rig.analysis.readers.read import read_signal
from rig.analysis.readers.signal_record import ReadOptions, SignalRecord
from rig.analysis.run_log import RunLog
from rig.errors import BAD_DATA, EXIT_STATUS, OK, ConfigError, RigError
from rig.run import runs
from rig.studies.robust_choice import RobustChoice, choose_planner
from rig.ui.cli.identify_tables import print_identification
from rig.ui.cli.output import print_json, working
from rig.ui.cli.page import print_written
from rig.ui.plots import picture_file

LENGTHS_M = (0.05, 20.0)  # of a cable for which a move is planned
HARMLESS = ("not_white", "holes", "halves", "clock")  # widen the result, and leave it
OWN_LOG = "log of a run"  # kind of a record of ours


class IdentifyRequest(NamedTuple):
    """Options of `rig identify`."""

    file: Path
    reading: ReadOptions
    model: IdentifyOptions
    plot: Path | None
    as_json: bool


def identify_file(request: IdentifyRequest) -> int:
    """Identify the decay in a file and print the answer; returns the exit code."""
    if request.plot is not None:
        picture_file.check(request.plot)
    request = request._replace(file=_found(request.file))
    with working(f"reading {request.file}", quiet=request.as_json):
        record = _read(request)
    options = _of_record(request, record)
    with working(f"identifying {record.values.size} samples", quiet=request.as_json):
        found = identify_record(record.t_s, record.values, options)
    choice = _choice(found)
    if request.plot is not None and found.modes:
        from rig.ui.plots.identification import identification_figure  # slow to import

        picture_file.save(identification_figure(record, found), request.plot)
    code = OK if found.verdict == "good" else BAD_DATA
    if request.as_json:
        print_json(_document(record, found, choice, code))
        return code
    print_identification(record, found, choice)
    print_written(request.plot if found.modes else None)
    return code


def _read(request: IdentifyRequest) -> SignalRecord:
    """Read the record; raises ConfigError for a file or a part of it without a signal."""
    try:
        record = read_signal(request.file, request.reading)
    except UnreadableData as error:
        raise ConfigError(str(error)) from None
    first_s, last_s = float(record.t_s[0]), float(record.t_s[-1])
    from_s, to_s = request.model.from_s, request.model.to_s
    if (from_s is not None and from_s >= last_s) or (to_s is not None and to_s <= first_s):
        raise ConfigError(
            f"--from {from_s} --to {to_s} leaves nothing of {request.file}; must be within "
            f"{first_s:.4g} to {last_s:.4g} s: choose another part"
        )
    return record


def _found(file: Path) -> Path:
    """Find a file, or a recorded run by part of its name or `last`; raises ConfigError."""
    if file.exists():
        return file
    try:
        return runs.find_log(str(file), runs.RUNS)
    except RigError:
        raise ConfigError(
            f"{file}: no such file and no such run; must be a table, a trace, a log or a run: "
            "check the path"
        ) from None


def _of_record(request: IdentifyRequest, record: SignalRecord) -> IdentifyOptions:
    """Add what the record knows; a run of ours knows its average and when its move had settled."""
    options = replace(request.model, unit=record.unit)
    path = request.file / runs.LOG if request.file.is_dir() else request.file
    if not record.kind.startswith(OWN_LOG):
        return options
    try:
        run = RunLog.open(path)
    except LogError:  # angles alone, as `rig track --mcap` writes them
        return options
    rate_hz = run.facts.rate_of(run.main_camera)
    if rate_hz and run.t_start_s is not None:
        from_s = options.from_s
        if from_s is None:
            from_s = run.t_settled_s - record.origin_s
        return replace(
            options,
            from_s=from_s,
            average_frames=run.facts.average_frames,
            frame_period_s=1.0 / rate_hz,
        )
    return options


def _choice(found: Identification) -> RobustChoice | None:
    """Compare planners for the cable that was found; None where there is none to move."""
    length_m, sigma_m = found.cable_length_m, found.sigma_cable_length_m
    if length_m is None or sigma_m is None or not found.modes:
        return None
    if any(reason.code not in HARMLESS for reason in found.reasons):
        return None
    if not LENGTHS_M[0] <= length_m <= LENGTHS_M[1] or sigma_m > length_m:
        return None
    damping_ratio = min(max(found.modes[0].damping_ratio, 0.0), 0.9)
    try:
        return choose_planner(length_m, sigma_m, damping_ratio)
    except PlanError:
        return None


def _document(
    record: SignalRecord, found: Identification, choice: RobustChoice | None, code: int
) -> dict[str, Any]:
    """Collect the answer for JSON."""
    return {
        "exit_status": EXIT_STATUS[code],
        "exit_code": code,
        "file": {
            "path": str(record.path),
            "kind": record.kind,
            "layout": record.layout,
            "columns": list(record.columns),
            "time": record.time_source,
            "signal": record.signal_source,
            "unit": record.unit_source,
            "rows": record.rows,
            "dropped_rows": record.dropped_rows,
            "quantum": record.quantum,
            "findings": [{"code": f.code, "text": f.text} for f in record.findings],
        },
        **identification_document(found),
        "plan": None if choice is None else choice_document(choice),
    }


def identification_document(found: Identification) -> dict[str, Any]:
    """Collect an identification for JSON."""
    opinion = found.second_opinion
    return {
        "verdict": found.verdict,
        "reasons": [{"code": r.code, "text": r.text} for r in found.reasons],
        "notes": [{"code": r.code, "text": r.text} for r in found.notes],
        "kind": found.kind,
        "unit": found.unit,
        "samples": found.samples,
        "rate_hz": found.rate_hz,
        "gaps": found.gaps,
        "window_s": found.window_s,
        "modes": [asdict(mode) for mode in found.modes],
        "terms": list(found.terms),
        "small_amplitude_frequency_hz": found.small_amplitude_frequency_hz,
        "cable_length_m": found.cable_length_m,
        "sigma_cable_length_m": found.sigma_cable_length_m,
        "damping_over_amplitude": [row._asdict() for row in found.damping_over_amplitude],
        "noise_rms": found.noise_rms,
        "residual_over_noise": found.residual_over_noise,
        "second_opinion": None if opinion is None else asdict(opinion),
        "budget": [row._asdict() for row in found.budget],
    }


def choice_document(choice: RobustChoice) -> dict[str, Any]:
    """Collect the comparison of planners for JSON."""
    return {
        "distance_m": choice.distance_m,
        "time_s": choice.time_s,
        "lengths_m": list(choice.lengths_m),
        "residual_rad": {row.candidate.words: list(row.residual_rad) for row in choice.rows},
        "chosen": choice.chosen.candidate.words,
    }
