"""What people and machines read: rich tables on stdout, or one JSON document and nothing else."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import msgspec
from rich.console import Console
from rich.table import Table

from rig.analysis.summary import QUANTITIES, LinkSummary, Quantities, Summary
from rig.errors import OK


class _Pipe(Console):
    """A console whose reader may have seen enough, as `| head` has: that is no failure."""

    def on_broken_pipe(self) -> None:
        """Say nothing more, and leave with what head leaves with."""
        try:
            super().on_broken_pipe()
        except SystemExit:
            raise SystemExit(OK) from None


out = _Pipe(highlight=False, soft_wrap=True, markup=False)
wide = _Pipe(
    width=140, highlight=False, markup=False
)  # for tables that a narrower terminal may wrap, not cut
err = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)

PLAIN: Any = {"title_justify": "left", "box": None, "padding": (0, 2, 0, 0)}
COLOUR = {"good": "green", "doubtful": "yellow", "bad": "red"}


def print_json(document: Any) -> None:
    """One JSON document; a number that is none becomes null."""
    plain = _finite(msgspec.to_builtins(document))
    sys.stdout.write(msgspec.json.format(msgspec.json.encode(plain), indent=2).decode() + "\n")


@contextmanager
def working(what: str, *, quiet: bool = False) -> Iterator[None]:
    """A sign of life on stderr while something takes its time; a plain line where there is no terminal, unless quiet."""
    if err.is_terminal:
        with err.status(what):
            yield
        return
    if not quiet:
        err.print(what)
    yield


def plain_table(title: str, headers: Sequence[str], left: int = 1) -> Table:
    """A table without lines; all but the first columns are figures. A header may have two lines, name and unit."""
    view = Table(title=title, **PLAIN)
    for k, header in enumerate(headers):
        view.add_column(header, justify="left" if k < left else "right", no_wrap=True)
    return view


def say(text: str, style: str | None = None) -> None:
    """A paragraph, wrapped at the terminal's width."""
    out.print(text, style=style, soft_wrap=False)


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
        out.print(event, style="dim")
    out.print(
        f"verdict: {s.verdict} ({s.exit_status}, {s.mode})", style=f"{COLOUR[s.verdict]} bold"
    )
    for reason in s.reasons:
        out.print(f"  - {reason}")


def _quantities(s: Summary) -> Table:
    table = Table(title=s.headline, title_justify="left")
    for name in ("", "planned", "measured ± noise", "true"):
        table.add_column(name, justify="left" if not name else "right")
    for row in QUANTITIES:
        planned, true = getattr(s.planned, row.key, None), getattr(s.truth or Quantities(), row.key)
        measured = row.with_sigma(getattr(s.measured, row.key), getattr(s.sigma, row.key))
        table.add_row(row.title, row.plain(planned), measured, row.plain(true))
    return table


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
    if s.cpu_share:
        shares = ", ".join(f"{name} {share:.1%}" for name, share in s.cpu_share.items())
        fifo = [name for name, policy in s.scheduling.items() if policy == "fifo"]
        words.append(
            f"processors: {sum(s.cpu_share.values()):.0%} of one core ({shares}); real-time: {', '.join(fifo) or 'none'}"
        )
    if error.outside_move_rad is not None:
        inside = (
            f"{error.during_move_rad * 1e3:.3f} mrad rms in the move, "
            if error.during_move_rad is not None
            else ""
        )
        words.append(
            f"measured minus true swing: {inside}{error.outside_move_rad * 1e3:.3f} mrad rms {'outside' if inside else ''}"
        )
    return "\n".join(words)


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value + 0.0:.1f} ms".replace("-0.0", "0.0")


def _ledger(links: dict[str, LinkSummary]) -> Table:
    table = Table(
        title="ledger: sent = delivered + lost + rejected + ? (unexplained)", title_justify="left"
    )
    for name in ("link", "sent", "delivered", "lost", "rejected", "twice", "late", "?"):
        table.add_column(name, justify="left" if name == "link" else "right", no_wrap=True)
    for name, row in links.items():
        rejected = ", ".join(f"{reason} {n}" for reason, n in sorted(row.rejected.items())) or "0"
        cells = (
            row.sent,
            row.delivered,
            row.lost,
            rejected,
            row.duplicated,
            row.late,
            row.unexplained,
        )
        table.add_row(name, *map(str, cells))
    return table
