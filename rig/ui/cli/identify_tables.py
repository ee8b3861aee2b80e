"""Tables of `rig identify`: what was read, modes with uncertainty, budget, and what to do next."""

from __future__ import annotations

import math

from rig.analysis.identify.identification import Identification, Mode
from rig.analysis.readers.signal_record import SignalRecord
from rig.studies.robust_choice import SIGMAS, RobustChoice
from rig.ui.cli.output import COLOUR
from rig.ui.cli.page import Column, plain_table, print_command, print_paragraph, print_table
from rig.ui.shown_unit import shown_unit

HINTS = {  # by code of a reason
    "kind": "try --kind linear, or another --unit",
    "holes": "the uncertainty is widened for it; record without losses",
    "halves": "look at the damping over amplitude, or take a part with --from and --to",
    "unresolved": "record longer, so that the modes can be told apart",
    "unit": "try --unit deg",
}
VERDICT_COLOUR = COLOUR | {"refused": "red"}
MODE_COLUMNS = (
    "mode",
    "frequency [Hz]",
    "damping ratio",
    "at amplitude",
    Column("decay time [s]", drop=2),
    Column("Q", drop=1),
)
BUDGET_COLUMNS = ("uncertainty", "frequency [mHz]", "damping ratio", Column("length [mm]", drop=1))


def print_identification(
    record: SignalRecord, found: Identification, choice: RobustChoice | None
) -> None:
    """Print everything about one record."""
    _print_record(record, found)
    if found.modes:
        _print_modes(found)
        _print_opinion(found)
    print_paragraph(f"verdict: {found.verdict}", f"{VERDICT_COLOUR[found.verdict]} bold")
    for reason in found.reasons:
        hint = HINTS.get(reason.code, "")
        print_paragraph(f"  - {reason.text}{hint and '; '}{hint}", indent="    ")
    if record.unit == "none" and found.kind == "linear":
        print_paragraph(
            "  - the unit is not known, so the frequency is taken not to depend on the amplitude: "
            "give --unit, for example --unit rad for the angle of a pendulum",
            indent="    ",
        )
    if choice is not None:
        _print_choice(found, choice)


def with_sigma(value: float, sigma: float) -> str:
    """Format a value with two digits of its standard deviation."""
    if not 0.0 < sigma < math.inf:
        return f"{value:.6g}"
    digits = max(0, 1 - math.floor(math.log10(sigma)))
    return f"{value:.{digits}f} ± {sigma:.{digits}f}"


def amplitude_text(value: float, unit: str) -> str:
    """Format an amplitude in a unit that is easily read."""
    name, factor = shown_unit(unit)
    return f"{value * factor:.3g} {name}".rstrip()


def _print_record(record: SignalRecord, found: Identification) -> None:
    layout = f", {record.layout}" if record.layout else ""
    print_paragraph(f"{record.path}: {record.kind}{layout}", "bold")
    print_paragraph(f"  signal: {record.signal_source}; unit: {record.unit_source}", indent="    ")
    dropped = f", {record.dropped_rows} not used" if record.dropped_rows else ""
    print_paragraph(
        f"  time: {record.time_source}; {record.rows} rows{dropped}, {found.rate_hz:.6g} Hz, "
        f"{found.gaps} gaps",
        indent="    ",
    )
    noise = record.noise_floor if found.noise_rms is None else found.noise_rms
    window = ""
    if found.window_s is not None:
        window = f"; window {found.window_s[0]:.4g} to {found.window_s[1]:.4g} s"
    print_paragraph(
        f"  quantum {amplitude_text(record.quantum, found.unit)}, noise "
        f"{amplitude_text(noise, found.unit)}{window}",
        indent="    ",
    )
    for finding in record.findings:
        print_paragraph(f"  - {finding.text}", indent="    ")
    for note in found.notes:
        print_paragraph(f"  - {note.text}", indent="    ")


