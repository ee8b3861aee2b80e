"""Parameters of a run as its log records them, in rows for the report.

A log may be of another version: what it lacks is "not recorded".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import msgspec

from comms.link import LinkFaults
from rig.analysis.facts import number_at, value_at
from rig.analysis.run_log import RunLog
from rig.analysis.summary import Summary
from rig.ui.link_text import link_faults
from rig.ui.report_page import link

NOT_RECORDED = "not recorded"
FAULT_KEYS = ("delay_ms", "jitter_ms", "loss", "burst")
LIMITS = (  # name, key of [limits], metric of the plan, unit
    ("speed", "speed_m_s", "peak_speed_m_s", "m/s"),
    ("acceleration", "acceleration_m_s2", "peak_acceleration_m_s2", "m/s²"),
)


def parameter_rows(run: RunLog, summary: Summary) -> list[tuple[str, object]]:
    """List name and value of the parameters of a run."""
    start = run.log.metadata["run.start"]
    tables = msgspec.json.decode(run.log.attachments["experiment.json"])
    return [
        ("experiment", _experiment(start, tables)),
        ("seed", start.get("seed", NOT_RECORDED)),
        ("duration", _duration(run, summary)),
        ("model", _model(run, tables)),
        ("planner", _planner(run, tables)),
        ("limits", _limits(run, tables)),
        ("links", _links(tables)),
        ("calibration", _calibration(run, start)),
        ("code", _code(start)),
        ("versions", _versions(start)),
        ("started", start.get("utc", NOT_RECORDED)),
        ("log", link(run.log.path.name)),
        ("digest", summary.digest or "none: a run in real time"),
    ]


def _experiment(start: Mapping[str, str], tables: Any) -> str:
    words = [start.get("experiment", NOT_RECORDED)]
    kind = start.get("kind", "")
    if kind and kind != words[0]:
        words.append(f"({kind})")
    purpose = value_at(tables, "experiment", "purpose")
    if purpose:
        words.append(f"- {purpose}")
    return " ".join(words)


def _duration(run: RunLog, summary: Summary) -> str:
    plan = run.plan
    intervals = f"quiet {plan.quiet_s:g}, move {plan.time_s:g}, watching {plan.watch_s:g}"
    text = f"{plan.duration_s:g} s: {intervals}"
    if summary.mode == "virtual" and summary.loop_s:
        text += f"; computed in {summary.loop_s:.1f} s"
    return text


def _model(run: RunLog, tables: Any) -> str:
    if run.plan.angle_rad is not None:
        return _joint_model(value_at(tables, "joint", "model"))
    if run.facts.is_chain:
        links = value_at(tables, "model", "links")
        return f"chain, links length:mass:kind {links}"
    facts = run.facts
    return f"cable {facts.cable_length_m:g} m, damping ratio {facts.damping_ratio:g}"


def _joint_model(model: Any) -> str:
    if not isinstance(model, dict):
        return NOT_RECORDED
    return ", ".join(f"{key} {value}" for key, value in model.items())


def _planner(run: RunLog, tables: Any) -> str:
    plan = run.plan
    if plan.angle_rad is not None:
        return f"{plan.planner}: {math.degrees(plan.angle_rad):g}° in {plan.time_s:g} s"
    if plan.time_s == 0.0:
        return "none: no move"
    words = [f"{plan.planner}: {plan.distance_m:g} m in {plan.time_s:g} s"]
    entry = value_at(tables, "plan", "input")
    if entry:
        words.append(f"{entry} input")
    if plan.planner == "law":
        words.append(f"law {value_at(tables, 'plan', 'law')}")
    robust = value_at(tables, "plan", "robust")
    if isinstance(robust, list) and robust:
        words.append(f"robust to {', '.join(map(str, robust))}")
    if value_at(tables, "plan", "nonlinear"):
        words.append("nonlinear")
    return ", ".join(words)


def _limits(run: RunLog, tables: Any) -> str:
    if run.plan.angle_rad is not None:
        return f"torque {number_at(tables, 'joint', 'drive', 'torque_limit_n_m')} N m"
    metrics = run.plan.metrics or {}
    words = []
    for name, key, metric, unit in LIMITS:
        limit = number_at(tables, "limits", key)
        if limit is None:
            continue
        text = f"{name} {limit:g} {unit}"
        if metric in metrics:
            text += f" (plan {metrics[metric]:.3g})"
        words.append(text)
    return ", ".join(words) or NOT_RECORDED


def _links(tables: Any) -> str:
    links = value_at(tables, "links")
    if not isinstance(links, dict):
        return NOT_RECORDED
    words = [f"{name} ({_faults(faults)})" for name, faults in links.items()]
    return ", ".join(words) or "no faults"


def _faults(faults: Any) -> str:
    """Describe the faults of a link by the keys that are known."""
    values: dict[str, Any] = {}
    for key in FAULT_KEYS:
        value = number_at(faults, key)
        if value is not None:
            values[key] = value
    if "burst" in values:
        values["burst"] = int(values["burst"])
    return link_faults(LinkFaults(**values))


def _calibration(run: RunLog, start: Mapping[str, str]) -> str:
    if run.facts.rate_hz == 0.0:
        return "no camera"
    return start.get("calibration") or NOT_RECORDED


def _code(start: Mapping[str, str]) -> str:
    commit = start.get("git_commit", NOT_RECORDED)
    return start.get("code") or f"git {commit}"


def _versions(start: Mapping[str, str]) -> str:
    words = [f"python {start['python']}"] if "python" in start else []
    words += [word.replace("=", " ") for word in start.get("versions", "").split()]
    return ", ".join(words) or NOT_RECORDED
