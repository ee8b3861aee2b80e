"""Table of all planners by name, and the function that runs one of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from planners.boundary_value.collocation import plan_collocation
from planners.boundary_value.convolution import plan_convolution
from planners.boundary_value.finite_differences import plan_finite_differences
from planners.boundary_value.matrix_exponential import plan_matrix_exponential
from planners.boundary_value.shooting import plan_shooting
from planners.errors import NotConverged, PlanError, unknown_name
from planners.plan_law import plan_law
from planners.problem import Metrics, Plan, Problem
from planners.replay.metrics import measure
from planners.shapers.plan_shaped import SHAPED, plan_shaped
from planners.trajectories.motion import Motion
from planners.trajectories.trajectory import Trajectory

# Residual swing that a boundary-value planner may leave on its own linear model:
RESIDUAL_SWING_REL = 1e-5  # of the peak swing, plus
RESIDUAL_SWING_RAD = 1e-8
Planner = Callable[[Problem], Trajectory]

VERTICAL_PLANNER = "law"
BOUNDARY_VALUE: dict[str, Planner] = {
    "finite_differences": plan_finite_differences,
    "shooting": plan_shooting,
    "collocation": plan_collocation,
    "convolution": plan_convolution,
    "matrix_exponential": plan_matrix_exponential,
}
PLANNERS: dict[str, Planner] = {
    **BOUNDARY_VALUE,
    **{name: partial(plan_shaped, name) for name in SHAPED},
    "law": plan_law,
}


def plan(name: str, problem: Problem, timer: Callable[[], float] | None = None) -> Plan:
    """Run the named planner and measure its trajectory.

    timer() in seconds times the planner alone. Limits that the plan exceeds are reported by its
    status and reasons. Raises PlanError for an unknown name or a problem that this planner cannot
    solve, Infeasible when the time is too short for it, NotConverged when a boundary-value planner
    leaves swing on its own linear model.
    """
    if name not in PLANNERS:
        raise unknown_name("planner", name, PLANNERS)
    if problem.axis == "z" and name != VERTICAL_PLANNER:
        raise PlanError(
            f"planner {name} for a move along z; must be '{VERTICAL_PLANNER}', as a vertical move "
            "makes no load swing that hangs at rest: name a motion law"
        )
    begin = timer() if timer else 0.0
    trajectory = PLANNERS[name](problem)
    compute_s = timer() - begin if timer else None
    metrics = measure(problem, trajectory)
    if name in BOUNDARY_VALUE and not problem.nonlinear:
        _check_residual_swing(name, metrics)
    motion = Motion.along(problem.axis, trajectory)
    return Plan(planner=name, problem=problem, motion=motion, metrics=metrics, compute_s=compute_s)


def _check_residual_swing(name: str, metrics: Metrics) -> None:
    residual_rad = metrics.residual_swing_rad
    bound_rad = RESIDUAL_SWING_REL * metrics.peak_swing_rad + RESIDUAL_SWING_RAD
    if not residual_rad <= bound_rad:
        raise NotConverged(
            f"{name} leaves {residual_rad:.3g} rad of residual swing on its own model; must be "
            f"<= {bound_rad:.3g} rad: rounding is too large for modes so close together or so "
            "stiff; take finite_differences, or change the load"
        )
