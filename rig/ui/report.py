"""HTML report of a run: one file with all figures, without scripts and external resources."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from rig.analysis.analyze import RunAnalysis
from rig.analysis.conclusion import Conclusion, conclude, repeat_command
from rig.analysis.quantities import model_quantities
from rig.analysis.summary import QUANTITIES, Quantities, Summary
from rig.run.runs import REPORT
from rig.ui.budget_rows import BUDGET_HEADS, budget_rows
from rig.ui.joint_rows import joint_rows
from rig.ui.plots import run as run_plots
from rig.ui.plots.inline_svg import inline_svg
from rig.ui.plots.joint import joint_figures
from rig.ui.report_camera import camera_figure
from rig.ui.report_page import Html, element, join, page, table, trusted
from rig.ui.report_parameters import parameter_rows

SIGMA_NOTE = "±: one standard deviation, by its causes below."
SCALE_NOTES = {  # by angle_scale of run.start; the first word is that of the first camera
    "corrected": " The angle is corrected for the pitch of the camera.",
    "uncorrected": " The angle is not corrected for the pitch of the camera, which counts.",
}
JOINT_NOTE = (
    "The load's speed is the integral of its accelerometer, less the bias at rest, as in source "
    "001. ±: one standard deviation of its noise, integrated to the end of the recording."
)
JOINT_HEADS = ("quantity", "by accelerometer and drive", "true")
QUANTITY_HEADS = ("quantity", "model", "planned", "measured ± sigma", "true")
SWINGS = ("peak_swing_rad", "residual_swing_rad")  # what losses change
LEDGER_HEADS = (
    "link",
    "sent",
    "delivered",
    "lost",
    "rejected",
    "duplicates",
    "late",
    "superseded",
    "foreign",
    "unaccounted",
)


def write(folder: Path, analysis: RunAnalysis, twin: RunAnalysis | None = None) -> Path:
    """Write report.html into the run folder; gives its path.

    twin: the same run without losses, shown for comparison.
    """
    s = analysis.summary
    conclusion = conclude(analysis.run, s)
    losses = _losses(s, twin.summary) if twin is not None else ""
    story = element("section", _quantities(analysis), losses, _next_run(conclusion))
    parameters = element("section", _parameters(analysis))
    document = page(
        s.run_id,
        _head(s, conclusion),
        element("div", story, parameters, class_="columns first"),
        element("div", *_plots(analysis, twin), class_="columns"),
        _budget(s),
        _delays(s),
        _field_bus(s),
        _ledger(s),
        _events(s),
    )
    path = folder / REPORT
    path.write_text(document, encoding="utf-8")
    return path


def _head(s: Summary, conclusion: Conclusion) -> Html:
    """Conclusion, what was run, and the verdict with its reasons."""
    reasons = [element("li", reason) for reason in s.reasons]
    verdict = element("b", s.verdict, class_=s.verdict)
    return element(
        "header",
        element("h1", conclusion.sentence),
        element("p", f"{s.headline} · {s.run_id} · {s.mode}", class_="note"),
        element("p", "Verdict: ", verdict, f" ({s.exit_status})"),
        element("ul", *reasons) if reasons else "",
    )


def _quantities(analysis: RunAnalysis) -> Html:
    """Model, planned, measured and true values side by side."""
    s = analysis.summary
    if s.move_deg is not None:
        return join(table(JOINT_HEADS, joint_rows(s)), element("p", JOINT_NOTE, class_="note"))
    model = model_quantities(analysis.run)
    truth = s.truth or Quantities()
    rows = []
    for row in QUANTITIES:
        measured = row.with_sigma(getattr(s.measured, row.key), getattr(s.sigma, row.key))
        cells = (
            row.title,
            row.plain(getattr(model, row.key)),
            row.plain(getattr(s.planned, row.key, None)),
            measured,
            row.plain(getattr(truth, row.key)),
        )
        rows.append(cells)
    if s.across is not None:
        title, measured, true = s.across.row
        rows.append((title, "", "", measured, true))
    scale = analysis.run.log.metadata["run.start"].get("angle_scale", "uncorrected")
    scale_note = SCALE_NOTES.get(scale.split(",")[0], "")
    note = element("p", SIGMA_NOTE + scale_note, class_="note")
    return join(table(QUANTITY_HEADS, rows), note)


def _losses(s: Summary, twin: Summary) -> Html:
    """True swing with and without the losses of the links."""
    rows = []
    for row in QUANTITIES:
        if row.key not in SWINGS:
            continue
        values = [getattr(run.truth or Quantities(), row.key) for run in (s, twin)]
        rows.append((row.title, *map(row.plain, values)))
    heads = ("true swing", "this run", "without losses")
    return table(heads, rows)


def _next_run(conclusion: Conclusion) -> Html:
    """Setting to paste, and the command of a run with it."""
    setting = conclusion.setting
    if setting is None:
        return join()
    return join(
        element("h2", "Better model, for the experiment file"),
        element("pre", f"[{setting.section}]\n{setting.key} = {setting.value}"),
        element("h2", "Command of a run with it"),
        element("pre", conclusion.command),
    )


def _parameters(analysis: RunAnalysis) -> Html:
    rows = parameter_rows(analysis.run, analysis.summary)
    return join(
        table((), rows, class_="facts"),
        element("h2", "Command that repeats this run"),
        element("pre", repeat_command(analysis.run, analysis.summary)),
    )


def _plots(analysis: RunAnalysis, twin: RunAnalysis | None) -> list[Html]:
    twin_run = twin.run if twin is not None else None
    if analysis.joint is not None:
        return [_figure(name, figure) for name, figure in joint_figures(analysis.joint)]
    if analysis.summary.move_deg is not None:
        return []
    parts = []
    for name, figure in run_plots.all_figures(analysis.run, analysis.fit, twin_run):
        parts.append(_figure(name, figure))
    camera = camera_figure(analysis.run)
    if camera is not None:
        parts.append(element("section", element("h2", "Camera image"), camera))
    return parts


def _figure(name: str, figure: Figure) -> Html:
    svg = trusted(inline_svg(figure, name))
    return element("section", element("h2", name.capitalize()), element("figure", svg))


def _field_bus(s: Summary) -> Html:
    """Load, rhythm and errors of the field bus."""
    bus = s.field_bus
    if bus is None:
        return join()
    period = "-"
    if bus.sync_period_s is not None and bus.sync_jitter_s is not None:
        period = f"{bus.sync_period_s * 1e3:.3f} ± {bus.sync_jitter_s * 1e3:.3f} ms"
    rows = [
        ("frames", f"{bus.frames}"),
        ("load, without stuff bits / with the most", f"{bus.load:.1%} / {bus.load_stuffed:.1%}"),
        ("period of the SYNC, median ± half the range", period),
        ("corrupted frames, repeated", f"{bus.errors}"),
        ("a sender went bus-off", "yes" if bus.bus_off else "no"),
    ]
    return join(element("h2", "Field bus"), table(("quantity", "value"), rows))


def _delays(s: Summary) -> Html:
    if s.move_deg is not None:
        return join()
    d = s.latency_ms
    late = s.lateness
    error = s.swing_error
    skipped = ", ".join(f"{task} {count}" for task, count in sorted(late.late_ticks.items()))
    rows = [
        ("command latency, plan to platform", _ms(d.command)),
        ("vision latency, instant of the angle to its reception", _ms(d.vision)),
        ("delay of the measured swing behind the true one", _ms(d.alignment)),
        ("end of exposure to reception of the angle, p99", _ms(d.exposure_to_angle_p99)),
        (
            "references accepted / of these more than 30 ms after their target",
            f"{late.references} / {late.references_late}",
        ),
        (
            "lateness of references, p99 / maximum",
            f"{_ms(late.reference_p99_ms)} / {_ms(late.reference_max_ms)}",
        ),
        ("skipped ticks", skipped),
        ("motion, peaks beside the bounds of [safety]", s.motion.text),
        ("frames with an angle", f"{s.angles_valid} of {s.frames}"),
        (
            "measured minus true swing, rms during the move / outside",
            f"{_mrad(error.during_move_rad)} / {_mrad(error.outside_move_rad)}",
        ),
    ]
    return join(element("h2", "Delays and accuracy"), table(("quantity", "value"), rows))


def _budget(s: Summary) -> Html:
    """Causes of the standard deviations."""
    rows = budget_rows(s)
    if not rows:
        return join()
    return join(element("h2", "Standard deviations"), table(BUDGET_HEADS, rows, class_="ledger"))


def _ledger(s: Summary) -> Html:
    rows = []
    for name, r in s.links.items():
        rejected = sum(r.rejected.values())
        passed = (r.sent, r.delivered, r.lost, rejected, r.duplicated, r.late)
        rows.append((name, *passed, r.superseded, r.foreign, r.unexplained))
    return join(element("h2", "Packet ledger"), table(LEDGER_HEADS, rows, class_="ledger"))


def _events(s: Summary) -> Html:
    return join(element("h2", "Events"), element("pre", "\n".join(s.events)))


def _ms(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{round(value, 2) + 0.0:.2f} ms"  # + 0.0: no negative zero


def _mrad(value: float | None) -> str:
    return "-" if value is None else f"{value * 1e3:.3f} mrad"
