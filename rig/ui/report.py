"""HTML report of a run: one file with all figures, without scripts and external resources."""

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
figure { margin: 0; background: #fff; border-radius: 6px; padding: 6px }
img, svg { width: 100%; height: auto }
.good { color: #1a7f37 } .doubtful { color: #b07800 } .bad { color: #c62828 }
"""


def write(folder: Path, analysis: RunAnalysis, twin: RunAnalysis | None = None) -> Path:
    """Write report.html into the run folder; gives its path.

    twin: the same run without losses, shown for comparison.
    """
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
    head = (
        "<!doctype html><html lang='en'><meta charset='utf-8'>"
        f"<title>{title}</title><style>{STYLE}</style>"
    )
    path = folder / REPORT
    path.write_text(f"{head}{''.join(parts)}</html>", encoding="utf-8")
    return path


def _head(s: Summary) -> str:
    reasons = "".join(f"<li>{html.escape(reason)}</li>" for reason in s.reasons)
    return (
        f"<h1>{html.escape(s.headline)}</h1>"
        f"<div class='note'>{html.escape(s.run_id)} &middot; {s.mode}</div>"
        f"<p>Verdict: <b class='{s.verdict}'>{s.verdict}</b> ({s.exit_status})</p>"
        f"<ul>{reasons}</ul>"
    )


def _quantities(s: Summary, twin: Summary | None) -> str:
    heads = ["quantity", "planned", "measured &plusmn; noise", "true"]
    runs = [s]
    if twin:
        heads.append("true, without losses")
        runs.append(twin)
    rows = []
    for row in QUANTITIES:
        planned = row.plain(getattr(s.planned, row.key, None))
        measured = row.with_sigma(getattr(s.measured, row.key), getattr(s.sigma, row.key))
        true = [row.plain(getattr(run.truth or Quantities(), row.key)) for run in runs]
        rows.append([row.title, planned, measured, *true])
    note = (
        "&plusmn;: one standard deviation of the noise. Not included: a camera pitch of 1 degree "
        "reduces the measured swing by 0.5 %."
    )
    return _table(heads, rows) + f"<p class='note'>{note}</p>"


def _picture(analysis: RunAnalysis) -> str:
    figure = run_plots.camera(analysis.run)
    if figure is None:
        return ""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    data = base64.b64encode(stream.getvalue()).decode()
    image = f"<img alt='camera image with detected cable' src='data:image/png;base64,{data}'>"
    return f"<h2>Camera image</h2><figure>{image}</figure>"


def _delays(s: Summary) -> str:
    d = s.latency_ms
    late = s.lateness
    error = s.swing_error
    skipped = ", ".join(f"{task} {count}" for task, count in sorted(late.late_ticks.items()))
    rows = [
        ["command latency, plan to platform", _ms(d.command)],
        ["vision latency, instant of the angle to its reception", _ms(d.vision)],
        ["delay of the measured swing behind the true one", _ms(d.alignment)],
        ["end of exposure to reception of the angle, p99", _ms(d.exposure_to_angle_p99)],
        [
            "references accepted / of these more than 30 ms after their target",
            f"{late.references} / {late.references_late}",
        ],
        [
            "lateness of references, p99 / maximum",
            f"{_ms(late.reference_p99_ms)} / {_ms(late.reference_max_ms)}",
        ],
        ["skipped ticks", html.escape(skipped)],
        ["frames with an angle", f"{s.angles_valid} of {s.frames}"],
        [
            "measured minus true swing, rms during the move / outside",
            f"{_mrad(error.during_move_rad)} / {_mrad(error.outside_move_rad)}",
        ],
    ]
    return "<h2>Delays and accuracy</h2>" + _table(["quantity", "value"], rows)


def _ledger(s: Summary) -> str:
    heads = ["link", "sent", "delivered", "lost", "rejected", "duplicates", "late", "unaccounted"]
    rows = []
    for name, r in s.links.items():
        counts = (
            r.sent,
            r.delivered,
            r.lost,
            sum(r.rejected.values()),
            r.duplicated,
            r.late,
            r.unexplained,
        )
        rows.append([name, *map(str, counts)])
    return "<h2>Packet ledger</h2>" + _table(heads, rows)


def _events(s: Summary) -> str:
    digest = f"\ndigest {s.digest}" if s.digest else ""
    events = html.escape("\n".join(s.events))
    return f"<h2>Events</h2><pre>{events}{digest}</pre>"


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
