"""Every planner by name: the one door for whoever wants a plan."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from planners.boundary_value.collocation import plan_collocation
from planners.boundary_value.convolution import plan_convolution
from planners.boundary_value.finite_differences import plan_finite_differences
from planners.boundary_value.matrix_exponential import plan_matrix_exponential
from planners.boundary_value.shooting import plan_shooting
from planners.errors import NotConverged, unknown_name
from planners.plan_law import plan_law
from planners.problem import Plan, Problem
from planners.replay.metrics import measure
from planners.shapers.plan_shaped import SHAPED, plan_shaped
from planners.trajectories.motion import Motion
from planners.trajectories.trajectory import Trajectory

LEFT, LEFT_RAD = (
    1e-5,
    1e-8,
)  # of the peak swing, and besides: what a boundary-value planner may leave on its own model
Planner = Callable[[Problem], Trajectory]

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
    """The named planner's answer, measured; timer() in seconds times the planner alone.

    Limits that the plan exceeds are told by its status and reasons. Raises PlanError for an unknown name or a problem
    that this planner cannot answer, Infeasible when the time is too short for it.
    """
    if name not in PLANNERS:
        raise unknown_name("planner", name, PLANNERS)
    begin = timer() if timer else 0.0
    trajectory = PLANNERS[name](problem)
    compute_s = timer() - begin if timer else None
    metrics = measure(problem, trajectory)
    left, bound = metrics.residual_swing_rad, LEFT * metrics.peak_swing_rad + LEFT_RAD
    if name in BOUNDARY_VALUE and not problem.nonlinear and not left <= bound:
        raise NotConverged(
            f"{name} leaves {left:.3g} rad of swing on its own model; must be <= {bound:.3g} rad: rounding spoils a load with "
            "modes so alike or so stiff; take finite_differences, or change the load"
        )
    motion = Motion.along(problem.axis, trajectory)
    return Plan(planner=name, problem=problem, motion=motion, metrics=metrics, compute_s=compute_s)
