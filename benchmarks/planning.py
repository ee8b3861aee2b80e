"""How fast the planners are beside what one would use otherwise, in the same run: `make bench`
(`python -m benchmarks.planning [--short]`).

Peers: scipy.integrate.solve_bvp with analytic Jacobians (tolerance 1e-6, the tables' grid of 201
nodes), and CasADi with IPOPT on Legendre collocation of degree 3 over 100 intervals (solve and
build apart). Medians over repeats; machines share their cores, so read the ratios, and the first
line for the speed of the interpreter itself.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp

from benchmarks.timing import interpreter_line, is_short, median_s, timed_s
from comms.clock import stopwatch_s
from planners.boundary_value import convolution, matrix_exponential
from planners.boundary_value.linear import LinearProblem, linear_problem
from planners.catalog import BOUNDARY_VALUE, PLANNERS
from planners.errors import PlanError
from planners.models.model import Model
from planners.problem import Problem
from rig.studies.thesis_tables.loads import PENDULUM, TWO_BARS

CASES: tuple[tuple[str, Model, str, tuple[str, ...], tuple[float, ...]], ...] = (
    ("2 dof", PENDULUM, "acceleration", (), (2.0, 1.5, 1.1, 0.75, 0.5)),
    ("2 dof force", PENDULUM, "force", (), (2.0, 1.5, 0.5)),
    ("2 dof robust", PENDULUM, "acceleration", ("length",), (2.5, 2.0, 1.5)),
    ("2 dof jerk", PENDULUM, "jerk", (), (2.0, 1.5)),
    ("2 dof robust jerk", PENDULUM, "jerk", ("length",), (2.0, 1.5)),
    ("3 dof", TWO_BARS, "acceleration", (), (2.5, 2.0, 1.5)),
    ("3 dof force", TWO_BARS, "force", (), (2.0, 1.5)),
    ("3 dof robust", TWO_BARS, "acceleration", ("length_2",), (2.5, 2.0, 1.5)),
    ("3 dof jerk", TWO_BARS, "jerk", (), (2.0, 1.5)),
    ("3 dof robust jerk", TWO_BARS, "jerk", ("length_2",), (2.0, 1.5)),
)
HEAD = (
    f"{'problem':20s}{'T s':>5s}{'coeff':>8s}{'plan':>8s}{'+1001':>8s}{'mat.exp':>8s}"
    f"{'solve_bvp':>10s}{'IPOPT':>10s}{'build':>10s}    ratios"
)
SAMPLES, NODES, INTERVALS, DEGREE = 1001, 201, 100, 3


def main() -> None:
    """Measure and print."""
    try:
        import casadi
    except ImportError:
        casadi = None
        print("CasADi is not installed (make bench installs it); its columns stay empty")
    print(interpreter_line(), end="\n\n")
    print(
        "us: coefficients (Gramian and solve), plan, plan and 1001 positions, the same plan by "
        "matrix_exponential;"
    )
    print(
        "ms: solve_bvp, IPOPT and its building; ratios: solve_bvp and IPOPT over plan and 1001 "
        "positions"
    )
    print(HEAD)
    cases = CASES[:1] if is_short() else CASES
    problems = [(name, _problem(m, i, r, t)) for name, m, i, r, times in cases for t in times]
    for name, problem in problems:
        _row(name, problem, casadi)
    _all_solvers(problems)


def _problem(model: Model, input: str, robust: tuple[str, ...], time_s: float) -> Problem:
    return Problem(distance_m=0.2, time_s=time_s, model=model, input=input, robust=robust)


def _row(name: str, problem: Problem, casadi: Any) -> None:
    linear, t = linear_problem(problem), np.linspace(0.0, problem.time_s, SAMPLES)
    coefficients = median_s(lambda: convolution.coefficients(linear), 200)
    plan = median_s(lambda: convolution.plan_convolution(problem), 200)
    whole = median_s(lambda: convolution.plan_convolution(problem).at(t), 200)
    flow = median_s(lambda: matrix_exponential.plan_matrix_exponential(problem), 100)
    bvp = median_s(lambda: _solve_bvp(linear), 3)
    solve = build = float("nan")
    if casadi is not None:
        build = timed_s(lambda: _casadi(casadi, linear))
        solver = _casadi(casadi, linear)
        solve = median_s(solver, 3)
    micro = "".join(f"{seconds * 1e6:8.0f}" for seconds in (coefficients, plan, whole, flow))
    milli = "".join(f"{seconds * 1e3:10.1f}" for seconds in (bvp, solve, build))
    ratios = "".join(f"{peer / whole:9.0f}x" for peer in (bvp, solve) if peer == peer)
    print(f"{name:20s}{problem.time_s:5g}{micro}{milli}{ratios}", flush=True)


def _all_solvers(problems: list[tuple[str, Problem]]) -> None:
    print(f"\nall five solvers over all {len(problems)} problems")
    total = 0.0
    for planner in BOUNDARY_VALUE:
        began, refused = stopwatch_s(), []
        for name, problem in problems:
            try:
                PLANNERS[planner](problem)
            except PlanError:
                refused.append(f"{name} {problem.time_s:g}")
        spent = stopwatch_s() - began
        total += spent
        note = f"refused: {len(refused)}: {', '.join(refused)}" if refused else ""
        print(f"{planner:20s}{spent:8.3f} s   {note}")
    print(f"{'together':20s}{total:8.3f} s")


def _solve_bvp(linear: LinearProblem) -> None:
    n, s = len(linear.start), linear.hamiltonian
    left, right = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n))
    left[:n, :n], right[n:, :n] = np.eye(n), np.eye(n)
    found = solve_bvp(
        lambda t, z: s @ z,
        lambda a, b: np.concatenate([a[:n] - linear.start, b[:n] - linear.goal]),
        np.linspace(0.0, linear.time_s, NODES),
        np.zeros((2 * n, NODES)),
        fun_jac=lambda t, z: np.repeat(s[:, :, None], t.size, axis=2),
        bc_jac=lambda a, b: (left, right),
        tol=1e-6,
        max_nodes=100_000,
    )
    if found.status:
        print(f"solve_bvp: {found.message}", file=sys.stderr)


def _casadi(casadi: Any, linear: LinearProblem) -> Callable[[], Any]:
    n, h = len(linear.start), linear.time_s / INTERVALS
    slopes, ends, weights = (
        np.array(m) for m in casadi.collocation_coeff(casadi.collocation_points(DEGREE, "legendre"))
    )
    x = casadi.MX.sym("x", n)
    variables, constraints, cost = [x], [x - linear.start], 0
    for k in range(INTERVALS):
        xc, u = casadi.MX.sym(f"c{k}", n, DEGREE), casadi.MX.sym(f"u{k}", 1, DEGREE)
        z = casadi.horzcat(x, xc)
        rates = casadi.mtimes(linear.a, xc) + casadi.mtimes(linear.b.reshape(-1, 1), u)
        constraints.append(casadi.vec(casadi.mtimes(z, slopes) - h * rates))
        cost += 0.5 * h * casadi.mtimes(u**2, weights.reshape(-1, 1))
        end, x = casadi.mtimes(z, ends.reshape(-1, 1)), casadi.MX.sym(f"x{k}", n)
        constraints.append(end - x)
        variables += [casadi.vec(xc), casadi.vec(u), x]
    constraints.append(x - linear.goal)
    nlp = {"x": casadi.vertcat(*variables), "f": cost, "g": casadi.vertcat(*constraints)}
    options = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"}
    solver = casadi.nlpsol("s", "ipopt", nlp, options)
    return lambda: solver(x0=0.0, lbg=0.0, ubg=0.0)


if __name__ == "__main__":
    main()
