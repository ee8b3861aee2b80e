"""Every planner by name: the one door for whoever wants a plan."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from planners.boundary_value.matrix_exponential import plan_matrix_exponential
from planners.errors import unknown_name
from planners.metrics import measure
from planners.motion import Motion
from planners.problem import Plan, Problem
from planners.shaping import SHAPERS, plan_shaped
from planners.trajectory import Trajectory

Planner = Callable[[Problem], Trajectory]

PLANNERS: dict[str, Planner] = {
    "matrix_exponential": plan_matrix_exponential,
    **{name: partial(plan_shaped, name) for name in SHAPERS},
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
    return Plan(
        planner=name,
        problem=problem,
        motion=Motion.along(problem.axis, trajectory),
        metrics=measure(problem, trajectory),
        compute_s=compute_s,
    )
