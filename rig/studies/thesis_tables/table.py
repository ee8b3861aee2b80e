"""Published tables beside our own figures, in the source's definitions and exactly."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from typing import Literal

import msgspec
import numpy as np

from planners.boundary_value.finite_differences import solve_trapezoidal
from planners.boundary_value.linear import linear_problem
from planners.catalog import PLANNERS, Planner
from planners.errors import Infeasible
from planners.models.model import Model, StateSpace
from planners.problem import Problem
from planners.trajectories.pieces import FloatArray
from planners.trajectories.trajectory import Trajectory
from rig.studies.thesis_tables.exact import exact_metrics, states_along
from rig.studies.thesis_tables.loads import PENDULUM, TWO_BARS
from rig.studies.thesis_tables.nodes import FINE_INTERVALS, shaped_nodes, shooting_nodes
from rig.studies.thesis_tables.published import PublishedRow, rows
from rig.studies.thesis_tables.source_metrics import SOURCE_SAMPLE_S, InputNodes, source_metrics

DISTANCE_M = 0.2
WINDOW = 2  # usual window of the speed's RMS, over the duration of the move
FIGURE_TOLERANCE_REL = 5e-4  # difference up to which a figure counts as reproduced
RESIDUAL_TOLERANCE_REL = 0.02  # likewise of a residual, which is caused by rounding of the input
SOURCE_INTERVALS = 200  # of the source's finite differences
SOURCE_MESH_POINTS = 2000  # of the source's bvp5c
SHAPERS = ("zv", "zvd")
CLOSED_FORMS = ("convolution", "matrix_exponential")
HALF_PERIODS_S = {  # as the source's figures show; True for the two bars
    False: (1.0,),
    True: (0.820, 0.189),
}
MAX_TIMED_RUNS = 3  # of a plan whose planning time is measured
TIMING_BUDGET_S = 0.05  # no further run is started after it


class RowComparison(msgspec.Struct, frozen=True, kw_only=True):
    """Published row and our figures by column; empty where no plan exists (`refused` says why)."""

    row: PublishedRow
    ours: dict[str, float]  # with the source's definitions, sampling and tuning
    exact: dict[str, float]  # exact solution of the same problem; see exact_metrics
    compute_s: float | None  # planning time of our planner; None if it is not measured
    refused: str = ""

    @property
    def errors(self) -> dict[str, float]:
        """Relative differences by column: ours / published - 1."""
        return {
            column: self.ours[column] / figure - 1.0
            for column, figure in self.row.published.items()
            if self.ours
        }

    @property
    def off(self) -> tuple[str, ...]:
        """Columns in which our figure and the published one differ by more than the tolerance."""
        return tuple(
            column for column, error in self.errors.items() if abs(error) > tolerance(column)
        )

    @property
    def reason(self) -> str:
        """Reason of the row's verdict; "" without one."""
        if self.row.verdict != "false":
            return self.row.why
        excess = 1.0 / (1.0 + self.errors["a_max_m_s2"]) - 1.0
        percent = f"{excess:.1%}".replace("%", " %")
        return f"{self.row.why}: its peak acceleration is {percent} above ours"

    @property
    def sampling(self) -> str:
        """Deviations of this row's definitions from those of the other rows; "" without any."""
        if not self.ours:
            return ""
        row, remarks = self.row, list[str]()
        if row.window != WINDOW:
            remarks.append(
                f"its speed RMS is over [0, {row.window}T], as its printed figure shows, "
                f"not [0, {WINDOW}T]"
            )
        if row.acceleration == "speed":
            rms = f", their RMS over [0, {WINDOW}T]" if "a_rms_m_s2" in row.columns else ""
            remarks.append(
                "its accelerations are differences of the simulated speed over "
                f"{SOURCE_SAMPLE_S * 1e3:g} ms{rms}"
            )
        if row.acceleration == "filtered":
            remarks.append(
                f"its accelerations are the jerk model's output at the {SOURCE_INTERVALS + 1} nodes"
            )
        if row.method in SHAPERS and row.samples == "fine":
            remarks.append(
                f"ours: the law at {FINE_INTERVALS + 1} even points, the source's are not known"
            )
        if row.method in CLOSED_FORMS:
            remarks.append(f"ours: the exact solution at {SOURCE_MESH_POINTS} even points")
        return "; ".join(remarks)

    @property
    def as_expected(self) -> bool:
        """True if exactly the columns in row.off differ; always true of a dash."""
        return set(self.off) == set(self.row.off) and bool(self.ours) >= bool(self.row.figures)


