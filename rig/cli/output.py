"""What people and machines read: rich tables on stdout, or one JSON document and nothing else."""

from __future__ import annotations

import math
import sys
from typing import Any

import msgspec
from rich.console import Console
from rich.table import Table

from rig.analysis.summary import LinkSummary, Quantities, Summary

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)

ROWS = (  # key, name, factor to show, unit, digits
    ("peak_swing_rad", "peak swing", 1e3, "mrad", 2),
    ("residual_swing_rad", "residual swing", 1e3, "mrad", 3),
    ("natural_frequency_hz", "natural frequency", 1.0, "Hz", 5),
    ("damping_ratio", "damping ratio", 1.0, "", 6),
    ("cable_length_m", "cable length", 1.0, "m", 4),
)
UNKNOWN = "not identifiable in this run"
COLOUR = {"good": "green", "doubtful": "yellow", "bad": "red"}


def print_json(document: Any) -> None:
    """One JSON document; a number that is none becomes null."""
    plain = _finite(msgspec.to_builtins(document))
    sys.stdout.write(msgspec.json.format(msgspec.json.encode(plain), indent=2).decode() + "\n")


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list) else value


def print_summary(s: Summary) -> None:
    """The table at the end of a run."""
    out.print()
    out.print(_quantities(s))
    out.print(_delays(s))
    if s.links:
        out.print(_ledger(s.links))
    for event in s.events:
        out.print(f"[dim]{event}[/dim]")
    out.print(f"verdict: [{COLOUR[s.verdict]} bold]{s.verdict}[/] ({s.exit_status}, {s.mode})")
    for reason in s.reasons:
        out.print(f"  - {reason}")


def _quantities(s: Summary) -> Table:
    table = Table(title=f"{s.experiment}: {s.planner}, {s.move_m:g} m in {s.move_time_s:g} s", title_justify="left")
    for name in ("", "planned", "measured", "true"):
        table.add_column(name, justify="left" if not name else "right")
    for key, name, factor, unit, digits in ROWS:
        planned = getattr(s.planned, key, None)
        measured, sigma = getattr(s.measured, key), getattr(s.sigma, key)
        true = getattr(s.truth or Quantities(), key)
        table.add_row(
            f"{name}, {unit}" if unit else name,
            "" if planned is None else f"{planned * factor:.{digits}f}",
            UNKNOWN if measured is None else _with_sigma(measured * factor, sigma, factor, digits),
            "" if true is None else f"{true * factor:.{digits}f}",
        )
    return table


def _with_sigma(value: float, sigma: float | None, factor: float, digits: int) -> str:
    if sigma is None or not 0 < sigma < math.inf:
        return f"{value:.{digits}f}"
    digits = max(0, 1 - math.floor(math.log10(sigma * factor)))  # two digits of the uncertainty
    return f"{value:.{digits}f} ± {sigma * factor:.{digits}f}"


def _delays(s: Summary) -> str:
    d, late, error = s.latency_ms, s.lateness, s.swing_error
    words = [
        f"latency: command {_ms(d.command)}, vision {_ms(d.vision)}"
        + (f", measured swing behind truth {_ms(d.alignment)}" if d.alignment is not None else "")
        + f", exposure end to angle p99 {_ms(d.exposure_to_angle_p99)}",
        f"references: {late.references} accepted, {late.references_late} more than 30 ms after their target"
        f" (p99 {_ms(late.reference_p99_ms)}, worst {_ms(late.reference_max_ms)});"
        f" ticks skipped: {', '.join(f'{k} {v}' for k, v in sorted(late.late_ticks.items())) or 'none logged'}",
        f"vision: {s.angles_valid} of {s.frames} frames gave an angle",
    ]
    if error.outside_move_rad is not None:
        inside = f"{error.during_move_rad * 1e3:.3f}" if error.during_move_rad is not None else "-"
        words.append(f"measured minus true swing: {inside} mrad rms in the move, {error.outside_move_rad * 1e3:.3f} outside")
    return "\n".join(words)


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f} ms"


def _ledger(links: dict[str, LinkSummary]) -> Table:
    table = Table(title="ledger: sent = delivered + lost + rejected + ? (unexplained)", title_justify="left")
    for name in ("link", "sent", "delivered", "lost", "rejected", "twice", "late", "?"):
        table.add_column(name, justify="left" if name == "link" else "right", no_wrap=True)
    for name, row in links.items():
        rejected = ", ".join(f"{reason} {n}" for reason, n in sorted(row.rejected.items())) or "0"
        cells = (row.sent, row.delivered, row.lost, rejected, row.duplicated, row.late, row.unexplained)
        table.add_row(name, *map(str, cells))
    return table
