"""Output of the verbs: tables and text on stdout, or one JSON document and nothing else."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol, runtime_checkable

import msgspec
from rich.table import Table

from rig.analysis.conclusion import Conclusion
from rig.analysis.summary import QUANTITIES, FieldBus, LinkSummary, Quantities, Summary
from rig.ui.cli.page import (
    Column,
    boxed_table,
    err,
    out,
    plain_table,
    print_command,
    print_paragraph,
    print_table,
    print_whole,
)
from rig.ui.joint_rows import joint_rows

EVENT_INDENT = " " * 12  # of the further lines of an event, below its text
QUANTITY_COLUMNS = ("", Column("planned", drop=1), "measured ± sigma", "true")
JOINT_COLUMNS = ("", "by accelerometer and drive", "true")
LEDGER_COLUMNS = (
    "link",
    "sent",
    "delivered",
    "lost",
    Column("rejected", folds=True),
    Column("duplicates", drop=2),
    Column("late", drop=1),
    Column("superseded", drop=3),
    Column("foreign", drop=4),
    "unaccounted",
)


@runtime_checkable
class SupportsItem(Protocol):
    """Number of numpy, which this module does without."""

    def item(self) -> Any:
        """Convert to a number of Python."""
        ...


COLOUR = {"good": "green", "doubtful": "yellow", "bad": "red"}


def print_json(document: Any) -> None:
    """Print one JSON document; NaN and infinity become null."""
    plain = _finite(msgspec.to_builtins(document, enc_hook=_plain_number))
    sys.stdout.write(msgspec.json.format(msgspec.json.encode(plain), indent=2).decode() + "\n")


def _plain_number(value: Any) -> Any:
    """Convert a number of numpy to one of Python; raises NotImplementedError for anything else."""
    if isinstance(value, SupportsItem):
        return value.item()
    raise NotImplementedError(f"{type(value).__name__} in a JSON document")


@contextmanager
def working(what: str, *, quiet: bool = False) -> Iterator[None]:
    """Show a status on stderr during a long computation.

    Without a terminal it is one plain line, or nothing if quiet.
    """
    if err.is_terminal:
        with err.status(what):
            yield
        return
    if not quiet:
        err.print(what)
    yield


@contextmanager
def counting(what: str, total: int, *, quiet: bool = False) -> Iterator[Callable[[int], None]]:
    """Show on stderr how much of a long computation is done; yields the function that is told.

    Without a terminal it is one plain line, or nothing if quiet.
    """
    if err.is_terminal:
        with err.status(what) as status:
            yield lambda done: status.update(f"{what}: {done} of {total}")
        return
    if not quiet:
        err.print(f"{what}: {total}")
    yield lambda done: None


def _finite(value: Any) -> Any:
    """Replace NaN and infinity by None, at any depth."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return value


def print_summary(s: Summary) -> None:
    """Print the results of a run: quantities, delays, ledger, events and verdict."""
    out.print()
    print_table(_quantities(s) if s.move_deg is None else joint_table(s))
    for line in _status_lines(s):
        print_paragraph(line, indent="  ")
    if s.links:
        print_table(_ledger(s.links))
    for event in s.events:
        print_paragraph(event, "dim", indent=EVENT_INDENT)
    verdict = f"{s.verdict} ({s.exit_status}, {s.mode})"
    if s.running_s is not None:
        verdict = f"none yet: still running, {s.running_s:.0f} s so far ({s.mode})"
    print_paragraph(f"verdict: {verdict}", f"{COLOUR[s.verdict]} bold")
    for reason in s.reasons:
        print_paragraph(f"  - {reason}", indent="    ")


def print_conclusion(conclusion: Conclusion) -> None:
    """Print the conclusion of a run, and the setting that follows with the command to try it."""
    print_paragraph(conclusion.sentence, "bold")
    if conclusion.setting is not None:
        print_whole(f"  better model: {conclusion.setting.toml}")
        print_command("  try it:", conclusion.command)


def _quantities(s: Summary) -> Table:
    table = boxed_table(s.headline, QUANTITY_COLUMNS)
    for row in QUANTITIES:
        planned, true = getattr(s.planned, row.key, None), getattr(s.truth or Quantities(), row.key)
        measured = row.with_sigma(getattr(s.measured, row.key), getattr(s.sigma, row.key))
        table.add_row(row.title, row.plain(planned), measured, row.plain(true))
    if s.across is not None:
        title, measured, across_true = s.across.row
        table.add_row(title, "", measured, across_true)
    return table


def joint_table(s: Summary) -> Table:
    """Make the table of the figures of a joint."""
    table = boxed_table(s.headline, JOINT_COLUMNS)
    for row in joint_rows(s):
        table.add_row(*row)
    return table


