"""report.html: what the run did, in pictures; one file, no scripts, nothing fetched."""

from __future__ import annotations

import base64
import html
import io
from pathlib import Path
from typing import Any

from rig.analysis.analyze import RunAnalysis
from rig.analysis.summary import QUANTITIES, Quantities, Summary
from rig.run.runs import REPORT
from rig.ui.plots import run as run_plots

STYLE = """
:root { color-scheme: light dark }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1000px; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.5em; margin-bottom: .2em } h2 { font-size: 1.15em; margin: 1.8em 0 .4em }
table { border-collapse: collapse; margin: .5em 0 }
td, th { padding: .2em .9em .2em 0; text-align: right; border-bottom: 1px solid #8884 }
td:first-child, th:first-child { text-align: left } .note { opacity: .75 }
figure { margin: 0; background: #fff; border-radius: 6px; padding: 6px } img, svg { width: 100%; height: auto }
.good { color: #1a7f37 } .doubtful { color: #b07800 } .bad { color: #c62828 }
"""


def write(folder: Path, analysis: RunAnalysis, twin: RunAnalysis | None = None) -> Path:
    """Write the report beside the log; twin is the loss-free run to lay beside it."""
    s = analysis.summary
    parts = [
        _head(s),
        _quantities(s, twin.summary if twin else None),
        "<h2>Position</h2>",
        _svg(run_plots.position(analysis.run, twin.run if twin else None)),
        "<h2>Swing</h2>",
        _svg(run_plots.swing(analysis.run, twin.run if twin else None)),
        "<h2>Residual swing</h2>",
        _svg(run_plots.residual(analysis.run, analysis.fit, twin.run if twin else None)),
        _picture(analysis),
        _delays(s),
        _ledger(s),
        _events(s),
    ]
    title = html.escape(s.run_id)
    head = f"<!doctype html><html lang='en'><meta charset='utf-8'><title>{title}</title><style>{STYLE}</style>"
    path = folder / REPORT
    path.write_text(f"{head}{''.join(parts)}</html>", encoding="utf-8")
    return path


def _head(s: Summary) -> str:
    reasons = "".join(f"<li>{html.escape(reason)}</li>" for reason in s.reasons)
    return (
        f"<h1>{html.escape(s.headline)}</h1>"
        f"<div class='note'>{html.escape(s.run_id)} &middot; {s.mode}</div>"
        f"<p>Verdict: <b class='{s.verdict}'>{s.verdict}</b> ({s.exit_status})</p><ul>{reasons}</ul>"
    )


def _quantities(s: Summary, twin: Summary | None) -> str:
    heads = [
        "",
        "planned",
        "measured &plusmn; noise",
        "true",
        *(["true, without losses"] if twin else []),
    ]
    rows = []
    for row in QUANTITIES:
        measured = row.with_sigma(getattr(s.measured, row.key), getattr(s.sigma, row.key))
        true = [
            row.plain(getattr(run.truth or Quantities(), row.key))
            for run in ((s, twin) if twin else (s,))
        ]
        rows.append([row.title, row.plain(getattr(s.planned, row.key, None)), measured, *true])
    note = "&plusmn; is one standard deviation of the noise; a camera pitched by a degree reads swings 0.5 % small besides."
    return _table(heads, rows) + f"<p class='note'>{note}</p>"


def _picture(analysis: RunAnalysis) -> str:
    figure = run_plots.camera(analysis.run)
    if figure is None:
        return ""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    data = base64.b64encode(stream.getvalue()).decode()
    image = f"<img alt='camera picture with the detected cable' src='data:image/png;base64,{data}'>"
    return f"<h2>What the camera saw</h2><figure>{image}</figure>"


def _delays(s: Summary) -> str:
    d, late, error = s.latency_ms, s.lateness, s.swing_error
    rows = [
        ["command latency: plan to platform", _ms(d.command)],
        ["vision latency: instant of the angle to its arrival", _ms(d.vision)],
        ["measured swing behind the truth", _ms(d.alignment)],
        ["end of exposure to angle received, p99", _ms(d.exposure_to_angle_p99)],
        [
            "references accepted / more than 30 ms after their target",
            f"{late.references} / {late.references_late}",
        ],
        [
            "reference lateness, p99 / worst",
            f"{_ms(late.reference_p99_ms)} / {_ms(late.reference_max_ms)}",
        ],
        [
            "ticks skipped",
            html.escape(", ".join(f"{k} {v}" for k, v in sorted(late.late_ticks.items()))),
        ],
        ["frames with an angle", f"{s.angles_valid} of {s.frames}"],
        [
            "measured minus true swing, rms in the move / outside",
            f"{_mrad(error.during_move_rad)} / {_mrad(error.outside_move_rad)}",
        ],
    ]
    return "<h2>Delays and trust</h2>" + _table(["", ""], rows)


def _ledger(s: Summary) -> str:
    heads = ["link", "sent", "delivered", "lost", "rejected", "duplicated", "late", "unexplained"]
    rows = [
        [
            name,
            *map(
                str,
                (
                    r.sent,
                    r.delivered,
                    r.lost,
                    sum(r.rejected.values()),
                    r.duplicated,
                    r.late,
                    r.unexplained,
                ),
            ),
        ]
        for name, r in s.links.items()
    ]
    return "<h2>Every packet</h2>" + _table(heads, rows)


def _events(s: Summary) -> str:
    return (
        "<h2>Events</h2><pre>"
        + html.escape("\n".join(s.events))
        + (f"\ndigest {s.digest}" if s.digest else "")
        + "</pre>"
    )


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} ms"


def _mrad(value: float | None) -> str:
    return "-" if value is None else f"{value * 1e3:.3f} mrad"


def _table(heads: list[str], rows: list[list[str]]) -> str:
    head = "".join(f"<th>{cell}</th>" for cell in heads)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def _svg(figure: Any) -> str:
    stream = io.StringIO()
    figure.savefig(stream, format="svg")
    text = stream.getvalue()
    return f"<figure>{text[text.index('<svg') :]}</figure>"
