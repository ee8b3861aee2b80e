"""The published tables beside our own figures: in the source's definitions, and exactly."""

from __future__ import annotations

import statistics
from collections.abc import Callable

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
from rig.studies.thesis_tables.nodes import FINE, shaped_nodes, shooting_nodes
from rig.studies.thesis_tables.published import PublishedRow, rows
from rig.studies.thesis_tables.source_metrics import SOURCE_SAMPLE_S, InputNodes, measure

DISTANCE_M = 0.2
WINDOW = 2  # of the speed's RMS, in times of the move
TOLERANCE, RESIDUAL_TOLERANCE = (
    5e-4,
    0.02,
)  # relative; of residuals, which are what a rounding of the input leaves
INTERVALS = 200  # of the source's finite differences
SOURCE_MESH_POINTS = 2000  # of its bvp5c
SHAPERS, CLOSED = ("zv", "zvd"), ("convolution", "matrix_exponential")
HALF_PERIODS_S = {
    False: (1.0,),
    True: (0.820, 0.189),
}  # as its figures show, by whether there are bars
RUNS, PATIENCE_S = 3, 0.05  # how often a plan is timed


class RowComparison(msgspec.Struct, frozen=True, kw_only=True):
    """One published row and ours. Figures by column; all empty where no plan exists, which `refused` explains."""

    row: PublishedRow
    ours: dict[str, float]  # the source's definitions, sampling and tuning
    exact: dict[str, float]  # the same problem solved exactly; see exact_metrics
    compute_s: float | None  # of our planner of that kind; None when nobody timed it
    refused: str = ""

    @property
    def errors(self) -> dict[str, float]:
        """ours / published - 1, by column."""
        return {
            column: self.ours[column] / figure - 1.0
            for column, figure in self.row.published.items()
            if self.ours
        }

    @property
    def off(self) -> tuple[str, ...]:
        """Columns in which ours and the published figure differ by more than the tolerance."""
        return tuple(
            column for column, error in self.errors.items() if abs(error) > tolerance(column)
        )

    @property
    def reason(self) -> str:
        """Why the row is what it is; "" where there is nothing to say."""
        if self.row.verdict != "false":
            return self.row.why
        excess = 1.0 / (1.0 + self.errors["a_max_m_s2"]) - 1.0
        return f"{self.row.why}: its peak acceleration is {excess:.1%} above ours".replace(
            "%", " %"
        )

    @property
    def sampling(self) -> str:
        """Where the source's definitions of this row are not those of the others; "" where they are."""
        row, words = self.row, list[str]()
        if row.window != WINDOW:
            words.append(
                f"its speed RMS is over [0, {row.window}T], as its printed figure shows, not [0, {WINDOW}T]"
            )
        if row.acceleration == "speed":
            rms = f", their RMS over [0, {WINDOW}T]" if "a_rms_m_s2" in row.columns else ""
            words.append(
                f"its accelerations are differences of the simulated speed over {SOURCE_SAMPLE_S * 1e3:g} ms{rms}"
            )
        if row.acceleration == "filtered":
            words.append(
                f"its accelerations are the jerk model's output at the {INTERVALS + 1} nodes"
            )
        if row.method in SHAPERS and row.samples == "fine":
            words.append(f"ours: the law at {FINE + 1} even points, the source's are not known")
        if row.method in CLOSED:
            words.append(f"ours: the exact solution at {SOURCE_MESH_POINTS} even points")
        return "; ".join(words) if self.ours else ""

    @property
    def as_expected(self) -> bool:
        """Whether exactly the columns differ that the row names; of a dash nothing is expected."""
        return set(self.off) == set(self.row.off) and bool(self.ours) >= bool(self.row.figures)


def tolerance(column: str) -> float:
    """Relative difference up to which a column counts as reproduced."""
    return RESIDUAL_TOLERANCE if "_res_" in column else TOLERANCE