def _status_lines(s: Summary) -> list[str]:
    lines = [_skipped_line(s)] if s.move_deg is not None else _path_lines(s)
    if s.cpu_share:
        lines.append(_processor_line(s))
    if s.field_bus is not None:
        lines.append(_field_bus_line(s.field_bus))
    if s.modes:
        lines.append(_modes_line(s))
    if s.swing_error.outside_move_rad is not None:
        lines.append(_swing_error_line(s))
    return lines


def _modes_line(s: Summary) -> str:
    """Describe the modes of a chain."""
    texts = [
        f"{mode.frequency_hz:.4f} ± {mode.sigma_frequency_hz:.1g} Hz at "
        f"{1e3 * mode.amplitude_rad:.2g} mrad"
        for mode in s.modes
    ]
    return f"modes ({s.modes[0].verdict}): {'; '.join(texts)}"


def _path_lines(s: Summary) -> list[str]:
    """Describe the path from the plan over the robot to the camera."""
    return [
        _latency_line(s),
        _reference_line(s),
        _vision_line(s),
        f"robot: {s.motion.text}",
    ]


def _vision_line(s: Summary) -> str:
    line = f"vision: {s.angles_valid} of {s.frames} frames with an angle"
    if s.settling_s is not None:
        line += f"; settled {_ms(1e3 * s.settling_s)} after the planned end"
    if s.across is None:
        return line
    return f"{line}; camera {s.across.camera}: {s.across.angles_valid} of {s.across.frames}"


def _latency_line(s: Summary) -> str:
    d = s.latency_ms
    command = _with_bound(d.command, d.command_sigma)
    parts = [f"latency: command {command}", f"vision {_ms(d.vision)}"]
    if d.alignment is not None:
        shown = _with_bound(d.alignment, d.alignment_sigma)
        parts.append(f"measured swing behind truth {shown}")
    parts.append(f"exposure end to angle p99 {_ms(d.exposure_to_angle_p99)}")
    return ", ".join(parts)


def _with_bound(value: float | None, sigma: float | None) -> str:
    """Format a delay with the bound of its alignment, where that is visible."""
    shown = _ms(value)
    return f"{shown} ± {sigma:.2f}" if sigma is not None and sigma >= 0.005 else shown


def _reference_line(s: Summary) -> str:
    late = s.lateness
    return (
        f"references: {late.references} accepted, "
        f"{late.references_late} more than 30 ms after their target "
        f"(p99 {_ms(late.reference_p99_ms)}, maximum {_ms(late.reference_max_ms)}); "
        f"{_skipped_line(s)}"
    )


def _skipped_line(s: Summary) -> str:
    ticks = sorted(s.lateness.late_ticks.items())
    skipped = ", ".join(f"{task} {count}" for task, count in ticks)
    return f"skipped ticks: {skipped or 'not logged'}"


def _processor_line(s: Summary) -> str:
    total = sum(s.cpu_share.values())
    shares = ", ".join(f"{name} {share:.1%}" for name, share in s.cpu_share.items())
    fifo = [name for name, policy in s.scheduling.items() if policy == "fifo"]
    real_time = ", ".join(fifo) or "none"
    return f"processor load: {total:.0%} of one core ({shares}); real-time tasks: {real_time}"


def _field_bus_line(bus: FieldBus) -> str:
    sync = ""
    if bus.sync_period_s is not None and bus.sync_jitter_s is not None:
        sync = f", SYNC every {bus.sync_period_s * 1e3:.2f} ± {bus.sync_jitter_s * 1e3:.2f} ms"
    state = "; a sender went bus-off" if bus.bus_off else ""
    return (
        f"field bus: {bus.frames} frames, load {bus.load:.1%} to {bus.load_stuffed:.1%} of the bit "
        f"rate{sync}; {bus.errors} corrupted frames repeated{state}"
    )


def _swing_error_line(s: Summary) -> str:
    outside_rad = s.swing_error.outside_move_rad
    during_rad = s.swing_error.during_move_rad
    outside = f"{(outside_rad or 0.0) * 1e3:.3f} mrad rms"
    if during_rad is None:
        return f"measured minus true swing: {outside}"
    during = f"{during_rad * 1e3:.3f} mrad rms"
    return f"measured minus true swing: {during} during the move, {outside} outside"


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value + 0.0:.1f} ms".replace("-0.0", "0.0")


def _ledger(links: dict[str, LinkSummary]) -> Table:
    title = "ledger: sent = delivered + lost + rejected + unaccounted"
    table = plain_table(title, LEDGER_COLUMNS)
    for name, row in links.items():
        rejected = ", ".join(f"{reason} {n}" for reason, n in sorted(row.rejected.items())) or "0"
        cells = (
            row.sent,
            row.delivered,
            row.lost,
            rejected,
            row.duplicated,
            row.late,
            row.superseded,
            row.foreign,
            row.unexplained,
        )
        table.add_row(name, *map(str, cells))
    return table
