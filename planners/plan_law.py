"""Motion law without regard to the load, for comparison with planners that model it."""

from __future__ import annotations

from planners.errors import PlanError
from planners.laws import LAWS
from planners.problem import Problem
from planners.trajectories.trajectory import Trajectory


def plan_law(problem: Problem) -> Trajectory:
    """Plan the problem's motion law from start to goal; the model of the load is not used.

    Raises PlanError for ends that are not at rest, and for robust parameters.
    """
    if not problem.rest_to_rest:
        raise PlanError(
            f"planner law from {problem.start_state} to {problem.goal_state}; must be rest to "
            "rest: take convolution"
        )
    if problem.robust:
        raise PlanError(
            f"planner law with robust = {problem.robust}; must be (), as a law contains no model "
            "of the load: take zvd or convolution"
        )
    return LAWS[problem.law](problem.time_s).scaled(problem.distance_m).shifted(problem.start_m)