def compare(
    table: str, seconds: Callable[[PublishedRow], float] | None = None
) -> list[RowComparison]:
    """Every row of one table; seconds(row) says how long our planner takes. Raises PlanError for an unknown table."""
    return [_compare(row, seconds) for row in rows(table)]


def planning_time(timer: Callable[[], float]) -> Callable[[PublishedRow], float]:
    """Seconds that our planner of a row's kind takes once it has loaded what it needs; rows of the same plan are timed once."""
    known: dict[tuple[object, ...], float] = {}
    warm: set[str] = set()

    def seconds(row: PublishedRow) -> float:
        plan, problem = PLANNERS[row.method], problem_of(row)
        if row.method not in warm:
            plan(problem)
            warm.add(row.method)
        same = (row.method, row.bars, row.input, row.robust, row.time_s)
        if same not in known:
            known[same] = _seconds(plan, problem, timer)
        return known[same]

    return seconds


def problem_of(row: PublishedRow) -> Problem:
    """The row's move of its load."""
    model: Model = TWO_BARS if row.bars else PENDULUM
    robust = (("length_2" if row.bars else "length"),) if row.robust else ()
    return Problem(
        distance_m=DISTANCE_M, time_s=row.time_s, model=model, input=row.input, robust=robust
    )


def _compare(row: PublishedRow, seconds: Callable[[PublishedRow], float] | None) -> RowComparison:
    problem = problem_of(row)
    try:
        best = PLANNERS[row.method if row.method in SHAPERS else "convolution"](problem)
    except Infeasible as refusal:
        return RowComparison(row=row, ours={}, exact={}, compute_s=None, refused=str(refusal))
    plant, nodes = _played(row, problem, best)
    return RowComparison(
        row=row,
        ours=measure(
            plant,
            nodes,
            window=row.window,
            acceleration="speed" if row.acceleration == "speed" else "nodes",
        ),
        exact=exact_metrics(problem.model, best),
        compute_s=seconds(row) if seconds else None,
    )


def _played(row: PublishedRow, problem: Problem, best: Trajectory) -> tuple[StateSpace, InputNodes]:
    """What the source simulated: its plant, and the technique's own nodes."""
    plant = problem.model.state_space(problem.input)
    if row.method in SHAPERS:
        derivatives = int(row.method == "zvd")
        return plant, shaped_nodes(
            DISTANCE_M, row.time_s, HALF_PERIODS_S[row.bars], derivatives, row.samples
        )
    if row.method == "shooting":
        return plant, shooting_nodes(PENDULUM, DISTANCE_M, row.time_s, robust=row.robust)
    if row.method != "finite_differences":
        t = np.linspace(0.0, row.time_s, SOURCE_MESH_POINTS)
        return plant, InputNodes(t, _input_along(problem, plant, best, t))
    nodes = solve_trapezoidal(linear_problem(problem), INTERVALS)
    if row.acceleration != "filtered":
        return plant, InputNodes(nodes.t_s, nodes.input)
    # the source drove the bars through the jerk model's filter, the pendulum by the nodes of what comes out of it
    acceleration = nodes.states[:, plant.states.index("acceleration_m_s2")]
    return problem.model.state_space(), InputNodes(nodes.t_s, acceleration)


def _input_along(
    problem: Problem, plant: StateSpace, trajectory: Trajectory, t_s: FloatArray
) -> FloatArray:
    """Acceleration of the platform, or the force that gives it with the load swinging: (m,) at even times."""
    acceleration = trajectory.at(t_s, 2)
    if problem.input == "acceleration":
        return acceleration
    states = states_along(problem.model, trajectory, len(t_s) - 1)
    return np.asarray((acceleration - states @ plant.a[1]) / plant.b[1, 0])


def _seconds(plan: Planner, problem: Problem, timer: Callable[[], float]) -> float:
    """Median of as many runs as the patience allows, at least one."""
    times: list[float] = []
    while len(times) < RUNS and sum(times) < PATIENCE_S:
        begin = timer()
        plan(problem)
        times.append(timer() - begin)
    return statistics.median(times)
