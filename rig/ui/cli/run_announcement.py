"""Table that `rig run` shows before anything moves."""

from __future__ import annotations

from rich.table import Table

from planners.problem import Plan
from rig.run.config import ModelSection
from rig.run.job import Job
from rig.ui.cli.page import Column, boxed_table
from rig.ui.link_text import link_faults


def announcement(job: Job, plan: Plan | None, mode: str) -> Table:
    """Create the table of model, plan, times, links and calibration of a job."""
    e = job.experiment
    title = f"about to run: {e.experiment.name}"
    table = boxed_table(title, ("", Column("", folds=True)), left=2)
    table.show_header = False
    table.add_row("mode", f"{_clock(job, mode)}; seed {e.experiment.seed}")
    if plan is not None:
        m = plan.metrics
        table.add_row("plan", _plan_description(plan))
        table.add_row("model", _model_description(e.model))
        table.add_row(
            "peak demand",
            f"{m.peak_speed_m_s:.3f} m/s (limit {e.limits.speed_m_s:g}), "
            f"{m.peak_acceleration_m_s2:.2f} m/s² (limit {e.limits.acceleration_m_s2:g})",
        )
        table.add_row(
            "predicted swing",
            f"peak {m.peak_swing_rad * 1e3:.1f} mrad, "
            f"residual {m.residual_swing_nonlinear_rad * 1e3:.2f} mrad",
        )
    else:
        table.add_row("plan", _motion_description(job))
    table.add_row(
        "time",
        f"{job.plan.quiet_s:g} s quiet, {job.plan.time_s:g} s move, "
        f"{job.plan.watch_s:g} s watching",
    )
    links = [f"{name} ({link_faults(f)})" for name, f in e.links.items()]
    table.add_row("links", ", ".join(links) or "no faults")
    table.add_row("calibration", job.calibration_name if e.camera.rate_hz else "no camera")
    return table


def _clock(job: Job, mode: str) -> str:
    if mode == "virtual":
        return "virtual time, one process"
    ways = "CAN and ZeroMQ" if job.experiment.joint is not None else "UDP and ZeroMQ"
    if "drive" in job.settings and job.experiment.joint is None:
        ways = "UDP, CAN and ZeroMQ"
    return f"real time, {len(job.settings) + 1} processes, {ways}"


def _model_description(model: ModelSection) -> str:
    load = f"cable {model.cable_m:g} m"
    if model.links:
        load = f"links length:mass:kind {', '.join(model.links)}"
    return f"{load}, damping ratio {model.damping_ratio:g}"


def _motion_description(job: Job) -> str:
    """Describe a motion that no planner of loads made."""
    joint = job.experiment.joint
    if joint is not None:
        return f"{joint.move.title} of an elastic joint, controller {joint.controller}"
    return "no move" if job.plan.time_s == 0 else "from point to point"


def _plan_description(plan: Plan) -> str:
    """Describe planner, move and options of a plan in one line."""
    p = plan.problem
    words = [
        f"{plan.planner}: {p.distance_m:g} m along {p.axis} in {p.time_s:g} s",
        f"{p.input} input",
    ]
    if p.robust:
        words.append(f"robust to {', '.join(p.robust)}")
    if p.nonlinear:
        words.append("nonlinear")
    return ", ".join(words)
