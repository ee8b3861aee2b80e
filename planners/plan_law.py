"""A motion law as it is, for comparison with what takes the load into account."""

from __future__ import annotations

from planners.errors import PlanError
from planners.laws import LAWS
from planners.problem import Problem
from planners.trajectories.trajectory import Trajectory


def plan_law(problem: Problem) -> Trajectory:
    """The problem's law from start to goal; the load swings as it will. PlanError for ends that are not rest, or robust."""
    if not problem.rest_to_rest:
        raise PlanError(
            f"planner law from {problem.start_state} to {problem.goal_state}; must be rest to rest: take convolution"
        )
    if problem.robust:
        raise PlanError(
            f"planner law with robust = {problem.robust}; must be (), as a law knows no load: take zvd or convolution"
        )
    return LAWS[problem.law](problem.time_s).scaled(problem.distance_m).shifted(problem.start_m)