def tolerance(column: str) -> float:
    """Return the relative difference up to which a column counts as reproduced."""
    return RESIDUAL_TOLERANCE_REL if "_res_" in column else FIGURE_TOLERANCE_REL


def compare_table(
    table: str, seconds: Callable[[PublishedRow], float] | None = None
) -> list[RowComparison]:
    """Compare every row of a table; seconds(row) measures the planning time of our planner.

    Raises PlanError for an unknown table.
    """
    return [_compare_row(row, seconds) for row in rows(table)]


def planning_time(timer: Callable[[], float]) -> Callable[[PublishedRow], float]:
    """Build a function that measures the planning time of a row's planner [s].

    Each planner runs once before, so that it is loaded. Rows of the same plan are timed once.
    """
    known: dict[tuple[object, ...], float] = {}
    warm: set[str] = set()

    def seconds(row: PublishedRow) -> float:
        plan, problem = PLANNERS[row.method], problem_of(row)
        if row.method not in warm:
            plan(problem)
            warm.add(row.method)
        same = (row.method, row.bars, row.input, row.robust, row.time_s)
        if same not in known:
            known[same] = _median_time_s(plan, problem, timer)
        return known[same]

    return seconds


def problem_of(row: PublishedRow) -> Problem:
    """Build the planning problem of a row."""
    model: Model = TWO_BARS if row.bars else PENDULUM
    robust = (("length_2" if row.bars else "length"),) if row.robust else ()
    return Problem(
        distance_m=DISTANCE_M, time_s=row.time_s, model=model, input=row.input, robust=robust
    )


def _compare_row(
    row: PublishedRow, seconds: Callable[[PublishedRow], float] | None
) -> RowComparison:
    problem = problem_of(row)
    try:
        exact = PLANNERS[row.method if row.method in SHAPERS else "convolution"](problem)
    except Infeasible as refusal:
        return RowComparison(row=row, ours={}, exact={}, compute_s=None, refused=str(refusal))
    plant, nodes = _simulated_input(row, problem, exact)
    samples: Literal["nodes", "speed"] = "speed" if row.acceleration == "speed" else "nodes"
    return RowComparison(
        row=row,
        ours=source_metrics(plant, nodes, window=row.window, acceleration=samples),
        exact=exact_metrics(problem.model, exact),
        compute_s=seconds(row) if seconds else None,
    )


def _simulated_input(
    row: PublishedRow, problem: Problem, exact: Trajectory
) -> tuple[StateSpace, InputNodes]:
    """Return the plant that the source simulated, and the input nodes of the technique."""
    plant = problem.model.state_space(problem.input)
    if row.method in SHAPERS:
        derivatives = int(row.method == "zvd")
        half_periods_s = HALF_PERIODS_S[row.bars]
        nodes = shaped_nodes(DISTANCE_M, row.time_s, half_periods_s, derivatives, row.samples)
        return plant, nodes
    if row.method == "shooting":
        return plant, shooting_nodes(PENDULUM, DISTANCE_M, row.time_s, robust=row.robust)
    if row.method != "finite_differences":
        t = np.linspace(0.0, row.time_s, SOURCE_MESH_POINTS)
        return plant, InputNodes(t, _input_along(problem, plant, exact, t))
    solution = solve_trapezoidal(linear_problem(problem), SOURCE_INTERVALS)
    if row.acceleration != "filtered":
        return plant, InputNodes(solution.t_s, solution.input)
    # the source simulated the bars with the jerk model's filter, the pendulum with the nodes of the
    # filter's output
    acceleration = solution.states[:, plant.states.index("acceleration_m_s2")]
    return problem.model.state_space(), InputNodes(solution.t_s, acceleration)


def _input_along(
    problem: Problem, plant: StateSpace, trajectory: Trajectory, t_s: FloatArray
) -> FloatArray:
    """Compute the input of a plan at evenly spaced times: (m,).

    It is the acceleration of the platform, or the force that causes it with the swinging load.
    """
    acceleration = trajectory.at(t_s, 2)
    if problem.input == "acceleration":
        return acceleration
    states = states_along(problem.model, trajectory, len(t_s) - 1)
    return np.asarray((acceleration - states @ plant.a[1]) / plant.b[1, 0])


def _median_time_s(plan: Planner, problem: Problem, timer: Callable[[], float]) -> float:
    """Measure the median time of up to MAX_TIMED_RUNS runs within the budget, at least one."""
    times: list[float] = []
    while len(times) < MAX_TIMED_RUNS and sum(times) < TIMING_BUDGET_S:
        begin = timer()
        plan(problem)
        times.append(timer() - begin)
    return statistics.median(times)