def _print_modes(found: Identification) -> None:
    terms = "".join(f" + {term}" for term in found.terms)
    table = plain_table(f"{found.kind}, viscous damping{terms}", MODE_COLUMNS)
    for number, mode in enumerate(found.modes, start=1):
        table.add_row(*_mode_cells(number, mode, found.unit))
    print_table(table)
    if found.cable_length_m is not None and found.sigma_cable_length_m is not None:
        length = with_sigma(found.cable_length_m, found.sigma_cable_length_m)
        print_paragraph(f"equivalent simple pendulum: {length} m")
    if len(found.damping_over_amplitude) > 1:
        parts = [
            f"{with_sigma(row.damping_ratio, row.sigma)} at "
            f"{amplitude_text(row.amplitude, found.unit)}"
            for row in found.damping_over_amplitude
        ]
        print_paragraph(f"damping ratio over amplitude: {'; '.join(parts)}", indent="  ")
    budget = plain_table("", BUDGET_COLUMNS)
    for row in found.budget:
        budget.add_row(
            row.term,
            f"{1e3 * row.frequency_hz:.3g}",
            f"{row.damping_ratio:.2g}",
            f"{1e3 * row.cable_length_m:.3g}" if found.cable_length_m is not None else "",
        )
    print_table(budget)


def _mode_cells(number: int, mode: Mode, unit: str) -> list[str]:
    return [
        str(number),
        with_sigma(mode.frequency_hz, mode.sigma_frequency_hz),
        with_sigma(mode.damping_ratio, mode.sigma_damping_ratio),
        amplitude_text(mode.at_amplitude, unit),
        f"{mode.decay_time_s:.4g}" if math.isfinite(mode.decay_time_s) else "none",
        f"{mode.q:.4g}" if math.isfinite(mode.q) else "none",
    ]


def _print_opinion(found: Identification) -> None:
    opinion = found.second_opinion
    parts = []
    if found.residual_over_noise is not None:
        parts.append(f"residual {found.residual_over_noise:.2f} times the noise")
    if opinion is not None and math.isfinite(opinion.frequency_hz):
        parts.append(
            f"matrix pencil: {opinion.frequency_hz:.6g} Hz ({opinion.frequency_difference_hz:+.2g})"
            f", damping ratio {opinion.damping_ratio:.3g} ({opinion.damping_difference:+.1g})"
        )
    if opinion is not None and math.isfinite(opinion.decrement_damping_ratio):
        parts.append(
            f"logarithmic decrement over {opinion.decrement_periods} periods: "
            f"{opinion.decrement_damping_ratio:.3g}"
        )
    if opinion is not None and math.isfinite(opinion.hann_peak_hz):
        parts.append(
            f"FFT: {opinion.hann_peak_hz:.5g} Hz (Hann), {opinion.hamming_peak_hz:.5g} Hz "
            f"(Hamming), bins of {opinion.fft_bin_hz:.2g} Hz"
        )
    if parts:
        print_paragraph("; ".join(parts), indent="  ")


def _print_choice(found: Identification, choice: RobustChoice) -> None:
    mode = found.modes[0]
    columns = ["planner", *(f"{sigma:+.0f} σ" if sigma else "length" for sigma in SIGMAS)]
    title = (
        f"residual swing [mrad] of {choice.distance_m:g} m in {choice.time_s:.3g} s, for the "
        "length and its uncertainty"
    )
    table = plain_table(title, columns)
    for row in choice.rows:
        cells = [f"{1e3 * value:.3f}" for value in row.residual_rad]
        style = "bold" if row is choice.chosen else ""
        table.add_row(row.candidate.words, *cells, style=style)
    print_table(table)
    length_m = found.cable_length_m or 0.0
    damping_ratio = max(mode.damping_ratio, 0.0)
    print_paragraph("for the experiment file:")
    print_paragraph("    [model]")
    print_paragraph(f"    length_m = {length_m:.5g}")
    print_paragraph(f"    damping_ratio = {damping_ratio:.3g}")
    print_command(
        "next:",
        f"rig plan {choice.chosen.candidate.words} --distance {choice.distance_m:g} "
        f"--time {choice.time_s:.3g} --length {length_m:.5g} --damping {damping_ratio:.3g}",
    )
